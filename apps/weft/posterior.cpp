#include "weft/estimate/posterior.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.h"
#include "estimate_of_fit.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/files.h"
#include "weft/base/interrupt.h"
#include "weft/base/text_file.h"
#include "weft/estimate/evaluation_store.h"
#include "weft/estimate/stored_evaluations.h"
#include "weft/report/marginals_plot.h"
#include "weft/report/text.h"

namespace weft::app {
namespace {

constexpr double kProbabilities[] = {0.05, 0.25, 0.5, 0.75, 0.95};
constexpr std::size_t kMostRows = 20000;  // of posterior.csv
// Of the error: start surfaces of older versions have nine digits.
constexpr double kSameLeastError = 1e-3;

struct PosteriorArguments {
  std::string fit;
  std::string out;
  SamplingOptions sampling;
  bool true_cost = false;
  bool overwrite = false;
  TrialArguments trial;
};

const std::vector<std::string>& parameter_names(const EstimateOfFit& e) {
  return e.report.certainty->parameters;
}

ReportParameter::Scale report_scale(Scale scale) {
  switch (scale) {
    case Scale::logarithmic:
      return ReportParameter::Scale::logarithmic;
    case Scale::shifted_log:
      return ReportParameter::Scale::shifted_logarithmic;
    case Scale::linear:
      break;
  }
  return ReportParameter::Scale::linear;
}

/// What the fit held.
std::map<std::string, double> values_beside(const Fabric& fabric,
                                            const std::vector<std::string>& searched) {
  std::map<std::string, double> values;
  for (const std::string& name : fabric.value_names())
    if (std::find(searched.begin(), searched.end(), name) == searched.end())
      values[name] = fabric.value(name);
  return values;
}

/// Corrected by the evaluations of a fit to video; those of fits at rest are kept by what they
/// started from, not by their parameters.
LikelihoodSurrogate surrogate_of(const EstimateOfFit& e, const std::filesystem::path& folder) {
  std::vector<LikelihoodPoint> points;
  const std::filesystem::path store = folder / "evaluations.sqlite";
  if (e.at_rest.is_null() && path_exists(store)) {
    if (e.problem.empty())
      throw Error(fmt::format("{}: \"problem\" is missing; fit again with this version",
                              (folder / "result.json").string()));
    const std::vector<std::string> names = parameter_names(e);
    for (const StoredPoint& stored :
         read_evaluations(store, e.problem, names, values_beside(e.fabric, names))) {
      LikelihoodPoint point{VecX(stored.values.size()),
                            (stored.error - e.report.error) / e.dispersion};
      for (Eigen::Index i = 0; i < point.x.size(); ++i)
        point.x[i] = to_scaled(e.info(static_cast<std::size_t>(i)), stored.values[i]);
      points.push_back(std::move(point));
    }
  }
  return {e.scaled, e.information, e.slope, points};
}

/// Simulates from where the fit did; evaluations go to the fit's store and are replayed from it.
class TrueCost {
 public:
  TrueCost(const EstimateOfFit& e, const std::filesystem::path& folder,
           const TrialArguments& arguments)
      : e_(e), threads_(arguments.threads()) {
    std::vector<std::shared_ptr<const Trial>> trials;
    for (const ReportCapture& reported : e.report.captures) {
      Capture capture = read_capture(reported.folder);
      capture.start_surface = start_file(folder, trials.size());
      trials.push_back(arguments.prepare(capture, TrialArguments::Frames::fit));
    }
    problem_.emplace(trials, e.fabric, parameter_names(e));
    store_.emplace(folder / "evaluations.sqlite");
    least_ = error_at(e.scaled);
    check_error(e, folder,
                {least_, kSameLeastError,
                 "with these options of simulating and comparing; give those of the fit "
                 "(--grid, ...)"});
  }
  double cost(const VecX& x) { return (error_at(x) - least_) / e_.dispersion; }

 private:
  double error_at(const VecX& x) {
    return evaluate_stored(*problem_, problem_->fabric(x), 0, "posterior", &*store_, threads_)
        .evaluation.error;
  }

  const EstimateOfFit& e_;
  int threads_;
  double least_ = 0;  // at the estimate
  std::optional<Problem> problem_;
  std::optional<EvaluationStore> store_;
};

/// Of parameter i, in its unit.
std::vector<double> values_of(const EstimateOfFit& e, const MatX& samples, std::size_t i) {
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(samples.cols()));
  for (Eigen::Index k = 0; k < samples.cols(); ++k)
    values.push_back(from_scaled(e.info(i), samples(static_cast<Eigen::Index>(i), k)));
  return values;
}

void write_samples(const std::filesystem::path& path, const EstimateOfFit& e, const MatX& samples) {
  std::string text;
  const std::vector<std::string>& names = parameter_names(e);
  for (std::size_t i = 0; i < names.size(); ++i) text += (i > 0 ? "," : "") + names[i];
  text += "\n";
  const auto stride = static_cast<Eigen::Index>(
      (static_cast<std::size_t>(samples.cols()) + kMostRows - 1) / kMostRows);
  for (Eigen::Index k = 0; k < samples.cols(); k += stride) {
    for (std::size_t i = 0; i < names.size(); ++i)
      text += (i > 0 ? "," : "") +
              csv_number(from_scaled(e.info(i), samples(static_cast<Eigen::Index>(i), k)));
    text += "\n";
  }
  write_text(path, text);
}

nlohmann::ordered_json json_of(const EstimateOfFit& e, const SamplingResult& found,
                               const PosteriorArguments& arguments) {
  nlohmann::ordered_json parameters;
  for (std::size_t i = 0; i < e.unknowns.size(); ++i) {
    const std::vector<double> values = values_of(e, found.samples, i);
    nlohmann::ordered_json quantiles;
    for (const double p : kProbabilities)
      quantiles[fmt::format("{:g}", p)] = sample_quantile(values, p);
    parameters[parameter_names(e)[i]] = {
        {"unit", e.info(i).unit},
        {"estimate", e.value(i)},
        {"quantiles", quantiles},
        {"effective_samples", found.effective(static_cast<Eigen::Index>(i))}};
  }
  return {{"format", "weft-posterior"},
          {"version", 1},
          {"cost", arguments.true_cost   ? "simulated"
                   : e.at_rest.is_null() ? "surrogate"
                                         : "quadratic"},
          {"seed", arguments.sampling.seed},
          {"samples", found.samples.cols()},
          {"acceptance", found.acceptance},
          {"parameters", parameters}};
}

void write_picture(const std::filesystem::path& path, const EstimateOfFit& e, const MatX& samples) {
  MarginalsPlot plot;
  plot.title = fmt::format("Posterior of {}", e.fabric.name);
  for (std::size_t i = 0; i < e.unknowns.size(); ++i)
    plot.parameters.push_back({parameter_names(e)[i], std::string(e.info(i).unit),
                               values_of(e, samples, i), report_scale(e.info(i).scale),
                               e.value(i)});
  write_plot(path, plot);
}

std::string in_words(const EstimateOfFit& e, const LikelihoodSurrogate& surrogate) {
  std::string correction = "not corrected";
  if (surrogate.length() > 0)
    correction = fmt::format("corrected by {} evaluations over a length of {:g} of the ranges",
                             surrogate.points(), surrogate.length());
  else if (!e.at_rest.is_null())
    correction +=
        ": a fit to cloth at rest keeps no evaluations by their parameters; --true-cost simulates";
  return "surrogate: the quadratic of the Fisher information, " + correction;
}

struct Likelihood {
  std::function<double(const VecX&)> cost;  ///< minus its logarithm, 0 at the estimate
  std::string surrogate;                    ///< in words; empty where each sample is simulated
};

Likelihood likelihood_of(const EstimateOfFit& e, const std::filesystem::path& folder,
                         const PosteriorArguments& arguments) {
  if (!arguments.true_cost) {
    const auto surrogate = std::make_shared<LikelihoodSurrogate>(surrogate_of(e, folder));
    return {[surrogate](const VecX& x) { return surrogate->cost(x); }, in_words(e, *surrogate)};
  }
  if (!e.at_rest.is_null()) return {simulated_at_rest(e, folder, arguments.trial.threads()), ""};
  const auto simulated = std::make_shared<TrueCost>(e, folder, arguments.trial);
  return {[simulated](const VecX& x) { return simulated->cost(x); }, ""};
}

void run_posterior(const PosteriorArguments& arguments) {
  const InterruptGuard guard;
  const std::filesystem::path folder = arguments.fit;
  const EstimateOfFit e = read_estimate_of_fit(folder);
  const std::filesystem::path out =
      arguments.out.empty() ? folder : std::filesystem::path(arguments.out);
  prepare_output_folder(out, {"posterior.json"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  const Likelihood likelihood = likelihood_of(e, folder, arguments);
  const LogDensity density = [&](const VecX& x) {
    const double cost = likelihood.cost(x);
    return std::isfinite(cost) ? -cost - e.priors.cost(x) : -kInfinity;
  };
  const auto n = e.scaled.size();
  const SamplingResult found = sample_ensemble(density, e.scaled, VecX::Zero(n), VecX::Ones(n),
                                               arguments.sampling, progress_observer("steps"));
  const nlohmann::ordered_json json = json_of(e, found, arguments);
  write_samples(out / "posterior.csv", e, found.samples);
  write_picture(out / "posterior.svg", e, found.samples);
  write_text(out / "posterior.json", json.dump(1) + "\n");
  fmt::print("{:<20} {:<11} {:>11} {:>11} {:>11} {:>11}\n", "", "", "5 %", "50 %", "95 %",
             "estimate");
  for (const auto& [name, p] : json["parameters"].items())
    fmt::print("{:<20} {:<11} {:>11.4g} {:>11.4g} {:>11.4g} {:>11.4g}\n", name,
               p["unit"].get<std::string>(), p["quantiles"]["0.05"].get<double>(),
               p["quantiles"]["0.5"].get<double>(), p["quantiles"]["0.95"].get<double>(),
               p["estimate"].get<double>());
  if (!likelihood.surrogate.empty()) fmt::print("{}\n", likelihood.surrogate);
  double least = kInfinity;
  for (Eigen::Index i = 0; i < n; ++i) least = std::min(least, found.effective(i));
  fmt::print("{} samples, worth {:.0f} independent ones or more\n", found.samples.cols(), least);
  if (least < 200) fmt::print("warning: few independent samples; give more --steps\n");
  fmt::print("{}\n", (out / "posterior.svg").string());
}

}  // namespace

void add_posterior(CLI::App& app) {
  auto* command =
      add_command(app, "posterior", "the distribution of the parameters after a fit, by sampling");
  auto arguments = std::make_shared<PosteriorArguments>();
  command->add_option("fit", arguments->fit, "folder of a fit")->required();
  command->add_option(
      "--out", arguments->out,
      "folder for posterior.csv, posterior.json, posterior.svg (default: the fit's)");
  command->add_option("--steps", arguments->sampling.steps, "of each walker that are kept")
      ->check(integer_in(10, 10000000))
      ->capture_default_str();
  command->add_option("--burn-in", arguments->sampling.burn_in, "of each walker before them")
      ->check(integer_in(0, 10000000))
      ->capture_default_str();
  command->add_option("--seed", arguments->sampling.seed)
      ->check(unsigned_integer())
      ->capture_default_str();
  command->add_flag("--true-cost", arguments->true_cost,
                    "simulate each sample instead of the surrogate: 4 evaluations a parameter and "
                    "step (of a fit to cloth at rest with its own options, whatever is given "
                    "here)");
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  command->footer("Example:\n  weft posterior out/cotton --steps 5000");
  command->callback([arguments, command] {
    refuse_without(*command, "--true-cost",
                   {"--grid", "--steps-per-frame", "--integrator", "--alpha", "--fold-threshold",
                    "--cache", "--threads"});
    run_posterior(*arguments);
  });
}

}  // namespace weft::app
