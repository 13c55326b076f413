#include "estimate_of_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <utility>

#include "fit_curves.h"
#include "mechanical.h"
#include "mechanical_beside.h"
#include "scan.h"
#include "weft/base/error.h"
#include "weft/estimate/variability.h"

namespace weft::app {
namespace {

/// Of the error at the estimate: the weights of forces are those of the shapes that it ended with.
constexpr double kSameError = 0.05;
constexpr std::string_view kAsTheyAre = "with its captures as they are now: fit again";

std::string file_of(const std::filesystem::path& folder) {
  return (folder / "result.json").string();
}

void check_certainty(const Report& report, const std::string& file) {
  if (!report.certainty)
    throw Error(fmt::format("{}: certainty: is missing; a fit that ended writes it", file));
  const double dispersion = report.certainty->dispersion;
  if (!(dispersion > 0) || !std::isfinite(dispersion))
    throw Error(fmt::format("{}: certainty.dispersion: the noise level is not known", file));
  if (report.captures.empty() && !report.certainty->overdispersion)
    throw Error(
        fmt::format("{}: certainty.overdispersion: is missing; fit again with this version", file));
  if (!report.certainty->information.allFinite())
    throw Error(fmt::format("{}: certainty.information: has a number that is not finite", file));
  for (const auto& [name, value] : report.settings)
    if (name == kMechanicalSetting)
      throw Error(fmt::format(
          "{}: fitted with mechanical captures, whose likelihood is not kept with the evaluations; "
          "the intervals of result.json have it",
          file));
}

void check_same(const std::filesystem::path& fabric_file, std::string_view key, double in_fabric,
                double in_result) {
  // Both files have the digits that give the same double again.
  constexpr double kSameNumber = 1e-9;
  const double size = std::max(std::abs(in_fabric), std::abs(in_result));
  if (std::abs(in_fabric - in_result) <= kSameNumber * size) return;
  throw Error(fmt::format("{}: {}: {}, but {} in result.json: not of the same fit",
                          fabric_file.string(), key, in_fabric, in_result));
}

/// A part of result.json that a Report does not have, and its name in errors.
class ResultEntry {
 public:
  ResultEntry(const nlohmann::json& value, std::string file, std::string key)
      : value_(value), file_(std::move(file)), key_(std::move(key)) {}

  ResultEntry member(const std::string& key) const {
    const std::string name = key_.empty() ? key : key_ + "." + key;
    if (!value_.contains(key))
      throw Error(fmt::format("{}: {}: is missing; fit again with this version", file_, name));
    return {value_[key], file_, name};
  }
  std::vector<ResultEntry> elements() const {
    if (!value_.is_array()) fail("an array is needed");
    std::vector<ResultEntry> entries;
    for (const nlohmann::json& value : value_)
      entries.emplace_back(value, file_, fmt::format("{}[{}]", key_, entries.size()));
    return entries;
  }
  std::string text() const {
    if (!value_.is_string()) fail("a text is needed");
    return value_.get<std::string>();
  }
  double number() const {
    if (!value_.is_number()) fail("a number is needed");
    return value_.get<double>();
  }
  [[noreturn]] void fail(const std::string& reason) const {
    throw Error(fmt::format("{}: {}: {}", file_, key_, reason));
  }

 private:
  const nlohmann::json& value_;
  std::string file_, key_;
};

/// Of the rows of the fabric: all control values of a curve have the same.
std::vector<ParameterPrior> priors_in(const Report& report, const Fabric& fabric) {
  std::vector<ParameterPrior> priors;
  for (const ParameterInfo& row : model_parameters(fabric.model)) {
    if (fabric.value_count(row.name) == 0) continue;
    const std::string_view first = fabric.info(fabric.first_value(row.name)).name;
    for (const ReportParameter& p : report.parameters)
      if (p.name == first && p.free && p.prior_median && p.prior_factor)
        priors.push_back({std::string(row.name), *p.prior_median, *p.prior_factor});
  }
  return priors;
}

}  // namespace

double EstimateOfFit::value(std::size_t i) const {
  const auto& [index, factor] = unknowns[i].values.front();
  return fabric.values[index] / factor;
}

Fabric EstimateOfFit::at(const VecX& scaled) const {
  Fabric there = fabric;
  for (std::size_t i = 0; i < unknowns.size(); ++i)
    for (const auto& [index, factor] : unknowns[i].values)
      there.values[index] =
          factor * from_scaled(unknowns[i].info, scaled[static_cast<Eigen::Index>(i)]);
  return there;
}

std::filesystem::path start_file(const std::filesystem::path& folder, std::size_t k) {
  return folder / fmt::format("start_{}.obj", k + 1);
}

void check_error(const EstimateOfFit& e, const std::filesystem::path& folder,
                 const ErrorAgain& again) {
  const double then = e.report.error;
  if (std::abs(again.error - then) <= again.tolerance * then) return;
  throw Error(fmt::format("{}: error {:.6g}, but {:.6g} {}", file_of(folder), then, again.error,
                          again.with));
}

void check_same_fabric(const Report& report, const Fabric& fabric,
                       const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "fabric.toml";
  if (report.model != fabric.model)
    throw Error(fmt::format("{}: model: \"{}\", but \"{}\" in result.json: not of the same fit",
                            file.string(), fabric.model, report.model));
  const std::vector<std::string> names = fabric.value_names();
  for (const ReportParameter& p : report.parameters)
    if (std::ranges::find(names, p.name) == names.end())
      throw Error(
          fmt::format("{}: parameters.{}: is missing, but {} in result.json: not of the "
                      "same fit",
                      file.string(), p.name, p.value));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string key = "parameters." + names[i];
    const auto found = std::ranges::find(report.parameters, names[i], &ReportParameter::name);
    const auto index = static_cast<int>(i);
    if (found == report.parameters.end())
      throw Error(fmt::format("{}: {}: is missing, but {} in fabric.toml: not of the same fit",
                              file_of(folder), key, fabric.values[index]));
    check_same(file, key, fabric.values[index], found->value);
    check_same(file, key + ".lower", fabric.info(index).lower, found->lower);
    check_same(file, key + ".upper", fabric.info(index).upper, found->upper);
  }
}

namespace {

/// Priors balance the data where they pull, so that the sum of both slopes is zero, but for a
/// parameter that a bound holds.
VecX slope_at(const EstimateOfFit& e, const std::filesystem::path& folder) {
  const Eigen::Index n = e.scaled.size();
  const VecX prior = e.priors.empty() ? VecX::Zero(n) : e.priors.term(e.scaled, n).gradient;
  const ReportCertainty& certainty = *e.report.certainty;
  VecX slope = -prior;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (e.scaled[i] >= at_bound_distance && e.scaled[i] <= 1 - at_bound_distance) continue;
    if (certainty.slope.size() != n)
      throw Error(
          fmt::format("{}: certainty: \"slope\" is missing, which tells how hard {} is held "
                      "at its bound; fit again with this version",
                      file_of(folder), e.info(static_cast<std::size_t>(i)).name));
    const double data = certainty.slope[i] / certainty.overdispersion.value_or(1);
    if (held_at_bound(e.scaled[i], data + prior[i])) slope[i] = data;
  }
  return slope;
}

}  // namespace

EstimateOfFit read_estimate_of_fit(const std::filesystem::path& folder) {
  EstimateOfFit e;
  e.report = read_result(folder / "result.json");
  e.fabric = read_fabric(folder / "fabric.toml");
  check_certainty(e.report, file_of(folder));
  check_same_fabric(e.report, e.fabric, folder);
  auto result = nlohmann::json::parse(std::ifstream(folder / "result.json"));
  if (e.report.captures.empty())
    e.at_rest = std::move(result);
  else if (result.contains("problem"))
    e.problem = ResultEntry(result, file_of(folder), "").member("problem").text();
  const ReportCertainty& certainty = *e.report.certainty;
  const double over = certainty.overdispersion.value_or(1);
  for (const std::string& name : certainty.parameters)
    e.unknowns.push_back(scan_parameter(e.fabric, name));
  const auto n = static_cast<Eigen::Index>(e.unknowns.size());
  e.scaled.resize(n);
  for (std::size_t i = 0; i < e.unknowns.size(); ++i)
    e.scaled[static_cast<Eigen::Index>(i)] = std::clamp(to_scaled(e.info(i), e.value(i)), 0.0, 1.0);
  e.information = certainty.information / over;
  e.dispersion = certainty.dispersion * over;
  e.priors = WeighedPriors(
      priors_in(e.report, e.fabric), static_cast<int>(n), [&](const VecX& x) { return e.at(x); },
      1);
  e.slope = slope_at(e, folder);
  return e;
}

namespace {

/// A setting of the fit. Throws Error where it is not there or of another kind.
template <typename T>
T setting(const EstimateOfFit& e, const std::filesystem::path& folder, std::string_view name) {
  for (const auto& [key, value] : e.report.settings)
    if (key == name)
      if (const T* found = std::get_if<T>(&value)) return *found;
  throw Error(fmt::format("{}: settings: \"{}\" is missing; fit again with this version",
                          file_of(folder), name));
}
std::string text_setting(const EstimateOfFit& e, const std::filesystem::path& folder,
                         std::string_view name) {
  return setting<std::string>(e, folder, name);
}

struct CountRange {
  int least, most;
};
// Of --cells and --registered-cells; 0: the grid of the scan.
constexpr CountRange kTestCells{2, 200}, kScanCells{0, 200}, kRegisteredCells{2, 400};

int count_setting(const EstimateOfFit& e, const std::filesystem::path& folder,
                  std::string_view name, CountRange valid) {
  const auto count = setting<std::int64_t>(e, folder, name);
  if (count < valid.least || count > valid.most)
    throw Error(fmt::format("{}: settings: \"{}\": {}; valid: {} to {}", file_of(folder), name,
                            count, valid.least, valid.most));
  return static_cast<int>(count);
}

ResultEntry entry_of(const EstimateOfFit& e, const std::filesystem::path& folder) {
  return {e.at_rest, file_of(folder), ""};
}

std::vector<std::string> names_of(const EstimateOfFit& e) { return e.report.certainty->parameters; }

MechanicalFitArguments tests_of(const EstimateOfFit& e, const std::filesystem::path& folder) {
  MechanicalFitArguments arguments;
  for (const ResultEntry& test : entry_of(e, folder).member("mechanical").elements())
    arguments.captures.push_back(test.member("folder").text());
  arguments.residuals = text_setting(e, folder, "residuals");
  arguments.force_noise = setting<double>(e, folder, "force noise (N)");
  arguments.point_noise = setting<double>(e, folder, "point noise (m)");
  arguments.cord_friction = text_setting(e, folder, "friction of cords");
  arguments.options.cells = count_setting(e, folder, "cells", kTestCells);
  return arguments;
}

std::function<double(const VecX&)> simulated_tests(const EstimateOfFit& e,
                                                   const std::filesystem::path& folder,
                                                   int threads) {
  for (const auto& [name, value] : e.report.settings)
    if (name == kSymmetrySetting)
      throw Error(fmt::format("{}: of an isotropic fabric, which --true-cost does not take",
                              file_of(folder)));
  const MechanicalFitArguments arguments = tests_of(e, folder);
  const auto problem = std::make_shared<MechanicalProblem>(
      prepare_tests(arguments), e.fabric, names_of(e), cost_options(arguments), threads);
  problem->weigh_by(problem->force_weights(e.scaled));
  const auto shapes = std::make_shared<MechanicalShapes>("end");
  const double least = problem->cost(e.scaled, nullptr, shapes.get());
  check_error(e, folder, {least, kSameError, kAsTheyAre});
  return [problem, shapes, least, dispersion = e.dispersion](const VecX& x) {
    MechanicalShapes near = *shapes;  // of the estimate: the same whatever was asked before
    return (problem->cost(x, nullptr, &near) - least) / dispersion;
  };
}

ScanFitArguments scans_of(const EstimateOfFit& e, const std::filesystem::path& folder) {
  ScanFitArguments arguments;
  for (const ResultEntry& capture :
       entry_of(e, folder).member("scan").member("captures").elements())
    arguments.captures.push_back(capture.text());
  arguments.options.cells = count_setting(e, folder, "cells", kScanCells);
  arguments.options.raw.cells = count_setting(e, folder, "registered cells", kRegisteredCells);
  arguments.options.pattern = grid_pattern_from_name(text_setting(e, folder, "pattern"));
  arguments.options.descriptor = descriptor_from_name(text_setting(e, folder, "descriptor"));
  arguments.solver =
      text_setting(e, folder, "solver") == "xpbd" ? make_xpbd_solver() : make_static_solver();
  return arguments;
}

/// By how much the fit took the noise of each target to be larger.
VecX scales_of(const EstimateOfFit& e, const std::filesystem::path& folder, Eigen::Index count) {
  const ResultEntry entry = entry_of(e, folder).member("scan").member("targets");
  const std::vector<ResultEntry> targets = entry.elements();
  if (static_cast<Eigen::Index>(targets.size()) != count)
    entry.fail(fmt::format("has {} targets, but its captures {}", targets.size(), count));
  VecX scales(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const ResultEntry factor = targets[static_cast<std::size_t>(i)].member("noise_factor");
    scales[i] = factor.number();
    if (!(scales[i] > 0)) factor.fail(fmt::format("{:g}; must be above 0", scales[i]));
  }
  return scales;
}

std::function<double(const VecX&)> simulated_scans(const EstimateOfFit& e,
                                                   const std::filesystem::path& folder,
                                                   int threads) {
  const ScanFitArguments arguments = scans_of(e, folder);
  const auto problem =
      std::make_shared<ScanProblem>(prepare_scans(arguments), arguments.solver, e.fabric,
                                    names_of(e), ScanCostOptions{}, threads);
  problem->take_clamp_errors_at(e.scaled);
  check_error(e, folder, {problem->cost(e.scaled), kSameError, kAsTheyAre});
  problem->set_scales(scales_of(e, folder, problem->no_scales().size()));
  const double least = problem->cost(e.scaled);
  return [problem, least, dispersion = e.dispersion](const VecX& x) {
    return (problem->cost(x) - least) / dispersion;
  };
}

}  // namespace

std::function<double(const VecX& scaled)> simulated_at_rest(const EstimateOfFit& estimate,
                                                            const std::filesystem::path& folder,
                                                            int threads) {
  return estimate.at_rest.contains("scan") ? simulated_scans(estimate, folder, threads)
                                           : simulated_tests(estimate, folder, threads);
}

}  // namespace weft::app
