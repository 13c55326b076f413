#include "weft/estimate/computed_overhang.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "weft/capture/capture_checks.h"

namespace weft {
namespace {

constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();
constexpr int kMostSteps = 40, kLastSteps = 2;
constexpr double kFirstSlope = 3;     // of the elastica
constexpr double kLargestStep = 0.7;  // of log L
constexpr double kLastStep = 1e-6;    // of log L: the secant errs by far less
constexpr double kDifference = 1e-3;  // of log L
constexpr double kNear = 0.05;        // of log L: a step after which Newton's method goes straight
/// Of the weight of the strip, so that a light one, too, is at rest before the last steps.
constexpr double kForceTolerance = 1e-8;
constexpr double kLeastAngle = 1e-6;  // rad, from the horizontal and the vertical
constexpr double kHalfTurn = std::numbers::pi / 2;

const Clip& edge_of(const MechanicalCapture& capture) {
  return capture.fixtures.front().frames.front();
}
double depth_of(const MechanicalCapture& capture) { return edge_of(capture).region.upper.x(); }

/// The middle of the edge, and of the tip.
Vec2 edge_point(const MechanicalCapture& capture) {
  return {depth_of(capture), 0.5 * capture.height};
}
Vec2 tip_point(const MechanicalCapture& capture, const TriangleMesh& mesh) {
  return {mesh.material.row(0).maxCoeff(), 0.5 * capture.height};
}

/// From the edge to the tip: away, and down.
Vec2 chord_of(const MechanicalCapture& capture, const Vec3& tip) {
  const Vec3 edge = edge_of(capture).place(edge_point(capture));
  return {tip.x() - edge.x(), edge.z() - tip.z()};
}

double log_slope(double angle) {
  const double a = std::clamp(angle, kLeastAngle, kHalfTurn - kLeastAngle);
  return std::log(std::tan(a) / std::cos(0.5 * a));
}

/// The strip of a capture at any overhang.
class Strip {
 public:
  Strip(const MechanicalTrial& trial, const Fabric& fabric)
      : capture_(trial.capture),
        fabric_(fabric),
        statics_(trial.options.statics),
        mesh_(trial.stages.front().mesh),
        measured_(capture_.width - depth_of(capture_)) {
    const double weight = capture_.areal_density * measured_ * capture_.height;
    statics_.force_tolerance =
        std::min(statics_.force_tolerance, kForceTolerance * weight * capture_.gravity.norm());
  }

  /// An equilibrium, and how it was reached.
  struct Shape {
    double length = 0;
    Points x;
    double angle = 0;
    double residual = 0;
    bool converged = false;
  };

  Shape at_measured_length(const MechanicalFrame& frame) const {
    return shape(measured_, {measured_, frame.x});
  }

  /// From a shape of about this length.
  Shape shape(double length, const Shape& near) const {
    const TriangleMesh mesh = stretched(length);
    const auto model = make_elastic_model(mesh, fabric_, capture_.grain_angle);
    const HeavyCloth cloth(*model, capture_.areal_density, capture_.gravity);
    StaticOptions statics = statics_;
    if (std::abs(std::log(length / near.length)) < kNear)
      statics.start = StaticOptions::Start::near_equilibrium;
    ClippedCloth clipped(cloth, capture_.clips(0));
    ClipEquilibrium found = clipped.solve(moved(near, length), statics);
    // A start that is good enough stays as it is; the angle needs what Newton's method still gives.
    if (found.converged) found.x = clipped.solve(std::move(found.x), last_steps(statics)).x;
    const double angle = chord_angle(capture_, mesh, found.x);
    return {length, std::move(found.x), angle, found.residual, found.converged};
  }

  /// d angle / d parameters.
  struct Slope {
    VecX by_parameters;
    bool inexact = false;
  };
  Slope slope(const Shape& shape) const {
    const TriangleMesh mesh = stretched(shape.length);
    const auto model = make_elastic_model(mesh, fabric_, capture_.grain_angle);
    const HeavyCloth cloth(*model, capture_.areal_density, capture_.gravity);
    const ClipSensitivities s = ClippedCloth(cloth, capture_.clips(0)).sensitivities(shape.x);
    const auto hit = MaterialLocator(mesh).locate(tip_point(capture_, mesh));
    Vec3 tip = Vec3::Zero();
    MatX tip_slope = MatX::Zero(3, s.x.cols());
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const int vertex = mesh.triangles[static_cast<std::size_t>(hit.triangle)][corner];
      const double weight = hit.barycentric[static_cast<Eigen::Index>(corner)];
      tip += weight * shape.x.col(vertex);
      tip_slope += weight * s.x.middleRows(3 * vertex, 3);
    }
    const Vec2 chord = chord_of(capture_, tip);
    const VecX by_parameters =
        -(chord.x() * tip_slope.row(2) + chord.y() * tip_slope.row(0)) / chord.squaredNorm();
    return {by_parameters, s.inexact};
  }

 private:
  TriangleMesh stretched(double length) const {
    TriangleMesh mesh = mesh_;
    const double depth = depth_of(capture_), factor = length / measured_;
    for (double& u : mesh.material.row(0))
      if (u > depth) u = depth + (u - depth) * factor;
    return mesh;
  }

  static StaticOptions last_steps(StaticOptions statics) {
    statics.start = StaticOptions::Start::near_equilibrium;
    statics.force_tolerance = std::numeric_limits<double>::min();
    statics.max_iterations = kLastSteps;
    return statics;
  }

  /// `near` in proportion to a length, as a start: where the edge is, nothing moves.
  Points moved(const Shape& near, double length) const {
    const double factor = length / near.length, depth = depth_of(capture_);
    const Vec3 edge = edge_of(capture_).place(edge_point(capture_));
    Points x = near.x;
    for (Eigen::Index i = 0; i < x.cols(); ++i) {
      if (mesh_.material(0, i) <= depth) continue;
      x(0, i) = edge.x() + factor * (x(0, i) - edge.x());
      x(2, i) = edge.z() + factor * (x(2, i) - edge.z());
    }
    return x;
  }

  const MechanicalCapture& capture_;
  const Fabric& fabric_;
  StaticOptions statics_;
  const TriangleMesh& mesh_;
  double measured_;
};

/// The overhang that reaches the angle, and a shape within kLastStep of it.
struct Reached {
  double overhang = kNoNumber;
  Strip::Shape shape;
};
/// From `shape`; no number where there is none.
Reached reach(double angle, const Strip& strip, Strip::Shape shape) {
  double slope = kFirstSlope;
  for (int k = 0; k < kMostSteps && shape.converged; ++k) {
    const double missing = log_slope(angle) - log_slope(shape.angle);
    const double step = std::clamp(missing / slope, -kLargestStep, kLargestStep);
    const double length = shape.length * std::exp(step);
    if (std::abs(step) < kLastStep) return {length, std::move(shape)};
    if (length < kSwatchSide.lower || length > kSwatchSide.upper) break;
    const double before = log_slope(shape.angle);
    shape = strip.shape(length, shape);
    const double secant = (log_slope(shape.angle) - before) / step;
    // Of steps that are all rounding, and of angles at an end, it says nothing.
    if (secant > 0.1 * kFirstSlope && secant < 10 * kFirstSlope) slope = secant;
  }
  return {kNoNumber, std::move(shape)};
}

}  // namespace

double chord_angle(const MechanicalCapture& capture, const TriangleMesh& mesh, const Points& x) {
  const Vec3 tip = interpolate(mesh, MaterialLocator(mesh), x, tip_point(capture, mesh)).col(0);
  const Vec2 chord = chord_of(capture, tip);
  return std::atan2(chord.y(), chord.x());
}

void add_overhang(const MechanicalTrial& trial, const Fabric& fabric,
                  MechanicalDerivatives derivatives, MechanicalFrame& frame) {
  frame.overhang = kNoNumber;
  if (!frame.converged) return;
  const Strip strip(trial, fabric);
  const double angle = trial.capture.overhang->angle;
  const auto [overhang, found] = reach(angle, strip, strip.at_measured_length(frame));
  frame.residual = std::max(frame.residual, found.residual);
  frame.overhang = overhang;
  frame.converged = std::isfinite(overhang);
  if (!frame.converged) return;
  if (derivatives != MechanicalDerivatives::all) return;
  const Strip::Shape longer = strip.shape(found.length * std::exp(kDifference), found),
                     shorter = strip.shape(found.length * std::exp(-kDifference), found);
  frame.converged = longer.converged && shorter.converged;
  const double by_log_length = (longer.angle - shorter.angle) / (2 * kDifference);
  const Strip::Slope slope = strip.slope(found);
  frame.overhang_derivative = -overhang / by_log_length * slope.by_parameters;
  frame.inexact = frame.inexact || slope.inexact;
}

std::string overhang_problem(const MechanicalTrial& trial, const MechanicalFrame& frame) {
  if (!trial.capture.overhang || std::isfinite(frame.overhang)) return {};
  return fmt::format("{}: no overhang of {:g} to {:g} m at which the strip reaches {:.4g} degrees",
                     trial.capture.name, kSwatchSide.lower, kSwatchSide.upper,
                     trial.capture.overhang->angle * 180 / std::numbers::pi);
}

double overhang_residual(const OverhangTest& test, const MechanicalFrame& frame) {
  return (frame.overhang - test.lengths[frame.frame]) / test.deviation;
}

OverhangDifference overhang_difference(const OverhangTest& test,
                                       const std::vector<MechanicalFrame>& frames) {
  double squares = 0;
  for (const MechanicalFrame& frame : frames)
    squares += std::pow(frame.overhang - test.lengths[frame.frame], 2);
  return {test.lengths.mean(), frames.front().overhang,
          std::sqrt(squares / static_cast<double>(frames.size()))};
}

MaterialPoints middle_line(const MechanicalCapture& capture, const TriangleMesh& mesh,
                           const Points& x) {
  std::set<double> lines;
  for (const double u : mesh.material.row(0))
    if (u >= depth_of(capture)) lines.insert(u);
  MaterialPoints at(2, static_cast<Eigen::Index>(lines.size()));
  Eigen::Index k = 0;
  for (const double u : lines) at.col(k++) = Vec2(u, 0.5 * capture.height);
  const Points middle = interpolate(mesh, MaterialLocator(mesh), x, at);
  const Vec3 edge = edge_of(capture).place(edge_point(capture));
  MaterialPoints line(2, middle.cols());
  line.row(0) = middle.row(0).array() - edge.x();
  line.row(1) = middle.row(2).array() - edge.z();
  return line;
}

}  // namespace weft
