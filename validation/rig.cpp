/// Fits to captures of the computed rig, whose fabrics are known: how well the curves of the
/// generating model come back from starts wrong by a factor of 10, how the fit predicts the tests
/// that it did not see, the two orders of fitting beside each other, what other models and simpler
/// variants leave as residual, the least error that the noise allows any fit (with --smooth what is
/// to be expected of smooth curves), and stretch tests whose bars are moved beside such whose bar
/// is pulled with known forces.
///
///     weft_validate_rig OUT [recovery] [orders] [table] [bound] [known_forces] [--fabric NAME]
///                       [--model NAME] [--cells N] [--truth-cells N] [--steps N] [--starts N]
///                       [--threads N] [--seed N]
///                       [--uniform] [--smooth] [--no-noise] [--noise P,C,F,R] [--skip ROW]
///                       [--only ROW] [--cord-friction auto|fit|none] [--no-mesh-error]
///                       [--residuals auto|forces|points|both|stretch-points]
///
/// --noise has the deviations of points and clips (m) and of forces, and the cords' friction (N).
/// Captures are made in OUT where they are not there yet, of the fabrics validation/fabrics/rig_*.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <string>
#include <vector>

#include "program.h"
#include "thread_models.h"
#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/estimate/component_strains.h"
#include "weft/estimate/curve_fit.h"
#include "weft/estimate/mechanical_rig.h"

namespace weft::validation {
namespace {

constexpr double kOutliers = 0.02;

struct Arguments {
  std::filesystem::path out;
  std::vector<std::string> parts;
  std::vector<std::string> fabrics{"knit", "satin", "denim", "blend"};
  std::vector<std::string> models{"stvk-diagonal", "soft-constraints", "springs"};
  MechanicalOptions options;
  RigOptions rig;
  int starts = 1;
  CurveShape shape = CurveShape::subdivided;  ///< of nonlinear fits
  int threads = 0;
  MeshError mesh_error = MeshError::included;
  CordFriction cord_friction = CordFriction::as_captured;
  MechanicalResiduals residuals = MechanicalResiduals::automatic;
  std::string skip;  ///< a component that is not searched and starts at the truth
  std::string only;  ///< the one component that is searched; all others have the truth
  bool has(const std::string& part) const {
    return std::find(parts.begin(), parts.end(), part) != parts.end();
  }
};

struct Start {
  const char* name;
  double membrane, bend;
};
constexpr Start kStarts[] = {
    {"all x 10", 10, 10}, {"all / 10", 0.1, 0.1}, {"membrane x 10, bends / 10", 10, 0.1}};

struct Variant {
  const char* name;
  CurveShape shape;
  ThreadSymmetry symmetry;
};
constexpr Variant kVariants[] = {
    {"nonlinear orthotropic", CurveShape::subdivided, ThreadSymmetry::orthotropic},
    {"linear", CurveShape::linear, ThreadSymmetry::orthotropic},
    {"isotropic", CurveShape::subdivided, ThreadSymmetry::isotropic},
    {"linear and isotropic", CurveShape::linear, ThreadSymmetry::isotropic}};

using Trials = std::vector<std::shared_ptr<const MechanicalTrial>>;

Fabric true_fabric(const std::string& name) {
  return read_fabric(fmt::format("validation/fabrics/rig_{}.toml", name));
}

std::shared_ptr<const MechanicalTrial> trial_of(const Arguments& arguments,
                                                const std::string& fabric, RigTest test) {
  const std::filesystem::path folder = arguments.out / fabric / std::string(name_of(test));
  if (!std::filesystem::exists(folder / "capture.toml"))
    make_rig_capture(folder, test, true_fabric(fabric), arguments.rig);
  return prepare_mechanical(read_mechanical_capture(folder), arguments.options);
}

bool is_bend(RigTest test) { return test == RigTest::weft_bend || test == RigTest::warp_bend; }

Trials fit_trials(const Arguments& arguments, const std::string& fabric, const std::string& model) {
  Trials trials;
  for (const RigTest test : rig_fit_tests())
    if (!in_plane_only(model) || !is_bend(test))
      trials.push_back(trial_of(arguments, fabric, test));
  return trials;
}

double middle(const StiffnessCurve& curve) {
  return curve.stiffness(0.5 * (curve.knots()[0] + curve.knots()[curve.size() - 1]));
}

/// One number a component: the truth's at the middle of its knots, times the start's factor.
Fabric wrong_fabric(const Fabric& truth, const std::string& model, const Start& start) {
  Fabric fabric = thread_fabric(truth.name, model, [&](const ThreadParameter& p) {
    return middle(truth.curve(p.name)) * (p.bends() ? start.bend : start.membrane);
  });
  fabric.areal_density = truth.areal_density;
  return fabric;
}

/// The strains of the isolating test, at the truth.
ComponentSample occurring(const Trials& trials,
                          const std::vector<std::vector<MechanicalFrame>>& frames,
                          const Fabric& truth, std::size_t row) {
  const std::string name(kThreadParameters[row].name);
  if (row < 5) return component_strains(*trials[row], frames[row], truth, name);
  ComponentSample sample = component_strains(*trials[3], frames[3], truth, name);
  append(component_strains(*trials[4], frames[4], truth, name), sample);
  return sample;
}

/// Of the first `rows` components.
void compare_curves(const Arguments& arguments, const Trials& trials, const Fabric& truth,
                    const CurveFitResult& found, std::size_t rows = std::size(kThreadParameters)) {
  const auto frames =
      simulate_mechanical(trials, truth, MechanicalDerivatives::none, arguments.threads);
  fmt::print("  {:<14} {:>6} {:>22} {:>26} {:>8} {:>8} {:>8}  {}\n", "component", "points",
             "strains", "stiffness at the ends", "rms (%)", "max (%)", "stress", "band");
  for (std::size_t i = 0; i < rows; ++i) {
    const std::string row(kThreadParameters[i].name);
    const ComponentSample sample = occurring(trials, frames, truth, i);
    const StrainRange range = strain_range(sample, kOutliers);
    const StiffnessCurve expected = truth.curve(row), curve = found.fit.fabric.curve(row);
    double squares = 0, area = 0, most = 0, stress = 0, largest_stress = 0;
    for (std::size_t k = 0; k < sample.strains.size(); ++k) {
      const double c = sample.strains[k];
      if (c < range.lower || c > range.upper) continue;
      const double error = curve.stiffness(c) / expected.stiffness(c) - 1;
      squares += sample.areas[k] * error * error;
      area += sample.areas[k];
      most = std::max(most, std::abs(error));
      stress = std::max(stress, std::abs(error * expected.stiffness(c) * c));
      largest_stress = std::max(largest_stress, std::abs(expected.stiffness(c) * c));
    }
    const CurveBand band =
        curve_band(found.fit, row, VecX::LinSpaced(41, range.lower, range.upper));
    int held = 0;
    for (Eigen::Index k = 0; k < band.strains.size(); ++k) {
      const double k_true = expected.stiffness(band.strains[k]);
      if (band.lower[k] <= k_true && k_true <= band.upper[k]) ++held;
    }
    const Eigen::Index last = band.strains.size() - 1, half = last / 2;
    fmt::print(
        "  {:<14} {:>6} {:>10.4g} to {:>8.4g} {:>12.5g} to {:>10.5g} {:>8.2f} {:>8.2f} "
        "{:>8.2f}  holds {:.0f} %, {:+.1f} % in the middle\n",
        row, curve.size(), range.lower, range.upper, curve.stiffness(range.lower),
        curve.stiffness(range.upper), 100 * std::sqrt(squares / area), 100 * most,
        100 * stress / largest_stress, 100.0 * held / static_cast<double>(last + 1),
        100 * (band.upper[half] / band.stiffness[half] - 1));
  }
}

void print_tests(const Arguments& arguments, const std::string& fabric, const Fabric& found) {
  for (const RigTest test : rig_tests()) {
    if (in_plane_only(found.model) && is_bend(test)) continue;
    const auto trial = trial_of(arguments, fabric, test);
    const auto frames =
        simulate_mechanical({trial}, found, MechanicalDerivatives::none, arguments.threads);
    const MechanicalEvaluation e = compare_mechanical(*trial, frames[0]);
    fmt::print("  {:<14}", name_of(test));
    if (e.pose.count > 0)
      fmt::print(" poses rms {:.4f} mm, {:.3f} mrad;", 1e3 * e.pose.position_rms,
                 1e3 * e.pose.rotation_rms);
    if (e.force_count > 0)
      fmt::print(" force rms {:>8.4f} N, {:>6.2f} % of {:.3f} N;", e.force_rms,
                 100 * e.force_relative, e.largest_force);
    fmt::print(" points rms {:.3f} mm, at most {:.3f} mm", 1e3 * e.distance.rms,
               1e3 * e.distance.max);
    if (e.not_converged > 0) fmt::print("; {} frames without equilibrium", e.not_converged);
    fmt::print("\n");
  }
  std::fflush(stdout);
}

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::vector<std::string> rows_of(const Arguments& arguments, const Fabric& start) {
  if (!arguments.only.empty()) return {arguments.only};
  std::vector<std::string> rows = searched_parameters(start.model);
  std::erase(rows, arguments.skip);
  return rows;
}

CurveFitResult timed_fit(const Arguments& arguments, const Trials& trials, const Fabric& start,
                         const CurveFitOptions& options, const std::string& title,
                         std::vector<std::string> rows = {}) {
  const double before = cpu_seconds();
  CurveFitOptions chosen = options;
  chosen.threads = arguments.threads;
  chosen.fit.mesh_error = arguments.mesh_error;
  chosen.cost.cord_friction = arguments.cord_friction;
  chosen.cost.residuals = arguments.residuals;
  std::string last;
  if (rows.empty()) rows = rows_of(arguments, start);
  CurveFitResult found = fit_curves(
      trials, start, rows, chosen, [&](const std::string& stage, const MechanicalFitStep& step) {
        if (stage != last)
          std::fprintf(stderr, "%s: %s, %.3g\n", title.c_str(), stage.c_str(), step.cost);
        last = stage;
        return true;
      });
  fmt::print("\n{}: error {:.5g} (start {:.4g}), {} evaluations, {:.0f} s, {:.0f} s of CPU\n",
             title, found.fit.cost, found.fit.cost_start, found.fit.evaluations, found.fit.wall_s,
             cpu_seconds() - before);
  std::fflush(stdout);
  return found;
}

void print_friction(const Arguments& arguments, const Trials& trials, const CurveFitResult& found) {
  for (const CordFrictionEstimate& friction : found.fit.cord_friction)
    fmt::print("  cords of {}: {:.5f} N, {:.5f} to {:.5f} N (made with {:.5f} N)\n",
               trials[friction.trial]->capture.name, friction.interval.value,
               friction.interval.lower, friction.interval.upper,
               0.5 * arguments.rig.noise.cord_friction);
}

void print_stages(const CurveFitResult& found) {
  for (const CurveFitStage& stage : found.stages)
    fmt::print(
        "    pass {} {:<26} {:>12.5g} -> {:>10.5g} (halved cells {:>10.5g})  {:>3} evaluations "
        "{:>6.1f} s{}\n",
        stage.pass, stage.name, stage.cost_start, stage.cost, stage.finer_cost, stage.evaluations,
        stage.wall_s, stage.kept ? "" : "  not kept");
}

void recovery(const Arguments& arguments, const std::string& name, FitOrder order) {
  const Fabric truth = true_fabric(name);
  const Trials trials = fit_trials(arguments, name, truth.model);
  for (int i = 0; i < std::min<int>(arguments.starts, std::size(kStarts)); ++i) {
    const Start& start = kStarts[i];
    CurveFitOptions options;
    options.order = order;
    options.shape = arguments.shape;
    Fabric wrong = wrong_fabric(truth, truth.model, start);
    for (const ThreadParameter& p : kThreadParameters)
      if (arguments.only.empty() ? p.name == arguments.skip : p.name != arguments.only)
        wrong.set_curve(p.name, truth.curve(p.name));
    const CurveFitResult found = timed_fit(
        arguments, trials, wrong, options,
        fmt::format("{}: {} fit of {} from {}", name,
                    order == FitOrder::joint ? "joint" : "incremental", truth.model, start.name));
    print_stages(found);
    print_friction(arguments, trials, found);
    compare_curves(arguments, trials, truth, found);
    if (arguments.only.empty()) print_tests(arguments, name, found.fit.fabric);
  }
}

const std::vector<std::string> kStretches{"weft_stretch", "warp_stretch"};

Trials stretch_trials(Arguments arguments, const std::string& name, StretchDrive drive) {
  arguments.rig.stretch_drive = drive;
  arguments.out /= drive == StretchDrive::known_forces ? "known_forces" : "known_ways";
  Trials trials;
  for (const RigTest test : {RigTest::weft_stretch, RigTest::warp_stretch})
    trials.push_back(trial_of(arguments, name, test));
  return trials;
}

/// The stretch tests alone, of moved bars whose forces are measured and of a pulled one whose pose
/// is; all but the two curves of stretch known, which are compared over the strains of the second.
void known_forces(const Arguments& arguments, const std::string& name) {
  const Fabric truth = true_fabric(name);
  Fabric start = truth;
  const Fabric wrong = wrong_fabric(truth, truth.model, kStarts[0]);
  for (const std::string& row : kStretches) start.set_curve(row, wrong.curve(row));
  CurveFitOptions options;
  options.order = FitOrder::incremental;
  options.shape = arguments.shape;
  const Trials moved = stretch_trials(arguments, name, StretchDrive::known_ways),
               pulled = stretch_trials(arguments, name, StretchDrive::known_forces);
  for (const Trials* trials : {&moved, &pulled}) {
    const std::string title =
        fmt::format("{}: stretch from {}, {}", name, kStarts[0].name,
                    trials == &pulled ? "a bar pulled with known forces" : "moved bars");
    const CurveFitResult found = timed_fit(arguments, *trials, start, options, title, kStretches);
    print_friction(arguments, *trials, found);
    compare_curves(arguments, pulled, truth, found, kStretches.size());
  }
}

void add_value_names(const Fabric& fabric, std::string_view row, std::vector<std::string>& names) {
  const int first = fabric.first_value(row);
  for (int i = 0; i < fabric.value_count(row); ++i) names.emplace_back(fabric.info(first + i).name);
}

/// The values of the curves that a bend over a straight edge determines, in the order of their
/// rows.
std::vector<std::string> control_values(const Fabric& truth) {
  std::vector<std::string> names;
  for (const ThreadParameter& p : kThreadParameters) {
    if (p.name == "diagonal_bend") continue;
    add_value_names(truth, p.name, names);
  }
  return names;
}

/// Of log k at each strain, by the scaled values of the row's curve.
MatX log_slopes(const Fabric& truth, std::string_view row, const std::vector<double>& strains) {
  const StiffnessCurve curve = truth.curve(row);
  const int first = truth.first_value(row), count = curve.size();
  MatX slopes(static_cast<Eigen::Index>(strains.size()), count);
  VecX by_value(count);
  for (std::size_t k = 0; k < strains.size(); ++k) {
    curve.stiffness_by_values(strains[k], by_value);
    for (int j = 0; j < count; ++j) {
      const ParameterInfo info = truth.info(first + j);
      slopes(static_cast<Eigen::Index>(k), j) = by_value[j] * curve.values()[j] /
                                                curve.stiffness(strains[k]) *
                                                std::log(info.upper / info.lower);
    }
  }
  return slopes;
}

/// Relative errors of a curve over the strains that occur, root mean squares by area.
struct CurveErrors {
  double bias = 0, deviation = 0;
  double worst = 0;  ///< largest deviation
};
/// To first order, of scaled control values that are off by `shift` and scatter with `covariance`.
CurveErrors curve_errors(const Fabric& fabric, std::string_view row, const ComponentSample& sample,
                         const VecX& shift, const MatX& covariance) {
  const StrainRange range = strain_range(sample, kOutliers);
  const MatX slopes = log_slopes(fabric, row, sample.strains);
  double biases = 0, variances = 0, area = 0, most = 0;
  for (std::size_t k = 0; k < sample.strains.size(); ++k) {
    if (sample.strains[k] < range.lower || sample.strains[k] > range.upper) continue;
    const auto slope = slopes.row(static_cast<Eigen::Index>(k));
    const double bias = slope * shift, variance = slope * covariance * slope.transpose();
    biases += sample.areas[k] * bias * bias;
    variances += sample.areas[k] * variance;
    area += sample.areas[k];
    most = std::max(most, variance);
  }
  return {std::sqrt(biases / area), std::sqrt(variances / area), std::sqrt(most)};
}

MechanicalCostOptions cost_options(const Arguments& arguments) {
  MechanicalCostOptions options;
  options.cord_friction = arguments.cord_friction;
  options.residuals = arguments.residuals;
  return options;
}

/// The bound of Cramer and Rao: the covariance of the control values is no less than the inverse of
/// the information in the captures, here that of the noise alone, at the truth, for one who knows
/// where its control points are. Of each curve the root mean square of the relative standard
/// deviation over the strains that occur: what an unbiased fit that is as good as can be has on
/// average as its rms error.
void bound(const Arguments& arguments, const std::string& name) {
  const Fabric truth = true_fabric(name);
  const Trials trials = fit_trials(arguments, name, truth.model);
  MechanicalProblem problem(trials, truth, control_values(truth), cost_options(arguments),
                            arguments.threads);
  const VecX at = problem.scaled(truth);
  problem.weigh_by(problem.force_weights(at));
  const QuadraticModel model = problem.linearize(at).model;
  // The cost is the mean of the squares.
  const double count = problem.residual_count();
  const MatX covariance =
      2 / count * solve_symmetric(model.hessian, MatX::Identity(at.size(), at.size()));
  const auto frames =
      simulate_mechanical(trials, truth, MechanicalDerivatives::none, arguments.threads);
  fmt::print("\n{}: least rms error by the noise, the truth's control points known\n", name);
  Eigen::Index place = 0;
  for (std::size_t row = 0; row < 5; ++row) {
    const std::string_view component = kThreadParameters[row].name;
    const int points = truth.curve(component).size();
    const CurveErrors errors =
        curve_errors(truth, component, occurring(trials, frames, truth, row), VecX::Zero(points),
                     covariance.block(place, place, points, points));
    place += points;
    fmt::print("  {:<14} {} points, rms {:>6.2f} %, at the worst strain {:>6.2f} %\n", component,
               points, 100 * errors.deviation, 100 * errors.worst);
  }
  std::fflush(stdout);
}

/// The truth with smooth curves of stretch and shear, as a fit places their control points.
struct SmoothCurves {
  Fabric fabric;
  std::vector<std::string> rows, free;
  std::vector<ComponentSample> samples;
};
constexpr std::size_t kInPlane = 3;  // components, and tests that isolate them
constexpr int kSmoothPoints = 5;

SmoothCurves smooth_curves(const Fabric& truth, const Trials& trials, int threads) {
  const auto frames = simulate_mechanical(trials, truth, MechanicalDerivatives::none, threads);
  SmoothCurves result{truth, {}, {}, {}};
  for (std::size_t i = 0; i < kInPlane; ++i) {
    const std::string row(kThreadParameters[i].name);
    result.samples.push_back(occurring(trials, frames, truth, i));
    const StrainRange range = strain_range(result.samples.back());
    VecX knots = VecX::LinSpaced(kSmoothPoints, range.lower, range.upper);
    // Beyond its own tests, where the shear stretches it further.
    const std::size_t shear = kInPlane - 1;
    const double reached =
        strain_range(component_strains(*trials[shear], frames[shear], truth, row)).upper;
    if (i < shear && reached > 1.1 * range.upper) {
      knots.conservativeResize(kSmoothPoints + 1);
      knots[kSmoothPoints] = reached;
    }
    result.fabric.set_curve(row, truth.curve(row).resampled(knots));
    add_value_names(result.fabric, row, result.free);
    result.rows.push_back(row);
  }
  return result;
}

/// What smooth curves of stretch and shear, found together from their tests, are off by on average:
/// by the prior, which draws the truth towards straight ones, and by the noise; linear about the
/// truth's values at their control points, for curves of a given roughness each.
void smooth_bound(const Arguments& arguments, const std::string& name) {
  const Fabric truth = true_fabric(name);
  Trials trials = fit_trials(arguments, name, truth.model);
  trials.resize(kInPlane);
  const SmoothCurves curves = smooth_curves(truth, trials, arguments.threads);
  MechanicalCostOptions options = cost_options(arguments);
  options.smooth = curves.rows;
  MechanicalProblem problem(trials, curves.fabric, curves.free, options, arguments.threads);
  const VecX at = problem.scaled(curves.fabric);
  problem.weigh_by(problem.force_weights(at));
  const double half = 0.5 * problem.residual_count();
  const MatX information = half * problem.linearize(at).model.hessian;
  WeighedPriors priors = problem.priors();
  priors.weigh(1 / half);
  fmt::print("\n{}: expected errors of smooth curves: by the prior and by the noise\n", name);
  for (const double roughness : {0.5, 1.0, 2.0, 4.0}) {
    WeighedPriors::Roughness of_rows;
    for (const std::string& row : curves.rows) of_rows[row] = roughness;
    priors.roughen_by(of_rows);
    QuadraticModel prior{0, VecX::Zero(at.size()), MatX::Zero(at.size(), at.size())};
    priors.add_to(at, prior);
    const MatX inverse =
        solve_symmetric(information + half * prior.hessian, MatX::Identity(at.size(), at.size()));
    const VecX shift = -inverse * (half * prior.gradient);
    const MatX covariance = inverse * information * inverse;
    fmt::print("  roughness {:<4}", roughness);
    Eigen::Index place = 0;
    for (std::size_t i = 0; i < kInPlane; ++i) {
      const int points = curves.fabric.value_count(curves.rows[i]);
      const CurveErrors errors = curve_errors(curves.fabric, curves.rows[i], curves.samples[i],
                                              shift.segment(place, points),
                                              covariance.block(place, place, points, points));
      place += points;
      fmt::print("  {} {:.2f} % ({:.2f}, {:.2f})", curves.rows[i],
                 100 * std::hypot(errors.bias, errors.deviation), 100 * errors.bias,
                 100 * errors.deviation);
    }
    fmt::print("\n");
  }
  std::fflush(stdout);
}

void table(const Arguments& arguments, const std::string& name) {
  const Fabric truth = true_fabric(name);
  for (const std::string& model : arguments.models) {
    const Trials trials = fit_trials(arguments, name, model);
    for (const Variant& variant : kVariants) {
      CurveFitOptions options;
      options.shape = variant.shape == CurveShape::subdivided ? arguments.shape : variant.shape;
      options.symmetry = variant.symmetry;
      const std::string title = fmt::format("{}: {}, {}", name, model, variant.name);
      try {
        const CurveFitResult found =
            timed_fit(arguments, trials, wrong_fabric(truth, model, kStarts[0]), options, title);
        print_tests(arguments, name, found.fit.fabric);
      } catch (const Error& error) {  // no equilibrium: that, too, is a result
        fmt::print("\n{}: no fit: {}\n", title, error.what());
      }
    }
  }
}

/// "7.5e-5,1.25e-5,3e-3,0.1": points, clips, forces, cord friction.
RigNoise parse_noise(const std::string& text) {
  const auto numbers = numbers_of(text, ',');
  if (!numbers || numbers->size() != 4)
    throw Error(fmt::format("--noise {}: four numbers with commas are needed", text));
  const std::vector<double>& n = *numbers;
  return {.points = n[0], .clips = n[1], .forces = n[2], .cord_friction = n[3]};
}

constexpr const char* kUsage =
    "usage: weft_validate_rig OUT [recovery] [orders] [table] [bound] [known_forces] "
    "[--fabric NAME] [--model NAME] "
    "[--cells N] [--truth-cells N] [--steps N] [--starts N] [--threads N] [--seed N] "
    "[--uniform] [--smooth] "
    "[--skip ROW] [--only ROW] [--no-mesh-error] "
    "[--no-noise] [--noise POINTS,CLIPS,FORCES,FRICTION] [--cord-friction auto|fit|none] "
    "[--residuals auto|forces|points|both|stretch-points]";

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool more = i + 1 < argc;
    if (word == "--cells" && more)
      arguments.options.cells = validation::number<int>(word, argv[++i], 2);
    else if (word == "--truth-cells" && more)
      arguments.rig.mesh.cells = validation::number<int>(word, argv[++i], 2);
    else if (word == "--steps" && more)
      arguments.rig.steps = validation::number<int>(word, argv[++i], 1);
    else if (word == "--starts" && more)
      arguments.starts = validation::number<int>(word, argv[++i], 0);
    else if (word == "--threads" && more)
      arguments.threads = arguments.rig.threads = validation::number<int>(word, argv[++i], 0);
    else if (word == "--seed" && more)
      arguments.rig.seed = validation::number<std::uint64_t>(word, argv[++i], 0);
    else if (word == "--fabric" && more)
      arguments.fabrics = {argv[++i]};
    else if (word == "--model" && more)
      arguments.models = {argv[++i]};
    else if (word == "--skip" && more)
      arguments.skip = argv[++i];
    else if (word == "--no-noise")
      arguments.rig.noise = {0, 0, 0, 0};
    else if (word == "--only" && more)
      arguments.only = argv[++i];
    else if (word == "--no-mesh-error")
      arguments.mesh_error = MeshError::left_out;
    else if (word == "--noise" && more)
      arguments.rig.noise = parse_noise(argv[++i]);
    else if (word == "--cord-friction" && more)
      arguments.cord_friction = cord_friction_from_name(argv[++i]);
    else if (word == "--residuals" && more)
      arguments.residuals = mechanical_residuals_from_name(argv[++i]);
    else if (word == "--smooth")
      arguments.shape = CurveShape::smooth;
    else if (word == "--uniform")
      arguments.options.pattern = GridPattern::uniform;
    else if (arguments.out.empty())
      arguments.out = word;
    else
      arguments.parts.push_back(
          part(word, {"recovery", "orders", "table", "bound", "known_forces"}, kUsage));
  }
  if (arguments.out.empty()) throw Error(kUsage);
  if (arguments.parts.empty()) arguments.parts = {"recovery", "orders", "table"};
  return arguments;
}

void run(const Arguments& arguments) {
  for (const std::string& fabric : arguments.fabrics) {
    if (arguments.has("recovery")) recovery(arguments, fabric, FitOrder::incremental);
    if (arguments.has("orders")) recovery(arguments, fabric, FitOrder::joint);
    if (arguments.has("table")) table(arguments, fabric);
    if (arguments.has("known_forces")) known_forces(arguments, fabric);
    if (arguments.has("bound"))
      (arguments.shape == CurveShape::smooth ? smooth_bound : bound)(arguments, fabric);
  }
}

}  // namespace
}  // namespace weft::validation

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_rig", [&] {
    weft::validation::run(weft::validation::parse(argc, argv));
    return 0;
  });
}
