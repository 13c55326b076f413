#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "weft/estimate/problem.h"

namespace weft {

/// evaluations.sqlite (docs/formats.md): every evaluation of a run, durable before the search goes
/// on. A search that is started again asks for the same parameters in the same order and finds them
/// here, so a killed run continues where it stopped. Safe to use from several threads and
/// processes.
class EvaluationStore {
 public:
  /// Opens or creates. `program`, with its version, is whose numbers (below) are found and added:
  /// another one's search goes other ways. Throws Error if `path` cannot be written or is not such
  /// a file.
  explicit EvaluationStore(const std::filesystem::path& path, std::string_view program = {});
  ~EvaluationStore();
  EvaluationStore(EvaluationStore&&) noexcept;

  /// The evaluation of exactly these parameter values, if it was made before.
  std::optional<ProblemEvaluation> find(const Problem& problem, const Fabric& fabric,
                                        int frame_count) const;
  /// `phase` says which part of a run asked for it. An evaluation that is there already stays.
  void add(const Problem& problem, const Fabric& fabric, int frame_count, std::string_view phase,
           const ProblemEvaluation& evaluation);
  /// What a search keeps of a point besides, by a key that says all that it depends on beside
  /// these.
  std::optional<VecX> find_numbers(const Problem& problem, const Fabric& fabric, int frame_count,
                                   std::string_view key) const;
  /// What is there already stays.
  void add_numbers(const Problem& problem, const Fabric& fabric, int frame_count,
                   std::string_view key, const VecX& numbers);
  /// Evaluations of this problem.
  std::size_t count(const Problem& problem) const;
  /// Evaluations of all problems.
  std::size_t count() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Evaluates through the store: replays what is there, adds what is not. `store` may be null.
struct StoredEvaluation {
  ProblemEvaluation evaluation;
  bool replayed = false;
};
StoredEvaluation evaluate_stored(const Problem& problem, const Fabric& fabric, int frame_count,
                                 std::string_view phase, EvaluationStore* store, int threads = 1);

}  // namespace weft
