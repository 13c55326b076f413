#pragma once
/// A number that carries its first and second derivatives by three variables: energies whose
/// derivatives are long to write out.
#include <cmath>

#include "weft/base/types.h"

namespace weft::detail {

struct SecondOrder {
  double value = 0;
  Vec3 gradient = Vec3::Zero();
  Mat3 hessian = Mat3::Zero();

  /// Variable `index` of the three.
  static SecondOrder variable(double value, int index) {
    return {value, Vec3::Unit(index), Mat3::Zero()};
  }
  static SecondOrder constant(double value) { return {value, Vec3::Zero(), Mat3::Zero()}; }

  friend SecondOrder operator+(const SecondOrder& a, const SecondOrder& b) {
    return {a.value + b.value, a.gradient + b.gradient, a.hessian + b.hessian};
  }
  friend SecondOrder operator-(const SecondOrder& a, const SecondOrder& b) {
    return {a.value - b.value, a.gradient - b.gradient, a.hessian - b.hessian};
  }
  friend SecondOrder operator*(double s, const SecondOrder& a) {
    return {s * a.value, s * a.gradient, s * a.hessian};
  }
  friend SecondOrder operator*(const SecondOrder& a, const SecondOrder& b) {
    const Mat3 cross = a.gradient * b.gradient.transpose();
    return {a.value * b.value, a.value * b.gradient + b.value * a.gradient,
            a.value * b.hessian + b.value * a.hessian + cross + cross.transpose()};
  }
};

/// f(a) from f, f' and f'' at the value of a.
inline SecondOrder lift(const SecondOrder& a, double f, double first, double second) {
  return {f, first * a.gradient, first * a.hessian + second * a.gradient * a.gradient.transpose()};
}
inline SecondOrder inverse(const SecondOrder& a) {
  const double f = 1 / a.value;
  return lift(a, f, -f * f, 2 * f * f * f);
}
/// Of a positive number.
inline SecondOrder root(const SecondOrder& a) {
  const double f = std::sqrt(a.value);
  return lift(a, f, 0.5 / f, -0.25 / (f * a.value));
}

}  // namespace weft::detail
