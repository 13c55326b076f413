#include "fit_curves.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "mechanical.h"
#include "weft/base/error.h"
#include "weft/report/text.h"

namespace weft::app {
namespace {

constexpr int kCurvePoints = 21;

nlohmann::json numbers(const VecX& values) {
  nlohmann::json list = nlohmann::json::array();
  for (const double value : values) list.push_back(json_number(value));
  return list;
}

bool is_searched(const CurveFitResult& fit, const std::string& value) {
  return std::find(fit.free.begin(), fit.free.end(), value) != fit.free.end();
}

/// A stage's name in words, without the control points, which have a number of their own.
std::string stage_title(const CurveFitStage& stage) {
  std::string title = stage.name;
  const std::string points = fmt::format(", {} points", stage.points);
  if (const auto at = title.find(points); at != std::string::npos) title.erase(at, points.size());
  return in_words(title);
}

}  // namespace

const std::vector<std::string>& CurveFitArguments::names() {
  static const std::vector<std::string> names{"--order",  "--subdivide", "--smooth",
                                              "--points", "--linear",    "--isotropic"};
  return names;
}

void CurveFitArguments::add_to(CLI::App& command) {
  command
      .add_option(
          "--order", order_,
          "mechanical captures: joint: all parameters to all captures at once; incremental: "
          "rough bends, then stretch, shear, bend, diagonal bend, each from the captures that "
          "isolate it, and "
          "once more")
      ->check(CLI::IsMember({"joint", "incremental"}))
      ->capture_default_str();
  command.add_flag(
      "--subdivide", subdivide_,
      "mechanical captures: stiffness curves, from one control point each to as many "
      "as lower the error by 1 % and by more than noise does (Schwarz's criterion), on "
      "halved cells as well");
  command.add_flag(
      "--smooth", smooth_,
      "mechanical captures: as --subdivide, but curves of stretch and shear, where they pay, with "
      "--points control points and as rough as is most probable, clips where they most probably "
      "are, shear from all components of its forces, and stretch and shear together in the end");
  command
      .add_option(
          "--points", points_,
          "mechanical captures: most control points of a curve with --subdivide or --smooth")
      ->check(integer_in(1, StiffnessCurve::kMostKnots))
      ->capture_default_str();
  command.add_flag("--linear", linear_,
                   "mechanical captures: one control point each, whatever --initial has");
  command.add_flag("--isotropic", isotropic_,
                   "mechanical captures: the warp has the stretch and bend of the weft");
}

bool CurveFitArguments::given(const CLI::App& command) {
  for (const std::string& name : names())
    if (command.count(name) > 0) return true;
  return false;
}

CurveFitOptions CurveFitArguments::options() const {
  if (subdivide_ + smooth_ + linear_ > 1)
    throw Error("--subdivide, --smooth and --linear exclude each other");
  CurveFitOptions options;
  options.order = fit_order_from_name(order_);
  if (subdivide_) options.shape = CurveShape::subdivided;
  if (smooth_) options.shape = CurveShape::smooth;
  if (linear_) options.shape = CurveShape::linear;
  if (isotropic_) options.symmetry = ThreadSymmetry::isotropic;
  options.most_points = points_;
  return options;
}

void add_curves(const CurveFitResult& fit, nlohmann::json& result) {
  const Fabric& fabric = fit.fit.fabric;
  nlohmann::json curves = nlohmann::json::object();
  for (const ParameterInfo& info : model_parameters(fabric.model)) {
    if (info.curve_over.empty() || fabric.value_count(info.name) < 2) continue;
    const int first = fabric.first_value(info.name);
    if (!is_searched(fit, std::string(fabric.info(first).name))) continue;
    const StiffnessCurve curve = fabric.curve(info.name);
    const VecX strains =
        VecX::LinSpaced(kCurvePoints, curve.knots()[0], curve.knots()[curve.size() - 1]);
    const CurveBand band = curve_band(fit.fit, info.name, strains);
    curves[std::string(info.name)] = {{"unit", info.unit},
                                      {"strain_unit", info.curve_over},
                                      {"knots", numbers(curve.knots())},
                                      {"values", numbers(curve.values())},
                                      {"strain", numbers(strains)},
                                      {"stiffness", numbers(band.stiffness)},
                                      {"lower", numbers(band.lower)},
                                      {"upper", numbers(band.upper)}};
    const auto roughness = fit.fit.roughness.find(info.name);
    if (roughness != fit.fit.roughness.end())
      curves[std::string(info.name)]["roughness"] = roughness->second;
  }
  result["curves"] = curves;
  nlohmann::json list = nlohmann::json::array();
  for (const CurveFitStage& stage : fit.stages) {
    list.push_back({{"name", stage.name},
                    {"captures", stage.captures},
                    {"pass", stage.pass},
                    {"points", stage.points},
                    {"kept", stage.kept},
                    {"error_initial", json_number(stage.cost_start)},
                    {"error", json_number(stage.cost)},
                    {"error_on_halved_cells", json_number(stage.finer_cost)},
                    {"evaluations", stage.evaluations},
                    {"wall_s", stage.wall_s}});
  }
  result["stages"] = list;
}

std::vector<ReportStage> report_stages(const CurveFitResult& fit) {
  std::vector<ReportStage> stages;
  for (const CurveFitStage& stage : fit.stages) {
    ReportStage& out = stages.emplace_back();
    out.name = stage_title(stage);
    out.pass = stage.pass;
    out.points = stage.points;
    out.error_initial = stage.cost_start;
    out.error = stage.cost;
    out.error_on_halved_cells = stage.finer_cost;
    out.evaluations = stage.evaluations;
    out.kept = stage.kept;
    out.captures = stage.captures;
  }
  return stages;
}

std::string stage_lines(const CurveFitResult& fit) {
  std::string text;
  for (const CurveFitStage& stage : fit.stages)
    text += fmt::format("{:<28} error {:>10.5g}, at its start {:>10.5g}{}; {} evaluations{}\n",
                        stage.name, stage.cost, stage.cost_start,
                        std::isfinite(stage.finer_cost)
                            ? fmt::format(", on halved cells {:.5g}", stage.finer_cost)
                            : "",
                        stage.evaluations, stage.kept ? "" : "; not kept");
  if (!fit.without_test.empty())
    text += fmt::format("not searched, no capture isolates them: {}\n",
                        fmt::join(fit.without_test, ", "));
  return text;
}

}  // namespace weft::app
