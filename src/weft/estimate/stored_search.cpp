#include "weft/estimate/stored_search.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>
#include <string>

#include "weft/estimate/content_hash.h"
#include "weft/estimate/packed_numbers.h"

namespace weft {
namespace {

/// All that the numbers depend on beside what the store knows (captures, alpha among their options,
/// starts, fabric, frames).
std::string key_of(const char* kind, const Problem& problem, const LinearizationOptions& options) {
  const ResidualOptions& r = options.residual;
  ContentHash ranges;  // derivatives are by parts of them
  for (int i = 0; i < problem.dimension(); ++i) {
    ranges.add(problem.info(i).lower);
    ranges.add(problem.info(i).upper);
    ranges.add(problem.info(i).scale);
  }
  return fmt::format(
      "{} by {} in {}; folds {:.17g} {:.17g}, phase {:.17g} {:.17g}, silhouette {:.17g}, stride "
      "{}, "
      "derivatives {} {:.17g}, turns {:.17g} {:.17g}, motion {:.17g} {:.17g}",
      kind, fmt::join(problem.free(), " "), ranges.hex(), r.fold_weight, r.fold_scale,
      r.phase_weight, r.phase_scale, r.silhouette_sigma, r.stride, static_cast<int>(r.derivatives),
      r.image_step, r.largest_turn, r.largest_phase_turn, options.least_motion,
      options.unstable_motion);
}

void write(const ProblemEvaluation& evaluation, NumberWriter& writer) {
  for (const double number :
       {evaluation.error, evaluation.error_per_frame, evaluation.fold, evaluation.silhouette,
        evaluation.diverged ? 1.0 : 0.0, evaluation.wall_s})
    writer.add(number);
}

ProblemEvaluation read_evaluation(NumberReader& reader) {
  ProblemEvaluation evaluation;
  evaluation.error = reader.number();
  evaluation.error_per_frame = reader.number();
  evaluation.fold = reader.number();
  evaluation.silhouette = reader.number();
  evaluation.diverged = reader.number() != 0;
  evaluation.wall_s = reader.number();
  return evaluation;
}

/// Through the store: what `read` makes of its numbers, else what `compute` finds, kept as `write`
/// has it.
template <typename Found>
Found through(EvaluationStore* store, const char* kind, const Problem& problem, const VecX& scaled,
              const LinearizationOptions& options, const auto& compute, const auto& read,
              const auto& write_found) {
  if (!store || options.simulator) return compute();
  const Fabric fabric = problem.fabric(scaled);
  const std::string key = key_of(kind, problem, options);
  if (const auto numbers = store->find_numbers(problem, fabric, options.frame_count, key)) {
    NumberReader reader(*numbers);
    Found found = read(reader);
    found.replayed = true;
    return found;
  }
  const Found found = compute();
  NumberWriter writer;
  write_found(found, writer);
  store->add_numbers(problem, fabric, options.frame_count, key, writer.numbers());
  return found;
}

using Trials = std::vector<std::shared_ptr<const Trial>>;

/// Of each trial whether it has another start, and which: replayed where the problem was asked with
/// the same other starts, else what `find` makes of its trials, which stay as they are where that
/// was stopped. `change` gives a trial a start.
Trials starts_through(EvaluationStore* store, const char* kind, const Problem& problem,
                      const Fabric& fabric, int frame_count, const auto& find, const auto& change) {
  const Trials& before = problem.trials();
  if (!store) return std::optional<Trials>(find(before)).value_or(before);
  ContentHash others;
  for (const auto& trial : before)
    for (const Points& start : trial->other_starts) others.add(start);
  const std::string key = fmt::format("{}, others {}", kind, others.hex());
  if (const auto numbers = store->find_numbers(problem, fabric, frame_count, key)) {
    NumberReader reader(*numbers);
    Trials found = before;
    for (auto& trial : found)
      if (reader.number() != 0)
        trial = change(*trial, Points(reader.matrix(3, trial->scene.start.cols())));
    return found;
  }
  const std::optional<Trials> found = find(before);
  if (!found) return before;
  NumberWriter writer;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const auto& trial = (*found)[i];
    writer.add(trial == before[i] ? 0 : 1);
    if (trial != before[i]) writer.add(trial->scene.start);
  }
  store->add_numbers(problem, fabric, frame_count, key, writer.numbers());
  return *found;
}

}  // namespace

StoredCost evaluate_cost_stored(const Problem& problem, const VecX& scaled,
                                const LinearizationOptions& options, EvaluationStore* store) {
  return through<StoredCost>(
      store, "cost", problem, scaled, options,
      [&] { return StoredCost{evaluate_cost(problem, scaled, options)}; },
      [](NumberReader& reader) {
        const double cost = reader.number();
        return StoredCost{{cost, read_evaluation(reader)}};
      },
      [](const StoredCost& found, NumberWriter& writer) {
        writer.add(found.cost);
        write(found.evaluation, writer);
      });
}

StoredLinearization linearize_stored(const Problem& problem, const VecX& scaled,
                                     const LinearizationOptions& options, EvaluationStore* store) {
  return through<StoredLinearization>(
      store, "linearization", problem, scaled, options,
      [&] {
        ProblemLinearization found = linearize(problem, scaled, options);
        return StoredLinearization{found.evaluation, std::move(found.model)};
      },
      [&](NumberReader& reader) {
        StoredLinearization found;
        found.evaluation = read_evaluation(reader);
        found.model.cost = reader.number();
        if (reader.done()) return found;  // an infinite cost has no derivatives
        found.model.gradient = reader.vector(scaled.size());
        found.model.hessian = reader.matrix(scaled.size(), scaled.size());
        return found;
      },
      [](const StoredLinearization& found, NumberWriter& writer) {
        write(found.evaluation, writer);
        writer.add(found.model.cost);
        writer.add(found.model.gradient);
        writer.add(found.model.hessian);
      });
}

Trials with_starts_for_stored(const Problem& problem, const Fabric& fabric, int frame_count,
                              int threads, EvaluationStore* store, const StartObserver& observer) {
  bool stopped = false;
  const StartObserver watched = [&] {
    stopped = stopped || (observer && !observer());
    return !stopped;
  };
  return starts_through(
      store, "suited starts", problem, fabric, frame_count,
      [&](const Trials& trials) -> std::optional<Trials> {
        Trials found = with_starts_for(trials, fabric, frame_count, threads, watched);
        return stopped ? std::nullopt : std::optional(std::move(found));
      },
      with_start_beside_own);
}

Trials with_settled_starts_stored(const Problem& problem, const Fabric& fabric, int threads,
                                  EvaluationStore* store) {
  return starts_through(
      store, "settled starts", problem, fabric, 0,
      [&](const Trials& trials) { return with_settled_starts(trials, fabric, threads); },
      with_start);
}

}  // namespace weft
