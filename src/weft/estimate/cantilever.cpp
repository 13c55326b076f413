#include "weft/estimate/cantilever.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/estimate/least_squares.h"

namespace weft {
namespace {

constexpr double kSteepestClamp = 80 * std::numbers::pi / 180;
constexpr Eigen::Index kLeastProfilePoints = 8;
constexpr double kLongest = 10;  // m
/// Of the length, by which a straight strip's points may be off.
constexpr double kStraight = 0.01;
/// Of the length: no strip under gravity is as far from its elastica.
constexpr double kMostDistance = 0.1;
constexpr double kMostClamp = 1;  // rad, either sign, in a fit

void require_positive(double value, const char* name) {
  if (value > 0 && std::isfinite(value)) return;
  throw Error(fmt::format("cantilever: {} {:g} must be above 0", name, value));
}

void require_rising(const BendLaw& law) {
  const double last = law.bend.knots()[law.bend.size() - 1];
  for (int i = 0; i <= 100; ++i)
    if (!(law.respond(0.01 * i * std::abs(last)).tangent > 0))
      throw Error("cantilever: the moment must rise with the curvature");
}

/// States from the free end: angle, curvature and place.
struct State {
  double angle, curvature, x, y;
};
State rate(const BendLaw& law, double weight, double t, const State& s) {
  return {-s.curvature, weight * t * std::cos(s.angle) / law.respond(s.curvature).tangent,
          std::cos(s.angle), -std::sin(s.angle)};
}
State advanced(const State& s, double h, const State& d) {
  return {s.angle + h * d.angle, s.curvature + h * d.curvature, s.x + h * d.x, s.y + h * d.y};
}

/// From the free end at (0, 0); x and y are the way from the tip, negated.
std::vector<State> shoot(const BendLaw& law, double weight, double length, double tip_angle,
                         int steps) {
  std::vector<State> states{{tip_angle, 0, 0, 0}};
  const double h = length / steps;
  for (int i = 0; i < steps; ++i) {
    const State& s = states.back();
    const double t = i * h;
    const State a = rate(law, weight, t, s);
    const State b = rate(law, weight, t + h / 2, advanced(s, h / 2, a));
    const State c = rate(law, weight, t + h / 2, advanced(s, h / 2, b));
    const State d = rate(law, weight, t + h, advanced(s, h, c));
    State next = s;
    for (const auto& [k, part] : {std::pair{&a, 1.0}, {&b, 2.0}, {&c, 2.0}, {&d, 1.0}})
      next = advanced(next, part * h / 6, *k);
    states.push_back(next);
    if (!(next.angle > -std::numbers::pi)) break;  // far beyond any clamp
  }
  return states;
}

/// Where a function that rises from below zero at `low` to above zero at `high` is zero: false
/// position with halving (Illinois).
template <class Function>
double root_of(const Function& function, double low, double high) {
  double at_low = function(low), at_high = function(high);
  if (at_low >= 0) return low;
  int side = 0;
  for (int i = 0; i < 100 && high - low > 1e-13; ++i) {
    const double x = (at_high * low - at_low * high) / (at_high - at_low);
    const double value = function(x);
    if (value == 0) return x;
    if (value > 0) {
      high = x;
      at_high = value;
      if (side > 0) at_low /= 2;
      side = 1;
    } else {
      low = x;
      at_low = value;
      if (side < 0) at_high /= 2;
      side = -1;
    }
    if (std::abs(value) < 1e-13) return x;
  }
  return 0.5 * (low + high);
}

/// First and second derivative by s at s0 of a cubic fitted with tricube weights.
struct ProfileDerivatives {
  Vec2 first, second;
};
ProfileDerivatives local_cubic(const MaterialPoints& profile, const VecX& arc, double s0,
                               double window) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Matrix<double, 4, 2> right = Eigen::Matrix<double, 4, 2>::Zero();
  Eigen::Index used = 0;
  for (Eigen::Index i = 0; i < arc.size(); ++i) {
    const double t = (arc[i] - s0) / window;
    if (std::abs(t) >= 1) continue;
    const double w = std::pow(1 - std::pow(std::abs(t), 3), 3);
    const Eigen::Vector4d row(1, t, t * t, t * t * t);
    normal += w * row * row.transpose();
    right += w * row * profile.col(i).transpose();
    ++used;
  }
  if (used < kLeastProfilePoints)
    throw Error(fmt::format("cantilever: {} points within the window of {:g} m; {} are needed",
                            used, window, kLeastProfilePoints));
  const Eigen::Matrix<double, 4, 2> c = solve_symmetric(normal, right);
  return {c.row(1).transpose() / window, 2 * c.row(2).transpose() / (window * window)};
}

/// What holds the cubics: a third of the length, or the widest run of the points that one needs.
double default_window(const VecX& arc) {
  double widest = 0;
  for (Eigen::Index i = kLeastProfilePoints - 1; i < arc.size(); ++i)
    widest = std::max(widest, arc[i] - arc[i - kLeastProfilePoints + 1]);
  return std::max(arc[arc.size() - 1] / 3, 1.001 * widest);  // the rim of a window has no weight
}

/// A strip under gravity turns down from the direction in which it leaves the clamp, here that of
/// its first third, and does not turn back.
void check_orientation(const MaterialPoints& profile, const VecX& arc) {
  constexpr const char* kMeaning =
      "x is away from the clamp, y is up, the first point at the clamp";
  const double length = arc[arc.size() - 1];
  const Vec2 tip = profile.col(profile.cols() - 1) - profile.col(0);
  if (!(tip.x() > 0))
    throw Error(
        fmt::format("cantilever: the tip's x is {:g} m from the clamp's, must be above 0; {}",
                    tip.x(), kMeaning));
  Eigen::Index third = 1;
  while (arc[third] < length / 3) ++third;
  const Vec2 along = (profile.col(third) - profile.col(0)).normalized();
  const double above = along.x() * tip.y() - along.y() * tip.x();
  if (above > kStraight * length)
    throw Error(
        fmt::format("cantilever: the tip is {:.3g} m above the line along which the strip "
                    "leaves the clamp, must be below; {}",
                    above, kMeaning));
}

void check_profile(const MaterialPoints& profile, double weight) {
  require_positive(weight, "weight");
  if (profile.cols() < kLeastProfilePoints)
    throw Error(fmt::format("cantilever: a profile of {} points; {} are needed", profile.cols(),
                            kLeastProfilePoints));
  if (!profile.allFinite()) throw Error("cantilever: a point of the profile is not finite");
  const VecX arc = profile_arc(profile);
  const double length = arc[arc.size() - 1];
  if (!(length <= kLongest))
    throw Error(fmt::format("cantilever: a strip of {:g} m, must be at most {:g}; x and y are in m",
                            length, kLongest));
  check_orientation(profile, arc);
}

MaterialPoints sampled(const ElasticaProfile& elastica, const VecX& arc) {
  MaterialPoints out(2, arc.size());
  const double h = elastica.arc[1] - elastica.arc[0];
  for (Eigen::Index i = 0; i < arc.size(); ++i) {
    const auto j =
        std::clamp<Eigen::Index>(static_cast<Eigen::Index>(arc[i] / h), 0, elastica.arc.size() - 2);
    // A cubic with the strip's direction at both ends.
    const double t = (arc[i] - elastica.arc[j]) / h, u = 1 - t;
    const auto way = [&](Eigen::Index k) {
      return Vec2(std::cos(elastica.angle[k]), -std::sin(elastica.angle[k]));
    };
    out.col(i) = u * u * (1 + 2 * t) * elastica.at.col(j) +
                 t * t * (1 + 2 * u) * elastica.at.col(j + 1) +
                 h * t * u * (u * way(j) - t * way(j + 1));
  }
  return out;
}

/// The fit's residuals by the logarithms of the law's numbers and the angle at the clamp.
class CantileverResiduals {
 public:
  /// `largest`: curvature that the strip reaches.
  CantileverResiduals(const MaterialPoints& profile, double weight, BendTerms terms, double largest)
      : profile_(profile.colwise() - profile.col(0).eval()),
        arc_(profile_arc(profile)),
        weight_(weight),
        terms_(terms),
        largest_(largest) {}

  BendLaw law(const VecX& x) const {
    const VecX values = x.head(x.size() - 1).array().exp();
    if (terms_ == BendTerms::constant) return {StiffnessCurve(values[0])};
    return {StiffnessCurve(values[0]), values[1], values[2]};
  }
  VecX start(double rigidity, double root_angle) const {
    const double log = std::log(rigidity);
    if (terms_ == BendTerms::constant) return Vec2(log, root_angle);
    return Eigen::Vector4d(log, log + std::log(0.2 * largest_), std::log(0.1 * largest_),
                           root_angle);
  }
  double length() const { return arc_[arc_.size() - 1]; }

  /// Empty where there is no such elastica.
  VecX residuals(const VecX& x) const {
    try {
      const ElasticaProfile elastica =
          heavy_elastica(law(x), weight_, length(), x[x.size() - 1], kFitSteps);
      const MaterialPoints difference = sampled(elastica, arc_) - profile_;
      return Eigen::Map<const VecX>(difference.data(), difference.size()) / length();
    } catch (const Error&) {
      return {};
    }
  }
  double cost(const VecX& x) const {
    const VecX r = residuals(x);
    return r.size() == 0 ? kInfinity : r.squaredNorm();
  }

  QuadraticModel linearize(const VecX& x) const {
    const VecX r = residuals(x);
    if (r.size() == 0) return {kInfinity, VecX::Zero(x.size()), MatX::Identity(x.size(), x.size())};
    MatX jacobian = MatX::Zero(r.size(), x.size());
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      VecX moved = x;
      moved[i] += kDifference;
      const VecX above = residuals(moved);
      moved[i] -= 2 * kDifference;
      const VecX below = residuals(moved);
      if (above.size() > 0 && below.size() > 0)
        jacobian.col(i) = (above - below) / (2 * kDifference);
    }
    return {r.squaredNorm(), 2 * jacobian.transpose() * r, 2 * jacobian.transpose() * jacobian};
  }

 private:
  static constexpr double kDifference = 1e-4;
  static constexpr int kFitSteps = 200;

  MaterialPoints profile_;
  VecX arc_;
  double weight_;
  BendTerms terms_;
  double largest_;
};

/// Where no strip that is clamped at its first point bends like this.
void check_fit(const CantileverFit& fit, double length) {
  std::string problem;
  if (fit.distance_rms > kMostDistance * length)
    problem = fmt::format("the nearest elastica is {:.3g} m rms away, {:.0f} % of the length",
                          fit.distance_rms, 100 * fit.distance_rms / length);
  else if (std::abs(fit.root_angle) > kMostClamp - 1e-6)
    problem = fmt::format("the clamp comes out at {:.0f} degrees, the end of its range",
                          fit.root_angle / kDegree);
  if (!problem.empty())
    throw Error(
        fmt::format("cantilever: no strip under gravity bends like the profile: {}; x is "
                    "away from the clamp, y is up, the first point at the clamp",
                    problem));
}

CantileverFit fit_terms(const CantileverResiduals& problem, const VecX& start) {
  VecX lower = start.array() - std::log(1e3), upper = start.array() + std::log(1e3);
  lower[start.size() - 1] = -kMostClamp;
  upper[start.size() - 1] = kMostClamp;
  LeastSquaresOptions options;
  options.max_iterations = 300;
  options.step_tolerance = 1e-6;
  options.cost_tolerance = 1e-6;
  options.initial_damping = 1e-7;
  const LeastSquaresResult found = minimize_least_squares(
      [&](const VecX& x) { return problem.linearize(x); },
      [&](const VecX& x) { return problem.cost(x); }, start, lower, upper, options);
  const VecX r = problem.residuals(found.x) * problem.length();
  if (r.size() == 0) throw Error("cantilever: no elastica fits the profile");
  CantileverFit fit;
  fit.law = problem.law(found.x);
  fit.root_angle = found.x[start.size() - 1];
  const auto points = MaterialPoints::Map(r.data(), 2, r.size() / 2);
  fit.distance_rms = std::sqrt(points.colwise().squaredNorm().mean());
  fit.distance_max = points.colwise().norm().maxCoeff();
  check_fit(fit, problem.length());
  return fit;
}

}  // namespace

BendLaw::Response BendLaw::respond(double curvature) const {
  const auto elastic = bend.respond(curvature);
  const double rest = std::exp(-curvature / friction_scale);
  return {elastic.stress + friction * (1 - rest),
          elastic.tangent + friction * rest / friction_scale};
}

double standard_bending_length(double overhang) {
  require_positive(overhang, "overhang");
  return overhang / 2;
}

double peirce_bending_length(double overhang, double angle) {
  require_positive(overhang, "overhang");
  return overhang * std::cbrt(std::cos(angle / 2) / (8 * std::tan(angle)));
}

double flexural_rigidity(double weight, double bending_length) {
  require_positive(weight, "weight");
  require_positive(bending_length, "bending length");
  return weight * bending_length * bending_length * bending_length;
}

double bending_length(double weight, double rigidity) {
  require_positive(weight, "weight");
  require_positive(rigidity, "rigidity");
  return std::cbrt(rigidity / weight);
}

ElasticaProfile heavy_elastica(const BendLaw& law, double weight, double length, double root_angle,
                               int steps) {
  require_positive(weight, "weight");
  require_positive(length, "length");
  require_positive(law.bend.values().maxCoeff(), "stiffness");
  require_positive(law.friction_scale, "friction scale");
  if (!(std::abs(root_angle) <= kSteepestClamp))
    throw Error(
        fmt::format("cantilever: clamped at {:g} rad; valid is -1.396 to 1.396", root_angle));
  require_rising(law);
  // The angle at the clamp rises with that at the tip, as long as the strip does not hang straight
  // down; what lies between the clamp's angle and that is where the tip can be.
  const auto miss = [&](double tip) {
    return shoot(law, weight, length, tip, steps).back().angle - root_angle;
  };
  const double tip = root_of(miss, root_angle, std::numbers::pi / 2);
  const std::vector<State> states = shoot(law, weight, length, tip, steps);
  ElasticaProfile out;
  const Eigen::Index n = steps + 1;
  out.arc = VecX::LinSpaced(n, 0, length);
  out.at.resize(2, n);
  out.angle.resize(n);
  out.curvature.resize(n);
  out.moment.resize(n);
  if (static_cast<Eigen::Index>(states.size()) != n)
    throw Error("cantilever: the strip is too limp for its length: it hangs straight down");
  const State root = states.back();
  for (Eigen::Index i = 0; i < n; ++i) {
    const State& s = states[static_cast<std::size_t>(n - 1 - i)];
    out.at.col(i) = Vec2(root.x - s.x, root.y - s.y);
    out.angle[i] = s.angle;
    out.curvature[i] = s.curvature;
    out.moment[i] = law.respond(s.curvature).moment;
  }
  return out;
}

double load_of_chord_angle(double angle) {
  if (!(angle >= 0.01 && angle <= 1.3))
    throw Error(fmt::format("cantilever: angle {:g} rad; valid is 0.01 to 1.3", angle));
  const auto chord = [](double load) {
    const ElasticaProfile profile = heavy_elastica(1.0, load, 1);
    const Vec2 tip = profile.at.col(profile.at.cols() - 1);
    return std::atan2(-tip.y(), tip.x());
  };
  return std::exp(root_of([&](double log_load) { return chord(std::exp(log_load)) - angle; },
                          std::log(1e-3), std::log(400.0)));
}

double rigidity_of_overhang(double weight, double overhang, double angle) {
  require_positive(weight, "weight");
  require_positive(overhang, "overhang");
  return weight * overhang * overhang * overhang / load_of_chord_angle(angle);
}

double overhang_of_rigidity(double weight, double rigidity, double angle) {
  return bending_length(weight, rigidity) * std::cbrt(load_of_chord_angle(angle));
}

VecX profile_arc(const MaterialPoints& profile) {
  VecX arc = VecX::Zero(profile.cols());
  for (Eigen::Index i = 1; i < arc.size(); ++i) {
    const double part = (profile.col(i) - profile.col(i - 1)).norm();
    if (!(part > 0)) throw Error("cantilever: two points of the profile coincide");
    arc[i] = arc[i - 1] + part;
  }
  return arc;
}

VecX profile_moment(const MaterialPoints& profile, double weight) {
  const Eigen::Index n = profile.cols();
  VecX moment(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    double sum = 0;
    for (Eigen::Index j = i + 1; j < n; ++j)
      sum += (profile.col(j) - profile.col(j - 1)).norm() *
             (0.5 * (profile(0, j) + profile(0, j - 1)) - profile(0, i));
    moment[i] = weight * sum;
  }
  return moment;
}

MomentCurvature moment_curvature(const MaterialPoints& profile, double weight, double window) {
  check_profile(profile, weight);
  MomentCurvature out;
  out.arc = profile_arc(profile);
  out.moment = profile_moment(profile, weight);
  out.curvature.resize(out.arc.size());
  if (!(window >= 0)) throw Error(fmt::format("cantilever: window {:g} m must be above 0", window));
  if (window == 0) window = default_window(out.arc);
  for (Eigen::Index i = 0; i < out.arc.size(); ++i) {
    const ProfileDerivatives d = local_cubic(profile, out.arc, out.arc[i], window);
    out.curvature[i] = (d.first.y() * d.second.x() - d.first.x() * d.second.y()) /
                       std::pow(d.first.squaredNorm(), 1.5);
  }
  return out;
}

CantileverFit fit_cantilever(const MaterialPoints& profile, double weight, BendTerms terms) {
  check_profile(profile, weight);
  const VecX arc = profile_arc(profile);
  const double length = arc[arc.size() - 1];
  const Vec2 chord = profile.col(profile.cols() - 1) - profile.col(0);
  const double angle = std::clamp(std::atan2(-chord.y(), chord.x()), 0.02, 1.3);
  const double guess = rigidity_of_overhang(weight, length, angle);
  const CantileverResiduals constant(profile, weight, BendTerms::constant, 0);
  CantileverFit first = fit_terms(constant, constant.start(guess, 0));
  if (terms == BendTerms::constant) return first;
  const double largest =
      heavy_elastica(first.law, weight, length, first.root_angle).curvature.maxCoeff();
  const CantileverResiduals problem(profile, weight, terms, largest);
  return fit_terms(problem, problem.start(first.law.bend.values()[0], first.root_angle));
}

}  // namespace weft
