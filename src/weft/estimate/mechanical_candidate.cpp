#include "weft/estimate/mechanical_candidate.h"

#include <fmt/format.h>

#include <cmath>

#include "weft/base/error.h"
#include "weft/base/files.h"
#include "weft/capture/capture_checks.h"
#include "weft/capture/capture_file.h"
#include "weft/estimate/computed_overhang.h"

namespace weft {
namespace {

using Kind = CandidateTest::Kind;

constexpr Range kForceNoise{1e-9, 1e3};  // N
constexpr Range kPointNoise{1e-9, 1};    // m
constexpr int kMostReadings = 10000;
/// Of the free length: clips are then less than kMaxClipStretch times as far apart as at rest.
constexpr double kFarthest = kMaxClipStretch - 1;
constexpr double kFirstOverhang = 0.05;  // m, from which that of a fabric is found

constexpr std::string_view kKindNames[] = {"strip", "bias-extension", "cantilever", "overhang"};

Range readings_of(Kind kind) {
  if (kind == Kind::overhang) return {1, kMostOverhangs};
  return {kind == Kind::cantilever ? double(kLeastProfile) : 1.0, kMostReadings};
}

Kind kind_from_name(std::string_view name) {
  for (const Kind kind : {Kind::bias_extension, Kind::cantilever, Kind::overhang})
    if (name == name_of(kind)) return kind;
  return Kind::strip;
}

Specimen read_specimen(const TomlTable& table, Kind kind) {
  Specimen specimen;
  if (kind != Kind::overhang) specimen.free_length = table.number("free_length", kSwatchSide);
  specimen.width = table.number("width", kSwatchSide);
  specimen.areal_density = table.optional_number("areal_density", kArealDensity).value_or(0);
  const double otherwise = kind == Kind::bias_extension ? 45 : 0;
  specimen.grain_angle =
      kDegree * table.optional_number("grain_angle_deg", kGrainAngle).value_or(otherwise);
  table.finish();
  return specimen;
}

void read_profile(const TomlTable& table, CandidateTest& test) {
  test.readings = table.integer("readings", kLeastProfile, kMostReadings);
  test.clamp_angle = kDegree * table.optional_number("clamp_angle_deg", kClampAngle).value_or(0);
  table.finish();
}

void read_overhang(const TomlTable& table, CandidateTest& test) {
  test.readings = table.integer("readings", 1, kMostOverhangs);
  test.angle =
      table.optional_number("angle_deg", kOverhangAngle).value_or(test.angle / kDegree) * kDegree;
  test.deviation = table.optional_number("deviation", kOverhangDeviation).value_or(test.deviation);
  table.finish();
}

void read_curve(const TomlTable& table, CandidateTest& test) {
  const double unit = length_factor(table, "displacement_unit");
  const Range valid{0, kFarthest * test.specimen.free_length / unit};
  const std::vector<double> ends = table.numbers("displacement", 2, valid);
  test.first = unit * ends[0];
  test.last = unit * ends[1];
  test.readings = table.integer("readings", 1, kMostReadings);
  table.finish();
}

std::shared_ptr<const MechanicalTrial> strip_trial(const CandidateTest& test,
                                                   const Specimen& specimen,
                                                   const MechanicalOptions& options) {
  MechanicalCapture capture = strip_capture(
      specimen, VecX::LinSpaced(test.readings, test.first, test.last), VecX::Zero(test.readings));
  capture.name = test.name;
  capture.clip_noise = test.clip_noise;
  return prepare_mechanical(capture, options);
}

/// The profile starts as the clamp points.
std::shared_ptr<const MechanicalTrial> cantilever_trial(const CandidateTest& test,
                                                        const Specimen& specimen,
                                                        const MechanicalOptions& options) {
  MechanicalCapture capture = cantilever_capture(specimen, test.clamp_angle, Vec2::Zero());
  capture.name = test.name;
  const VecX arc = VecX::LinSpaced(test.readings, 0, specimen.free_length);
  MaterialPoints line(2, arc.size());
  line << std::cos(test.clamp_angle) * arc.transpose(),
      -std::sin(test.clamp_angle) * arc.transpose();
  return prepare_mechanical(capture, cantilever_geometry(capture, arc, line), options);
}

/// The readings are what the fabric overhangs by.
std::shared_ptr<const MechanicalTrial> overhang_trial(const CandidateTest& test,
                                                      const Specimen& specimen,
                                                      const Fabric& fabric,
                                                      const MechanicalOptions& options) {
  const auto trial_of = [&](int readings, double length) {
    MechanicalCapture capture =
        overhang_capture(specimen, {VecX::Constant(readings, length), test.angle, test.deviation});
    capture.name = test.name;
    return prepare_mechanical(capture, options);
  };
  const auto first = trial_of(1, kFirstOverhang);
  const MechanicalFrame frame = simulate_mechanical({first}, fabric)[0][0];
  if (const std::string problem = overhang_problem(*first, frame); !problem.empty())
    throw Error(problem);
  return trial_of(test.readings, frame.overhang);
}

/// Of the first `n` unknowns where nothing else is known of the others.
MatX marginal_information(const MatX& all, Eigen::Index n) {
  MatX information = all.topLeftCorner(n, n);
  // No capture shares its friction with another: the complement goes one by one.
  for (Eigen::Index j = n; j < all.cols(); ++j)
    if (all(j, j) > 0) information -= all.col(j).head(n) * all.row(j).head(n) / all(j, j);
  return information;
}

MatX information_of(std::shared_ptr<const MechanicalTrial> trial, const Fabric& fabric,
                    const MechanicalCostOptions& cost, int threads) {
  MechanicalProblem problem({std::move(trial)}, fabric, fabric.value_names(), cost, threads);
  const VecX scaled = problem.scaled(fabric);
  MechanicalShapes shapes;
  problem.weigh_by(
      problem.force_weights(scaled, &shapes, MechanicalProblem::ClipPlaces::as_weighed));
  const MechanicalProblem::Linearization found = problem.linearize(scaled, &shapes);
  if (!std::isfinite(found.model.cost)) throw Error(found.reason);
  MatX sum = MatX::Zero(found.parts.front().hessian.rows(), found.parts.front().hessian.cols());
  for (const CostPart& part : found.parts) sum += part.hessian;
  // The cost's Gauss-Newton matrix is 2 J^T J / count.
  sum *= 0.5 * problem.residual_count();
  return marginal_information(sum, scaled.size());
}

MechanicalCostOptions cost_of(double force_noise, double point_noise) {
  MechanicalCostOptions cost;
  cost.force_noise = force_noise;
  cost.point_noise = point_noise;
  return cost;
}

}  // namespace

std::string_view name_of(Kind kind) { return kKindNames[static_cast<std::size_t>(kind)]; }

std::string words_of(const CandidateTest& t) {
  const std::string specimen = fmt::format("{} {:g} x {:g} mm at {:g} degrees", name_of(t.kind),
                                           1e3 * t.specimen.free_length, 1e3 * t.specimen.width,
                                           t.specimen.grain_angle / kDegree);
  if (t.kind == Kind::overhang)
    return fmt::format("overhang {:g} mm wide at {:g} degrees, {} reading{}",
                       1e3 * t.specimen.width, t.specimen.grain_angle / kDegree, t.readings,
                       t.readings == 1 ? "" : "s");
  if (t.kind == Kind::cantilever) return fmt::format("{}, {} points", specimen, t.readings);
  return fmt::format("{}, {:g} to {:g} mm, {} readings", specimen, 1e3 * t.first, 1e3 * t.last,
                     t.readings);
}

std::string words_of(const CandidateCapture& capture) {
  return "as " + capture_folder(capture.folder).string();
}

void check_experiment_value(const std::string& experiment, std::string_view key, double value,
                            Range valid) {
  if (!(value >= valid.lower && value <= valid.upper))
    throw Error(fmt::format("experiment \"{}\": {} = {:g}, valid: {:g} to {:g}", experiment, key,
                            value, valid.lower, valid.upper));
}

void check(const CandidateTest& t) {
  const auto require = [&](std::string_view key, double value, Range valid) {
    check_experiment_value(t.name, key, value, valid);
  };
  if (t.kind != Kind::overhang) require("free_length", t.specimen.free_length, kSwatchSide);
  require("width", t.specimen.width, kSwatchSide);
  if (t.specimen.areal_density != 0)
    require("areal_density", t.specimen.areal_density, kArealDensity);
  require("grain_angle_deg", t.specimen.grain_angle / kDegree, kGrainAngle);
  const Range way{0, kFarthest * t.specimen.free_length};
  if (t.kind != Kind::overhang)
    for (const double displacement : {t.first, t.last}) require("displacement", displacement, way);
  require("angle_deg", t.angle / kDegree, kOverhangAngle);
  require("deviation", t.deviation, kOverhangDeviation);
  require("clamp_angle_deg", t.clamp_angle / kDegree, kClampAngle);
  require("readings", t.readings, readings_of(t.kind));
  require("force_noise", t.force_noise, kForceNoise);
  require("point_noise", t.point_noise, kPointNoise);
  require("clip_noise", t.clip_noise, kClipNoise);
}

void check(const CandidateCapture& capture) {
  check_experiment_value(capture.name, "force_noise", capture.force_noise, kForceNoise);
  check_experiment_value(capture.name, "point_noise", capture.point_noise, kPointNoise);
  read_mechanical_capture(capture.folder);
}

CandidateTest read_candidate_test(const TomlTable& table) {
  CandidateTest test;
  test.kind = kind_from_name(
      table.choice("test", std::vector<std::string>(std::begin(kKindNames), std::end(kKindNames))));
  test.specimen = read_specimen(table.table("specimen"), test.kind);
  if (test.kind == Kind::cantilever) {
    read_profile(table.table("profile"), test);
    test.point_noise = table.optional_number("point_noise", kPointNoise).value_or(test.point_noise);
  } else if (test.kind == Kind::overhang) {
    read_overhang(table.table("overhang"), test);
  } else {
    read_curve(table.table("curve"), test);
    test.force_noise = table.optional_number("force_noise", kForceNoise).value_or(test.force_noise);
    test.clip_noise = table.optional_number("clip_noise", kClipNoise).value_or(0);
  }
  test.name = table.optional_string("name").value_or(words_of(test));
  table.finish();
  return test;
}

CandidateCapture read_candidate_capture(const TomlTable& table) {
  CandidateCapture capture;
  capture.folder = table.file().parent_path() / table.string("capture");
  if (!is_folder(capture.folder, table.where("capture")))
    throw error_at(table.where("capture"),
                   fmt::format("\"{}\" is no folder", capture.folder.string()));
  capture.force_noise =
      table.optional_number("force_noise", kForceNoise).value_or(capture.force_noise);
  capture.point_noise =
      table.optional_number("point_noise", kPointNoise).value_or(capture.point_noise);
  capture.name = table.optional_string("name").value_or(words_of(capture));
  table.finish();
  return capture;
}

std::vector<CandidateTest> default_tests() {
  const Specimen strip{0.2, 0.05}, bias{0.2, 0.1, 0, 45 * kDegree}, flap{0.05, 0.025};
  const auto turned = [](Specimen specimen, double degrees) {
    specimen.grain_angle = degrees * kDegree;
    return specimen;
  };
  return {{"strip along the weft", Kind::strip, strip},
          {"strip along the warp", Kind::strip, turned(strip, 90)},
          {"strip at 45 degrees", Kind::strip, turned(strip, 45)},
          {"bias extension", Kind::bias_extension, bias, 0, 0.02},
          {"cantilever along the weft", Kind::cantilever, flap},
          {"cantilever along the warp", Kind::cantilever, turned(flap, 90)}};
}

MatX mechanical_information(const CandidateTest& test, const Fabric& fabric,
                            const MechanicalInformationOptions& options) {
  check(test);
  Specimen specimen = test.specimen;
  if (specimen.areal_density == 0)
    specimen.areal_density = fabric.areal_density.value_or(options.areal_density);
  const auto trial =
      test.kind == Kind::cantilever ? cantilever_trial(test, specimen, options.mechanical)
      : test.kind == Kind::overhang ? overhang_trial(test, specimen, fabric, options.mechanical)
                                    : strip_trial(test, specimen, options.mechanical);
  return information_of(trial, fabric, cost_of(test.force_noise, test.point_noise),
                        options.threads);
}

MatX mechanical_information(const CandidateCapture& capture, const Fabric& fabric,
                            const MechanicalInformationOptions& options) {
  check(capture);
  const auto trial =
      prepare_mechanical(read_mechanical_capture(capture.folder), options.mechanical);
  return information_of(trial, fabric, cost_of(capture.force_noise, capture.point_noise),
                        options.threads);
}

}  // namespace weft
