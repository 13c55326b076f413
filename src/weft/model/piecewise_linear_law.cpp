#include "weft/model/piecewise_linear_law.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "weft/model/second_order.h"

namespace weft::detail {
namespace {

constexpr int kAngles = 5, kRows = kAngles + 1, kEntries = 4;
constexpr double kTableStretch = 1.0 / 6;  // principal stretch - 1 of the rows with an angle
constexpr int kCurvatures = 5;
constexpr double kCurvatureStep = 10;  // 1/m
constexpr double kTiny = 1e-12;

SecondOrder smooth_step(const SecondOrder& t) {
  const double v = t.value;
  return lift(t, v * v * (3 - 2 * v), 6 * v * (1 - v), 6 - 12 * v);
}

/// (2 / e^2) times the integral from 0 to e of t s(t) dt: the share of the stretched rows in the
/// work along a ray; `e` > 0.
SecondOrder stretched_share(const SecondOrder& e) {
  const auto integral = [](double d) {  // of 6 t d with t = d + d^2 / 2 the Green strain
    return d * d * d * (2 + d * (2.25 + 0.6 * d));
  };
  const double v = e.value, length = std::sqrt(1 + 2 * v), d = 2 * v / (1 + length);
  double work, s, slope;
  if (d < kTableStretch) {
    work = integral(d);
    s = d / kTableStretch;
    slope = 1 / (kTableStretch * length);
  } else {
    constexpr double end = kTableStretch + 0.5 * kTableStretch * kTableStretch;
    work = integral(kTableStretch) + 0.5 * (v - end) * (v + end);
    s = 1;
    slope = 0;
  }
  const double share = 2 * work / (v * v), first = 2 * (s - share) / v;
  return lift(e, share, first, 2 * (slope - first) / v - first / v);
}

using Shares = std::array<SecondOrder, kRows>;

/// Weight of each row of the table in psi = 1/2 E . (sum of rows) E; they add up to 1.
Shares row_shares(const Vec3& strain) {
  const auto x = SecondOrder::variable(strain[0], 0), y = SecondOrder::variable(strain[1], 1),
             shear = SecondOrder::variable(strain[2], 2);
  Shares shares;
  shares[0] = SecondOrder::constant(1);
  const SecondOrder difference = x - y, squared = difference * difference + shear * shear;
  const bool directed = squared.value > kTiny * kTiny;
  const SecondOrder spread = directed ? root(squared) : SecondOrder::constant(0);
  const SecondOrder large = 0.5 * (x + y + spread), small = 0.5 * (x + y - spread);
  if (!(large.value > kTiny)) return shares;

  SecondOrder direction = SecondOrder::constant(directed ? 1 : 0), stretch = large;
  if (small.value > 0) {
    if (directed) direction = smooth_step(spread * inverse(large));
    stretch = 0.5 * (x + y + direction * spread);
  }
  SecondOrder stretched = stretched_share(stretch);
  if (-small.value > large.value)
    stretched = stretched * smooth_step(-1 * (large * inverse(small)));
  // cos(2 m phi) by Chebyshev's recursion from cos(2 phi).
  std::array<SecondOrder, kAngles> cosine;
  cosine[0] = SecondOrder::constant(1);
  cosine[1] = directed ? difference * inverse(spread) : SecondOrder::constant(0);
  for (std::size_t m = 2; m < cosine.size(); ++m)
    cosine[m] = 2 * (cosine[1] * cosine[m - 1]) - cosine[m - 2];
  const auto end_weight = [](int i) { return i == 0 || i == kAngles - 1 ? 0.5 : 1.0; };
  for (int j = 0; j < kAngles; ++j) {
    SecondOrder interpolant = SecondOrder::constant(0);
    for (int m = 0; m < kAngles; ++m)
      interpolant = interpolant + 0.5 * end_weight(j) * end_weight(m) *
                                      std::cos(m * j * std::numbers::pi / 4) *
                                      cosine[static_cast<std::size_t>(m)];
    const SecondOrder mean = SecondOrder::constant(0.25 * end_weight(j));
    shares[static_cast<std::size_t>(j + 1)] = stretched * (mean + direction * (interpolant - mean));
  }
  shares[0] = SecondOrder::constant(1) - stretched;
  return shares;
}

using Quadratics = std::array<SecondOrder, kEntries>;

/// What the four entries of a row multiply in the energy.
Quadratics quadratics(const Vec3& strain) {
  const auto x = SecondOrder::variable(strain[0], 0), y = SecondOrder::variable(strain[1], 1),
             shear = SecondOrder::variable(strain[2], 2);
  return {0.5 * (x * x), x * y, 0.5 * (y * y), 0.25 * (shear * shear)};
}

SheetResponse response(const SecondOrder& energy) {
  return {energy.value, energy.gradient, energy.hessian};
}

class PiecewiseLinearMembrane final : public SheetLaw {
 public:
  int parameter_count() const override { return kRows * kEntries; }
  void set_parameters(const Eigen::Ref<const VecX>& values) override { table_ = values; }

  SheetResponse respond(const Vec3& strain) const override {
    const Shares shares = row_shares(strain);
    const Quadratics parts = quadratics(strain);
    SecondOrder energy;
    for (int k = 0; k < kEntries; ++k) {
      SecondOrder entry;
      for (int row = 0; row < kRows; ++row)
        entry = entry + std::max(0.0, table_[kEntries * row + k]) * share(shares, row);
      energy = energy + entry * parts[static_cast<std::size_t>(k)];
    }
    return response(energy);
  }

  void stress_derivative(const Vec3& strain, Eigen::Ref<Eigen::Matrix3Xd> d) const override {
    const Shares shares = row_shares(strain);
    const Quadratics parts = quadratics(strain);
    for (int row = 0; row < kRows; ++row)
      for (int k = 0; k < kEntries; ++k) {
        const SecondOrder& part = parts[static_cast<std::size_t>(k)];
        const int column = kEntries * row + k;
        if (table_[column] > 0)
          d.col(column) =
              share(shares, row).value * part.gradient + part.value * share(shares, row).gradient;
        else
          d.col(column).setZero();
      }
  }

 private:
  static const SecondOrder& share(const Shares& shares, int row) {
    return shares[static_cast<std::size_t>(row)];
  }

  Eigen::Matrix<double, kRows * kEntries, 1> table_;
};

/// Hat functions of the five curvatures and (2 / r^2) times the integral of each times the
/// curvature from 0 to r, with derivatives by r.
struct Hats {
  std::array<double, kCurvatures> share{}, first{}, second{};
};

Hats hats(double r) {
  Hats out;
  if (!(r > kTiny)) {
    out.share[0] = 1;
    return out;
  }
  for (int i = 0; i < kCurvatures; ++i) {
    // Between knots the hat is a + b t; the integral of (a + b t) t.
    double work = 0, value = 0, slope = 0;
    const auto piece = [&](double from, double to, double a, double b) {
      if (r <= from) return;
      const double end = std::min(r, to);
      work += 0.5 * a * (end * end - from * from) + b / 3 * (end * end * end - from * from * from);
      if (r <= to) {
        value = a + b * r;
        slope = b;
      }
    };
    constexpr double h = kCurvatureStep;
    if (i > 0) piece((i - 1) * h, i * h, 1 - i, 1 / h);
    if (i + 1 < kCurvatures)
      piece(i * h, (i + 1) * h, 1 + i, -1 / h);
    else
      piece(i * h, std::numeric_limits<double>::max(), 1, 0);
    const auto at = static_cast<std::size_t>(i);
    out.share[at] = 2 * work / (r * r);
    out.first[at] = 2 * (value - out.share[at]) / r;
    out.second[at] = 2 * (slope - out.first[at]) / r - out.first[at] / r;
  }
  return out;
}

class PiecewiseLinearBending final : public SheetLaw {
 public:
  int parameter_count() const override { return 3 * kCurvatures; }

  void set_parameters(const Eigen::Ref<const VecX>& values) override {
    for (int i = 0; i < kCurvatures; ++i) {
      const double along = values[i], diagonal = values[kCurvatures + i],
                   across = values[2 * kCurvatures + i];
      const double twist = 2 * diagonal - 0.5 * (along + across);  // 2 D_t
      stiffness_.col(i) = Vec3(along, across, std::max(0.0, twist));
      twists_[static_cast<std::size_t>(i)] = twist > 0;
    }
  }

  SheetResponse respond(const Vec3& curvature) const override {
    const SecondOrder r = magnitude(curvature);
    const Hats h = hats(r.value);
    SecondOrder energy;
    for (int k = 0; k < 3; ++k) {
      double share = 0, first = 0, second = 0;
      for (int i = 0; i < kCurvatures; ++i) {
        const auto at = static_cast<std::size_t>(i);
        share += stiffness_(k, i) * h.share[at];
        first += stiffness_(k, i) * h.first[at];
        second += stiffness_(k, i) * h.second[at];
      }
      const SecondOrder c = SecondOrder::variable(curvature[k], k);
      energy = energy + lift(r, share, first, second) * (0.5 * (c * c));
    }
    return response(energy);
  }

  void stress_derivative(const Vec3& curvature, Eigen::Ref<Eigen::Matrix3Xd> d) const override {
    const SecondOrder r = magnitude(curvature);
    const Hats h = hats(r.value);
    for (int i = 0; i < kCurvatures; ++i) {
      const auto at = static_cast<std::size_t>(i);
      Mat3 by;  // by the three entries of stiffness_
      for (int k = 0; k < 3; ++k)
        by.col(k) = 0.5 * curvature[k] * curvature[k] * h.first[at] * r.gradient +
                    h.share[at] * curvature[k] * Vec3::Unit(k);
      const Vec3 twist = twists_[at] ? Vec3(by.col(2)) : Vec3(Vec3::Zero());
      d.col(i) = by.col(0) - 0.5 * twist;
      d.col(kCurvatures + i) = 2 * twist;
      d.col(2 * kCurvatures + i) = by.col(1) - 0.5 * twist;
    }
  }

 private:
  /// |K|; without derivatives where it is zero, which all that it multiplies is too.
  static SecondOrder magnitude(const Vec3& curvature) {
    SecondOrder squared;
    for (int k = 0; k < 3; ++k) {
      const SecondOrder c = SecondOrder::variable(curvature[k], k);
      squared = squared + c * c;
    }
    return squared.value > kTiny * kTiny ? root(squared) : SecondOrder::constant(0);
  }

  Eigen::Matrix<double, 3, kCurvatures> stiffness_;  ///< D_u, D_v, 2 D_t
  std::array<bool, kCurvatures> twists_{};
};

}  // namespace

std::unique_ptr<SheetLaw> make_piecewise_linear_membrane() {
  return std::make_unique<PiecewiseLinearMembrane>();
}

std::unique_ptr<SheetLaw> make_piecewise_linear_bending() {
  return std::make_unique<PiecewiseLinearBending>();
}

}  // namespace weft::detail
