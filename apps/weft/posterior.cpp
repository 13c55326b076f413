#include "weft/estimate/posterior.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "commands.h"
#include "mechanical_beside.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/text_file.h"
#include "weft/estimate/evaluation_store.h"
#include "weft/estimate/stored_evaluations.h"
#include "weft/fabric/prior.h"
#include "weft/report/marginals_plot.h"
#include "weft/report/result.h"
#include "weft/report/text.h"

namespace weft::app {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kProbabilities[] = {0.05, 0.25, 0.5, 0.75, 0.95};
constexpr std::size_t kMostRows = 20000;  // of posterior.csv

struct Arguments {
  std::string fit;
  std::string out;
  SamplingOptions sampling;
  bool true_cost = false;
  bool overwrite = false;
  TrialArguments trial;
};

/// What a fit left, as far as sampling needs it.
struct Estimate {
  Fabric fabric;
  Report report;
  std::vector<std::string> names;  ///< of the free parameters
  std::vector<ParameterInfo> infos;
  VecX scaled;
  MatX information;
  double dispersion = 0, error = 0;
  std::vector<ParameterPrior> priors;
};

Estimate read_estimate(const std::filesystem::path& folder) {
  Estimate e;
  const std::filesystem::path file = folder / "result.json";
  e.report = read_result(file);
  e.fabric = read_fabric(folder / "fabric.toml");
  if (e.report.captures.empty())
    throw Error(
        fmt::format("{}: fitted without a video: a posterior is sampled of fits to video; the "
                    "intervals and the covariance of result.json have what is known",
                    file.string()));
  if (!e.report.certainty)
    throw Error(
        fmt::format("{}: certainty: is missing; a fit that ended writes it", file.string()));
  const ReportCertainty& certainty = *e.report.certainty;
  if (!(certainty.dispersion > 0) || !std::isfinite(certainty.dispersion))
    throw Error(
        fmt::format("{}: certainty.dispersion: the noise level is not known", file.string()));
  for (const auto& [name, value] : e.report.settings)
    if (name == kMechanicalSetting)
      throw Error(fmt::format(
          "{}: fitted with mechanical captures, whose likelihood is not kept with the evaluations; "
          "the intervals of result.json have it",
          file.string()));
  e.names = certainty.parameters;
  e.scaled.resize(static_cast<Eigen::Index>(e.names.size()));
  for (std::size_t i = 0; i < e.names.size(); ++i) {
    e.infos.push_back(e.fabric.info(e.fabric.value_index(e.names[i])));
    e.scaled[static_cast<Eigen::Index>(i)] =
        std::clamp(to_scaled(e.infos[i], e.fabric.value(e.names[i])), 0.0, 1.0);
  }
  e.information = certainty.information;
  e.dispersion = certainty.dispersion;
  e.error = e.report.error;
  for (const ReportParameter& p : e.report.parameters)
    if (p.prior_median && p.prior_factor)
      e.priors.push_back({p.name, *p.prior_median, *p.prior_factor});
  return e;
}

double prior_cost(const Estimate& e, const VecX& x) {
  double cost = 0;
  for (const ParameterPrior& prior : e.priors) {
    const auto at = std::find(e.names.begin(), e.names.end(), prior.parameter);
    if (at == e.names.end()) continue;
    const auto i = at - e.names.begin();
    const ScaledPrior scaled = scaled_prior(e.infos[static_cast<std::size_t>(i)], prior);
    const double z = (x[i] - scaled.mean) / scaled.deviation;
    cost += 0.5 * z * z;
  }
  return cost;
}

LikelihoodSurrogate surrogate_of(const Estimate& e, const std::filesystem::path& folder) {
  std::vector<LikelihoodPoint> points;
  const std::filesystem::path store = folder / "evaluations.sqlite";
  if (std::filesystem::exists(store)) {
    for (const StoredPoint& stored : read_evaluations(store, e.names)) {
      LikelihoodPoint point{VecX(stored.values.size()), (stored.error - e.error) / e.dispersion};
      for (Eigen::Index i = 0; i < point.x.size(); ++i)
        point.x[i] = to_scaled(e.infos[static_cast<std::size_t>(i)], stored.values[i]);
      points.push_back(std::move(point));
    }
  }
  return {e.scaled, e.information, points};
}

/// Simulates; evaluations go to the fit's store and are replayed from it.
class TrueCost {
 public:
  TrueCost(const Estimate& e, const std::filesystem::path& folder, const TrialArguments& arguments)
      : e_(e), threads_(arguments.threads()) {
    std::vector<std::shared_ptr<const Trial>> trials;
    for (const ReportCapture& capture : e.report.captures)
      trials.push_back(
          arguments.prepare(read_capture(capture.folder), TrialArguments::Frames::fit));
    problem_.emplace(trials, e.fabric, e.names);
    store_.emplace(folder / "evaluations.sqlite");
    if (store_->count() > 0 && store_->count(*problem_) == 0)
      throw Error(
          fmt::format("{}: its evaluations are of other options of simulating and comparing; "
                      "give those of the fit (--grid, ...)",
                      folder.string()));
  }
  double cost(const VecX& x) {
    const StoredEvaluation found =
        evaluate_stored(*problem_, problem_->fabric(x), 0, "posterior", &*store_, threads_);
    return (found.evaluation.error - e_.error) / e_.dispersion;
  }

 private:
  const Estimate& e_;
  int threads_;
  std::optional<Problem> problem_;
  std::optional<EvaluationStore> store_;
};

/// Of parameter i, in its unit.
std::vector<double> values_of(const Estimate& e, const MatX& samples, std::size_t i) {
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(samples.cols()));
  for (Eigen::Index k = 0; k < samples.cols(); ++k)
    values.push_back(from_scaled(e.infos[i], samples(static_cast<Eigen::Index>(i), k)));
  return values;
}

void write_samples(const std::filesystem::path& path, const Estimate& e, const MatX& samples) {
  std::string text;
  for (std::size_t i = 0; i < e.names.size(); ++i) text += (i > 0 ? "," : "") + e.names[i];
  text += "\n";
  const auto stride = static_cast<Eigen::Index>(
      (static_cast<std::size_t>(samples.cols()) + kMostRows - 1) / kMostRows);
  for (Eigen::Index k = 0; k < samples.cols(); k += stride) {
    for (std::size_t i = 0; i < e.names.size(); ++i)
      text += (i > 0 ? "," : "") +
              csv_number(from_scaled(e.infos[i], samples(static_cast<Eigen::Index>(i), k)));
    text += "\n";
  }
  write_text(path, text);
}

nlohmann::ordered_json json_of(const Estimate& e, const SamplingResult& found,
                               const Arguments& arguments) {
  nlohmann::ordered_json parameters;
  for (std::size_t i = 0; i < e.names.size(); ++i) {
    const std::vector<double> values = values_of(e, found.samples, i);
    nlohmann::ordered_json quantiles;
    for (const double p : kProbabilities)
      quantiles[fmt::format("{:g}", p)] = sample_quantile(values, p);
    parameters[e.names[i]] = {{"unit", e.infos[i].unit},
                              {"estimate", e.fabric.value(e.names[i])},
                              {"quantiles", quantiles},
                              {"effective_samples", found.effective(static_cast<Eigen::Index>(i))}};
  }
  return {{"format", "weft-posterior"},
          {"version", 1},
          {"cost", arguments.true_cost ? "simulated" : "surrogate"},
          {"seed", arguments.sampling.seed},
          {"samples", found.samples.cols()},
          {"acceptance", found.acceptance},
          {"parameters", parameters}};
}

void write_picture(const std::filesystem::path& path, const Estimate& e, const MatX& samples) {
  MarginalsPlot plot;
  plot.title = fmt::format("Posterior of {}", e.fabric.name);
  for (std::size_t i = 0; i < e.names.size(); ++i)
    plot.parameters.push_back({e.names[i], std::string(e.infos[i].unit), values_of(e, samples, i),
                               e.infos[i].scale == Scale::logarithmic
                                   ? ReportParameter::Scale::logarithmic
                                   : ReportParameter::Scale::shifted_logarithmic,
                               e.fabric.value(e.names[i])});
  write_plot(path, plot);
}

void run(const Arguments& arguments) {
  const InterruptGuard guard;
  const std::filesystem::path folder = arguments.fit;
  const Estimate e = read_estimate(folder);
  const std::filesystem::path out =
      arguments.out.empty() ? folder : std::filesystem::path(arguments.out);
  prepare_output_folder(out, {"posterior.json"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  std::optional<TrueCost> simulated;
  const LikelihoodSurrogate surrogate = surrogate_of(e, folder);
  if (arguments.true_cost) simulated.emplace(e, folder, arguments.trial);
  const LogDensity density = [&](const VecX& x) {
    const double cost = simulated ? simulated->cost(x) : surrogate.cost(x);
    return std::isfinite(cost) ? -cost - prior_cost(e, x) : -kInfinity;
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
  if (!simulated)
    fmt::print("surrogate: the quadratic of the Fisher information, {}\n",
               surrogate.length() > 0
                   ? fmt::format("corrected by {} evaluations over a length of {:g} of the ranges",
                                 surrogate.points(), surrogate.length())
                   : "not corrected");
  double least = kInfinity;
  for (Eigen::Index i = 0; i < n; ++i) least = std::min(least, found.effective(i));
  fmt::print("{} samples, worth {:.0f} independent ones or more\n", found.samples.cols(), least);
  if (least < 200) fmt::print("warning: few independent samples; give more --steps\n");
  fmt::print("{}\n", (out / "posterior.svg").string());
}

}  // namespace

void add_posterior(CLI::App& app) {
  auto* command = app.add_subcommand("posterior",
                                     "the distribution of the parameters after a fit, by sampling");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("fit", arguments->fit, "folder of a fit")->required();
  command->add_option(
      "--out", arguments->out,
      "folder for posterior.csv, posterior.json, posterior.svg (default: the fit's)");
  command->add_option("--steps", arguments->sampling.steps, "of each walker that are kept")
      ->check(CLI::Range(10, 10000000))
      ->capture_default_str();
  command->add_option("--burn-in", arguments->sampling.burn_in, "of each walker before them")
      ->check(CLI::Range(0, 10000000))
      ->capture_default_str();
  command->add_option("--seed", arguments->sampling.seed)
      ->check(unsigned_integer())
      ->capture_default_str();
  command->add_flag("--true-cost", arguments->true_cost,
                    "simulate each sample instead of the surrogate: 4 evaluations a parameter and "
                    "step");
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  command->footer("Example:\n  weft posterior out/cotton --steps 5000");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace weft::app
