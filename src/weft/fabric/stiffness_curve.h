#pragma once
#include "weft/base/types.h"

namespace weft {

/// Stiffness as a function of strain: a cubic Hermite spline through non-negative control values on
/// strain knots (Miguel 2012, section 4.2), constant beyond the first and the last knot.
///
/// Stress is sigma(c) = k(c) c, energy density psi(c) = integral from 0 to c of k(s) s ds.
///
/// Slopes: at an inner knot that of the parabola through it and its neighbours, at the ends that of
/// the parabola through the three last knots; two knots give a straight line. Where such a slope
/// would let the spline fall below zero between two non-negative values it is limited: k >= 0
/// between knots of the distance h if the slopes there are within -3 k / h (to the right) and 3 k /
/// h (to the left). k is continuous, its derivative too but at the two ends; it is homogeneous in
/// the control values, k = sum over j of (dk / dk_j) k_j, and linear in them where no slope is
/// limited.
class StiffnessCurve {
 public:
  /// One knot: a constant, whatever the knot. Throws Error unless there are as many values as
  /// knots, at least one and at most kMostKnots; knots are finite and strictly increasing; values
  /// are finite and >= 0.
  StiffnessCurve(const VecX& knots, const VecX& values);
  explicit StiffnessCurve(double constant);

  static constexpr int kMostKnots = 8;

  int size() const { return static_cast<int>(knots_.size()); }
  const VecX& knots() const { return knots_; }
  const VecX& values() const { return values_; }
  /// Throws Error as the constructor.
  void set_values(const Eigen::Ref<const VecX>& values);

  /// k, and d k / d strain (0 beyond the ends).
  double stiffness(double strain) const;
  double slope(double strain) const;
  /// All of a strain at once.
  struct Response {
    double energy;   ///< psi
    double stress;   ///< k c
    double tangent;  ///< d stress / d strain
  };
  Response respond(double strain) const;

  /// d k / d values at a strain, and d psi / d values: one entry a knot.
  void stiffness_by_values(double strain, Eigen::Ref<VecX> derivative) const;
  void energy_by_values(double strain, Eigen::Ref<VecX> derivative) const;

  /// The curve on other knots, through this curve's values there. Where all knots of this curve are
  /// among the new ones it changes only as far as the slopes do: not at all for a straight line or
  /// a constant.
  StiffnessCurve resampled(const VecX& knots) const;

 private:
  /// The segment of a strain between the ends.
  Eigen::Index segment(double strain) const;

  VecX knots_, values_;
  Eigen::MatrixX4d basis_;  ///< of segment i, rows i n to i n + n - 1: coefficients of (c - s_i)^p
  Eigen::Matrix4Xd coefficients_;  ///< a column a segment: the same, times the values
  MatX integrals_;  ///< column i: d/d values of the integral from 0 to knot i of k(s) s ds
  VecX energies_;   ///< psi at the knots
};

}  // namespace weft
