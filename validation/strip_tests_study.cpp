#include <fmt/format.h>

#include <Eigen/QR>
#include <cmath>
#include <numbers>

#include "textile_studies.h"
#include "weft/estimate/homogeneous_strip.h"
#include "weft/estimate/least_squares.h"
#include "weft/estimate/mechanical_trial.h"
#include "weft/report/plot.h"

namespace weft::validation {
namespace {

std::vector<double> list(const VecX& values) { return {values.begin(), values.end()}; }

PlotAxis axis(const char* label, const char* unit) {
  PlotAxis out;
  out.label = label;
  out.unit = unit;
  return out;
}

/// A capture of one strip between jaws at some extensions, to compute on a mesh.
MechanicalCapture strip_capture(double length, double width, double grain, const VecX& pulls) {
  const double depth = 5e-3;
  MechanicalCapture capture;
  capture.width = length + 2 * depth;
  capture.height = width;
  capture.areal_density = 0.1;
  capture.grain_angle = grain;
  capture.gravity.setZero();
  capture.frame_count = static_cast<int>(pulls.size());
  for (const double u : {0.0, length + depth}) {
    MechanicalFixture jaw;
    for (const double pull : pulls) {
      Clip clip;
      clip.region = {{u, 0}, {u + depth, width}};
      clip.position = Vec3(u + depth / 2 + (u > 0 ? pull : 0), width / 2, 0);
      jaw.frames.push_back(clip);
    }
    capture.fixtures.push_back(jaw);
  }
  return capture;
}

/// Forces on the moving jaw; NaN without equilibrium.
VecX mesh_forces(const MechanicalCapture& capture, const Fabric& fabric, int cells) {
  MechanicalOptions options;
  options.cells = cells;
  const auto trial = prepare_mechanical(capture, options);
  const auto frames = simulate_mechanical({trial}, fabric);
  VecX force(capture.frame_count);
  for (int i = 0; i < capture.frame_count; ++i) {
    const MechanicalFrame& frame = frames[0][static_cast<std::size_t>(i)];
    force[i] = frame.converged ? frame.forces(0, 1) : std::nan("");
  }
  return force;
}

// Nylon strips.

constexpr double kGauge = 0.097, kStripWidth = 2.25e-3, kStrips = 12;
constexpr int kAngles[] = {0, 30, 60, 90};
constexpr const char* kFiles[] = {"SS1-1.csv", "SS1-3.csv", "SS1-5.csv", "SS1-7.csv"};
// Published: E1, E2, G12 (MPa), nu12, thickness (mm).
constexpr double kE1 = 376.3547440306514e6, kE2 = 699.973414071645e6, kG = 44.268802135809686e6;
constexpr double kNu = -0.0035807876896111917, kThickness = 0.06746534966163997e-3;

StripTest read_strip(const std::filesystem::path& path, int degrees) {
  const MatX rows = read_rows(path);
  StripTest test;
  test.grain_angle = degrees * kDegree;
  test.force = rows.col(1) / (kStrips * kStripWidth);
  // The test counts from a preload: back to no force along the slope of the first 0.2 mm.
  const double slope = (test.force[4] - test.force[0]) / (rows(4, 0) - rows(0, 0));
  const double slack = test.force[0] / slope;
  test.stretch = 1 + (rows.col(0).array() + slack) * 1e-3 / kGauge;
  test.force_noise = 0.01 * test.force.maxCoeff();
  return test;
}

Fabric stvk_start() {
  Fabric fabric = Fabric::with_defaults("strips", "stvk");
  fabric.set("membrane_uu", 3e4);
  fabric.set("membrane_vv", 3e4);
  fabric.set("membrane_shear", 3e3);
  // Forces alone do not tell nu12 from the shear modulus; the published nu12 is zero within 0.4 %.
  fabric.set("membrane_uv", 1);
  return fabric;
}

/// The same three constants on relative elongation: a linear force.
Fabric soft_start() {
  Fabric fabric = Fabric::with_defaults("strips", "soft-constraints");
  for (const char* row : {"weft_stretch", "warp_stretch"}) fabric.set(row, 3e4);
  fabric.set("shear", 3e3);
  return fabric;
}

Fabric curve_start(const std::vector<StripTest>& tests) {
  Fabric fabric = Fabric::with_defaults("strips", "soft-constraints");
  double most = 0;
  for (const StripTest& test : tests) most = std::max(most, test.stretch.maxCoeff() - 1);
  for (const char* row : {"weft_stretch", "warp_stretch"})
    fabric.set_curve(row, {Vec3(0, most / 3, most), Vec3(3e4, 3e4, 3e4)});
  fabric.set_curve("shear", {Vec3(0, 0.5 * most, 1.5 * most), Vec3(3e3, 3e3, 3e3)});
  return fabric;
}

std::vector<std::string> free_values(const Fabric& fabric) {
  if (fabric.model == "stvk") return {"membrane_uu", "membrane_vv", "membrane_shear"};
  std::vector<std::string> names;
  for (const char* row : {"weft_stretch", "warp_stretch", "shear"})
    for (const std::string& name : value_names(fabric, row)) names.push_back(name);
  return names;
}

double slope_of(const StripTest& test, const VecX& force) {
  const VecX e = test.stretch.array() - test.stretch.mean();
  return e.dot((force.array() - force.mean()).matrix()) / e.squaredNorm();
}

double published_slope(double angle) {
  const double c = std::cos(angle) * std::cos(angle), s = 1 - c;
  return kThickness / (c * c / kE1 + s * s / kE2 + c * s * (1 / kG - 2 * kNu / kE1));
}

/// Linear lamina: 1 / slope = c^4 / E1 + s^4 / E2 + c^2 s^2 S, from the slopes of three or more
/// angles.
double lamina_slope(const std::vector<StripTest>& tests, double angle) {
  MatX rows(static_cast<Eigen::Index>(tests.size()), 3);
  VecX compliance(rows.rows());
  const auto row = [](double a) {
    const double c = std::cos(a) * std::cos(a), s = 1 - c;
    return Vec3(c * c, s * s, c * s);
  };
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const StripTest& test = tests[static_cast<std::size_t>(i)];
    const VecX e = test.stretch.array() - 1;
    compliance[i] = e.squaredNorm() / e.dot(test.force);
    rows.row(i) = row(test.grain_angle) / compliance[i];
  }
  const Vec3 found = rows.colPivHouseholderQr().solve(VecX::Ones(rows.rows()));
  return 1 / row(angle).dot(found);
}

double relative_error(const StripTest& test, const VecX& force) {
  return rms(force - test.force) / test.force.maxCoeff();
}

VecX predicted(const Fabric& fabric, const StripTest& test) {
  VecX force(test.stretch.size());
  const auto states = HomogeneousStrip(fabric, test.grain_angle).pull(test.stretch);
  for (Eigen::Index i = 0; i < force.size(); ++i)
    force[i] = states[static_cast<std::size_t>(i)].force;
  return force;
}

PlotSeries series(const std::string& name, const StripTest& test, const VecX& force, int colour,
                  PlotSeries::Mark mark) {
  PlotSeries out;
  out.name = name;
  out.x = list(100 * (test.stretch.array() - 1).matrix());
  out.y = list(force);
  out.colour = colour;
  out.mark = mark;
  return out;
}

// Bias extension.

constexpr double kSoundShear = 60 * kDegree;
constexpr double kBiasWidth = 0.115, kBiasLength = 0.230;

/// Pin-jointed threads (Cao et al. 2008): the middle shears by gamma, the zones beside it by half
/// of that, the rest not at all. Force = sum of the zones' areas times the derivative of their
/// energy density by the displacement.
struct PinJointed {
  double side = kBiasLength - kBiasWidth;
  double middle = kBiasLength * kBiasWidth - 1.5 * kBiasWidth * kBiasWidth;
  double beside = kBiasWidth * kBiasWidth;

  double angle(double displacement) const {
    const double half = std::min(1.0, (side + displacement) / (std::numbers::sqrt2 * side));
    return std::numbers::pi / 2 - 2 * std::acos(half);
  }
  /// d displacement / d gamma.
  double rate(double angle) const {
    return side / std::numbers::sqrt2 * std::sin(std::numbers::pi / 4 - angle / 2);
  }
  double force(const StiffnessCurve& curve, double displacement) const {
    const double g = angle(displacement);
    const auto torque = [&](double a) { return curve.respond(std::sin(a)).stress * std::cos(a); };
    return (middle * torque(g) + 0.5 * beside * torque(g / 2)) / rate(g);
  }
};

StiffnessCurve fit_bias(const PinJointed& kinematics, const VecX& displacement, const VecX& force,
                        int knots) {
  const double most = std::sin(kinematics.angle(displacement.maxCoeff()));
  StiffnessCurve curve(VecX::Constant(1, 0), VecX::Constant(1, 1.0));
  if (knots > 1) curve = {VecX::LinSpaced(knots, 0, most), VecX::Constant(knots, 1.0)};
  const auto residuals = [&](const VecX& logs) {
    StiffnessCurve at = curve;
    at.set_values(logs.array().exp().matrix());
    VecX r(displacement.size());
    for (Eigen::Index i = 0; i < r.size(); ++i)
      r[i] = kinematics.force(at, displacement[i]) - force[i];
    return r;
  };
  const auto linearize = [&](const VecX& x) -> QuadraticModel {
    const VecX r = residuals(x);
    MatX j(r.size(), x.size());
    for (Eigen::Index k = 0; k < x.size(); ++k) {
      VecX moved = x;
      moved[k] += 1e-5;
      const VecX above = residuals(moved);
      moved[k] -= 2e-5;
      j.col(k) = (above - residuals(moved)) / 2e-5;
    }
    return {r.squaredNorm(), 2 * j.transpose() * r, 2 * j.transpose() * j};
  };
  LeastSquaresOptions options;
  options.max_iterations = 200;
  options.initial_damping = 1e-6;
  options.step_tolerance = 1e-7;
  const VecX start = VecX::Constant(knots, std::log(10.0));
  const auto found = minimize_least_squares(
      linearize, [&](const VecX& x) { return residuals(x).squaredNorm(); }, start,
      VecX::Constant(knots, std::log(1e-3)), VecX::Constant(knots, std::log(1e6)), options);
  curve.set_values(found.x.array().exp().matrix());
  return curve;
}

VecX bias_forces(const PinJointed& kinematics, const StiffnessCurve& curve, const VecX& d) {
  VecX force(d.size());
  for (Eigen::Index i = 0; i < d.size(); ++i) force[i] = kinematics.force(curve, d[i]);
  return force;
}

}  // namespace

void study_textile_strips(const StudyFolders& folders) {
  std::vector<StripTest> tests;
  for (std::size_t i = 0; i < 4; ++i)
    tests.push_back(read_strip(folders.data / "textile_strips" / kFiles[i], kAngles[i]));

  const StripFit all = fit_strips(tests, stvk_start(), free_values(stvk_start()));
  fmt::print("stvk fitted to all four angles, against the published constants times thickness\n");
  const double published[] = {kE1 * kThickness, kE2 * kThickness, kG * kThickness};
  const char* names[] = {"membrane_uu", "membrane_vv", "membrane_shear"};
  for (std::size_t i = 0; i < 3; ++i)
    fmt::print("  {:<15} {:>9.0f} N/m, published {:>9.0f} N/m ({:+.1f} %)\n", names[i],
               all.fabric.value(names[i]), published[i],
               100 * (all.fabric.value(names[i]) / published[i] - 1));
  const StripFit curves = fit_strips(tests, curve_start(tests), free_values(curve_start(tests)));

  fmt::print(
      "force, rms of the largest: published constants, fitted to all four angles (stvk, curves), "
      "and "
      "each angle predicted from the other three\n");
  fmt::print(
      "  {:>5} {:>9} {:>10} {:>9} {:>9} | {:>9} {:>9} {:>9} {:>9}   slope: measured, published\n",
      "angle", "force N", "published", "stvk", "curves", "stvk", "soft", "curves", "lamina");
  LinePlot plot;
  plot.title = "Nylon strips: each curve predicted from the other three angles";
  plot.x = axis("elongation", "%");
  plot.y = axis("force per width", "N/m");
  plot.height = 460;
  for (std::size_t i = 0; i < 4; ++i) {
    std::vector<StripTest> others;
    for (std::size_t k = 0; k < 4; ++k)
      if (k != i) others.push_back(tests[k]);
    const StripTest& test = tests[i];
    const VecX linear = (test.stretch.array() - 1) * published_slope(test.grain_angle);
    const VecX stvk_out =
        predicted(fit_strips(others, stvk_start(), free_values(stvk_start())).fabric, test);
    const VecX soft_out =
        predicted(fit_strips(others, soft_start(), free_values(soft_start())).fabric, test);
    const VecX curves_out = predicted(
        fit_strips(others, curve_start(tests), free_values(curve_start(tests))).fabric, test);
    const VecX lamina_out = (test.stretch.array() - 1) * lamina_slope(others, test.grain_angle);
    fmt::print("  {:>5} {:>9.2f}", kAngles[i], test.force.maxCoeff() * kStrips * kStripWidth);
    for (const VecX& force :
         {linear, all.force[i], curves.force[i], stvk_out, soft_out, curves_out, lamina_out})
      fmt::print(" {:>8.2f} %", 100 * relative_error(test, force));
    fmt::print("   {:.0f}, {:.0f} N/m\n", slope_of(test, test.force),
               published_slope(test.grain_angle));
    const int colour = static_cast<int>(i) + 1;
    plot.series.push_back(series(fmt::format("{} degrees, measured", kAngles[i]), test, test.force,
                                 colour, PlotSeries::Mark::points));
    plot.series.push_back(series("", test, stvk_out, colour, PlotSeries::Mark::line));
    plot.series.back().dashed = true;
    plot.series.push_back(series("", test, lamina_out, colour, PlotSeries::Mark::line));
  }
  write_plot(folders.out / "textile_strips.svg", plot);

  fmt::print("the homogeneous strip against a mesh of one strip between jaws, stvk, 3 %\n");
  for (const int angle : {0, 30, 60}) {
    const VecX pull = VecX::Constant(1, 0.03 * kGauge);
    StripTest test;
    test.grain_angle = angle * kDegree;
    test.stretch = VecX::Constant(1, 1.03);
    const double fast = predicted(all.fabric, test)[0] * kStripWidth;
    for (const int cells : {3, 6}) {
      const double slow = mesh_forces(strip_capture(kGauge, kStripWidth, test.grain_angle, pull),
                                      all.fabric, cells)[0];
      fmt::print("  {:>2} degrees, {} cells across: {:+.2f} %\n", angle, cells,
                 100 * (fast / slow - 1));
    }
  }
}

void study_bias_extension(const StudyFolders& folders) {
  const MatX rows = read_rows(folders.data / "bias_extension" / "glass_plain_115_230.csv");
  const VecX d = 1e-3 * rows.col(0), force = rows.col(1);
  const PinJointed kinematics;
  const Eigen::Index half = (d.array() <= 0.5 * d.maxCoeff()).count();
  const VecX first_d = d.head(half), first = force.head(half);
  fmt::print(
      "{} points to {:.1f} mm and {:.1f} N; the first half ends at {:.1f} mm ({:.0f} degrees "
      "of shear by pin-jointed threads), {:.2f} N; the whole at {:.0f} degrees\n",
      d.size(), 1e3 * d.maxCoeff(), force.maxCoeff(), 1e3 * first_d.maxCoeff(),
      kinematics.angle(first_d.maxCoeff()) / kDegree, first.maxCoeff(),
      kinematics.angle(d.maxCoeff()) / kDegree);
  LinePlot plot;
  plot.title = "Bias extension of a glass fabric";
  plot.x = axis("displacement", "mm");
  plot.y = axis("force", "N");
  PlotSeries measured;
  measured.name = "measured";
  measured.mark = PlotSeries::Mark::points;
  measured.colour = 0;
  measured.x = list(1e3 * d);
  measured.y = list(force);
  plot.series.push_back(measured);
  for (const int knots : {1, 2, 3, 4, 5}) {
    const StiffnessCurve whole = fit_bias(kinematics, d, force, knots);
    const StiffnessCurve part = fit_bias(kinematics, first_d, first, knots);
    const VecX from_all = bias_forces(kinematics, whole, d);
    const VecX from_half = bias_forces(kinematics, part, d);
    const Eigen::Index rest = d.size() - half;
    // Beyond, the threads are nearly parallel and the kinematics has no say.
    Eigen::Index sound = half;
    while (sound < d.size() && kinematics.angle(d[sound]) < kSoundShear) ++sound;
    fmt::print(
        "  {} control points: fitted to all {:.2f} %; fitted to the first half {:.2f} %, second "
        "half "
        "from it {:.1f} %, up to {:.0f} degrees of shear {:.1f} %\n",
        knots, 100 * rms(from_all - force) / force.maxCoeff(),
        100 * rms((from_half - force).head(half)) / first.maxCoeff(),
        100 * rms((from_half - force).tail(rest)) / force.maxCoeff(), kSoundShear / kDegree,
        100 * rms((from_half - force).segment(half, sound - half)) / force[sound - 1]);
    if (knots != 3 && knots != 5) continue;
    PlotSeries line;
    line.x = list(1e3 * d);
    line.name = fmt::format("{} control points, fitted to all", knots);
    line.y = list(from_all);
    plot.series.push_back(line);
    line.name = fmt::format("{} control points, fitted to the first half", knots);
    line.y = list(from_half);
    line.dashed = true;
    plot.series.push_back(line);
  }
  PlotRegion held_back;
  held_back.lower = 1e3 * first_d.maxCoeff();
  held_back.upper = 1e3 * d.maxCoeff();
  held_back.label = "second half";
  plot.regions.push_back(held_back);
  write_plot(folders.out / "bias_extension.svg", plot);

  const StiffnessCurve curve = fit_bias(kinematics, first_d, first, 2);
  fmt::print(
      "a sheet on a mesh with the shear curve of the first half (2 control points), against "
      "pin-jointed threads\n");
  VecX pulls(2);
  pulls << 0.01, 0.02;
  for (const double threads : {500.0, 5000.0}) {
    Fabric fabric = Fabric::with_defaults("bias", "soft-constraints");
    fabric.set("weft_stretch", threads);
    fabric.set("warp_stretch", threads);
    fabric.set_curve("shear", curve);
    for (const int cells : {8, 16}) {
      const VecX found =
          mesh_forces(strip_capture(kBiasLength, kBiasWidth, 45 * kDegree, pulls), fabric, cells);
      fmt::print("  threads of {:.0f} N/m, {} cells across:", threads, cells);
      for (Eigen::Index i = 0; i < pulls.size(); ++i)
        fmt::print("  at {:.0f} mm {:.2f} of {:.2f} N", 1e3 * pulls[i], found[i],
                   kinematics.force(curve, pulls[i]));
      fmt::print("\n");
    }
  }
}

}  // namespace weft::validation
