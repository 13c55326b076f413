#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimate/closed_forms.h"
#include "study.h"
#include "textile_studies.h"
#include "weft/base/error.h"
#include "weft/estimate/homogeneous_strip.h"
#include "weft/fabric/arcsim_material.h"
#include "weft/report/plot.h"

namespace weft::validation {
namespace {

constexpr int kAngles[] = {0, 45, 90};
constexpr double kMostStretch = 1 + 1.0 / 6;  // where the table ends
constexpr int kStretches = 20, kShown = 12;   // the latter at 1.1
constexpr std::string_view kDrawn[] = {"11oz-black-denim", "navy-sparkle-sweat"};

/// The stiffness matrix in the axes of a strip that is pulled at a multiple of 45 degrees to the
/// weft, along and across the pull: N_along = a E_along + b E_across, N_across = b E_along + c
/// E_across.
struct StripStiffness {
  double a, b, c;
};

/// From the table alone, linear between the row at rest and that of the angle in the principal
/// stretch; entries below zero count as zero (piecewise_linear_law.h).
StripStiffness table_stiffness(const VecX& table, int degrees, double stretch) {
  const double share = std::clamp(6 * (stretch - 1), 0.0, 1.0);
  const int row = 4 * (1 + 2 * degrees / 45);
  const Eigen::Vector4d k =
      (1 - share) * table.segment<4>(0).cwiseMax(0) + share * table.segment<4>(row).cwiseMax(0);
  if (degrees == 0) return {k[0], k[1], k[2]};
  if (degrees == 90) return {k[2], k[1], k[0]};
  const double sum = (k[0] + 2 * k[1] + k[2]) / 4, shear = k[3] / 2;
  return {sum + shear, sum - shear, sum + shear};
}

double green(double stretch) { return 0.5 * (stretch * stretch - 1); }

/// Force per width of a strip that cannot contract.
double held_force(const VecX& table, int degrees, double stretch) {
  return stretch * table_stiffness(table, degrees, stretch).a * green(stretch);
}

/// The same without stress across: E_across = - b / c E_along. NaN where the table's matrix has no
/// such state: it would pull the strip to no width, or push it.
struct Contracted {
  double force, ratio;  ///< - E_across / E_along
};
Contracted contracted(const VecX& table, int degrees, double stretch) {
  const auto [a, b, c] = table_stiffness(table, degrees, stretch);
  const double ratio = c > 0 ? b / c : 0, force = stretch * (a - b * ratio) * green(stretch);
  const bool possible = c > 0 && force >= 0 && 1 - 2 * ratio * green(stretch) > 0;
  return {possible ? force : std::nan(""), ratio};
}

VecX model_forces(const Fabric& fabric, int degrees, StripSides sides, const VecX& stretches) {
  VecX forces = VecX::Constant(stretches.size(), std::nan(""));
  HomogeneousStrip strip(fabric, degrees * std::numbers::pi / 180, sides);
  for (Eigen::Index i = 0; i < stretches.size(); ++i) {
    try {  // one by one: where there is no equilibrium the others count
      forces[i] = strip.pull(stretches.head(i + 1)).back().force;
    } catch (const Error&) {
    }
  }
  return forces;
}

double largest(const VecX& values) {
  double most = 0;
  for (const double value : values)
    if (std::abs(value) > most) most = std::abs(value);
  return most;
}

void add_to_plot(LinePlot& plot, const std::string& name, int degrees, const VecX& stretches,
                 const VecX& table, const VecX& model) {
  PlotSeries line;
  line.x = {stretches.begin(), stretches.end()};
  line.y = {table.begin(), table.end()};
  line.colour = 1 + static_cast<int>(plot.series.size()) / 6;
  PlotSeries points = line;
  if (degrees == 0) line.name = name;
  points.mark = PlotSeries::Mark::points;
  points.y = {model.begin(), model.end()};
  plot.notes.push_back({line.x.back(), line.y.back(), fmt::format("{}°", degrees)});
  plot.series.push_back(std::move(line));
  plot.series.push_back(std::move(points));
}

/// Strips of one fabric: prints a line an angle, with the largest difference (a share of the
/// largest force) of a held strip kept in `held` and returned for one that contracts.
double study_fabric(const Fabric& fabric, Csv& csv, double& held_difference, LinePlot* plot) {
  const VecX stretches =
      VecX::LinSpaced(kStretches, 1 + (kMostStretch - 1) / kStretches, kMostStretch);
  double worst = 0;
  for (const int degrees : kAngles) {
    const double angle = degrees * std::numbers::pi / 180;
    const VecX held = model_forces(fabric, degrees, StripSides::held, stretches),
               unsheared = model_forces(fabric, degrees, StripSides::unsheared, stretches),
               free = model_forces(fabric, degrees, StripSides::free, stretches);
    VecX held_form(kStretches), form(kStretches);
    double contraction = 0;
    for (Eigen::Index i = 0; i < kStretches; ++i) {
      held_form[i] = held_force(fabric.values, degrees, stretches[i]);
      const Contracted at = contracted(fabric.values, degrees, stretches[i]);
      form[i] = at.force;
      contraction = std::max(contraction, at.ratio);
      csv.row("{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}", fabric.name, degrees, stretches[i],
              held_form[i], held[i], form[i], unsheared[i], free[i]);
    }
    held_difference = std::max(held_difference, largest(held - held_form) / largest(held_form));
    const VecX difference = (unsheared - form) / largest(form);
    worst = std::max(worst, difference.hasNaN() ? HUGE_VAL : largest(difference));
    const Eigen::Index at = kShown - 1;
    fmt::print(
        "  {:<19} {:>2} {:>10.2f} {:>10.2f} {:>10.2f} {:>6.2f} {:>6.2f} {:>6.2f} {:>10.2f} "
        "{:>10.2f}\n",
        fabric.name, degrees, form[kStretches / 3 - 1], form[at], form[kStretches - 1], contraction,
        100 * rms(difference), 100 * largest(difference), free[at],
        test::strip_on_mesh(fabric, stretches[at], 20, angle));
    std::fflush(stdout);
    if (plot) add_to_plot(*plot, fabric.name, degrees, stretches, form, unsheared);
  }
  return worst;
}

}  // namespace

void study_wang2011(const StudyFolders& folders) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry :
       std::filesystem::directory_iterator(folders.data / "wang2011" / "materials"))
    if (entry.path().extension() == ".json") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  fmt::print(
      "strips by the table alone and by the model; forces per width, N/m. Columns: angle to the "
      "weft, degrees;\n  table without stress across, at stretches of 1.05, 1.1 and 7/6; its "
      "contraction, of the Green strain, at most;\n  model less table up to 7/6, rms and largest, "
      "% of the largest force; model that may shear, at 1.1, strained\n  alike everywhere, and on "
      "a mesh of 100 x 20 mm between clips\n");
  Csv csv(folders.out / "wang2011_strips.csv",
          "fabric,degrees,stretch,table_held_N_per_m,model_held_N_per_m,table_N_per_m,"
          "model_N_per_m,model_free_to_shear_N_per_m");
  LinePlot plot;
  plot.title = "Strips of measured tables: table (lines) and model (points)";
  plot.x.label = "stretch";
  plot.y.label = "force per width";
  plot.y.unit = std::string("N/m");
  plot.y.logarithmic = true;
  plot.height = 460;
  double held = 0;
  std::vector<double> worst;
  for (const auto& file : files) {
    const Fabric fabric = read_arcsim_material(file);
    const bool drawn =
        std::find(std::begin(kDrawn), std::end(kDrawn), fabric.name) != std::end(kDrawn);
    worst.push_back(study_fabric(fabric, csv, held, drawn ? &plot : nullptr));
  }
  write_plot(folders.out / "wang2011.svg", plot);
  const auto within = [&](double limit) {
    return std::count_if(worst.begin(), worst.end(), [&](double w) { return w <= limit; });
  };
  fmt::print(
      "held sides: at most {:.1e} of the largest force off. Without stress across: within "
      "0.1 % on {}, 0.3 % on {}, 1.5 % on {} of {} fabrics, {:.1f} % at most\n",
      held, within(1e-3), within(3e-3), within(1.5e-2), worst.size(),
      100 * *std::max_element(worst.begin(), worst.end()));
}

}  // namespace weft::validation
