#pragma once
/// Dual numbers, a + b e with e e = 0: automatic differentiation as a judge of derivatives that
/// were worked out by hand. A function computed with them yields its value and its derivative along
/// one direction, exact but for rounding; nested, Dual<Dual<T>> yields second derivatives. The base
/// type is long double (64 bits of mantissa where the machine has them), so that the judge's own
/// rounding does not show.
#include <cmath>
#include <vector>

#include "weft/base/types.h"

namespace weft::testing {

template <class T>
struct Dual {
  T value{};
  T slope{};

  Dual() = default;
  Dual(double constant) : value(constant) {}  // NOLINT: formulas mix constants and variables
  Dual(const T& v, const T& s) : value(v), slope(s) {}

  friend Dual operator+(const Dual& a, const Dual& b) {
    return {a.value + b.value, a.slope + b.slope};
  }
  friend Dual operator-(const Dual& a, const Dual& b) {
    return {a.value - b.value, a.slope - b.slope};
  }
  friend Dual operator-(const Dual& a) { return {-a.value, -a.slope}; }
  friend Dual operator*(const Dual& a, const Dual& b) {
    return {a.value * b.value, a.slope * b.value + a.value * b.slope};
  }
  friend Dual operator/(const Dual& a, const Dual& b) {
    const T quotient = a.value / b.value;
    return {quotient, (a.slope - quotient * b.slope) / b.value};
  }
  friend Dual sqrt(const Dual& a) {
    using std::sqrt;
    const T root = sqrt(a.value);
    return {root, a.slope / (root + root)};
  }
  friend Dual abs(const Dual& a) { return plain(a) < 0 ? -a : a; }
  friend Dual atan2(const Dual& y, const Dual& x) {
    using std::atan2;
    return {atan2(y.value, x.value),
            (x.value * y.slope - y.value * x.slope) / (x.value * x.value + y.value * y.value)};
  }
  friend long double plain(const Dual& a) {
    if constexpr (requires { plain(a.value); })
      return plain(a.value);
    else
      return a.value;
  }
};

using Dual1 = Dual<long double>;
using Dual2 = Dual<Dual1>;

/// A vector in space over such numbers.
template <class T>
struct DualVector {
  T x, y, z;
  friend DualVector operator+(const DualVector& a, const DualVector& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend DualVector operator-(const DualVector& a, const DualVector& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend DualVector operator*(const T& s, const DualVector& a) {
    return {s * a.x, s * a.y, s * a.z};
  }
};
template <class T>
T dot(const DualVector<T>& a, const DualVector<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
DualVector<T> cross(const DualVector<T>& a, const DualVector<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
T length(const DualVector<T>& a) {
  return sqrt(dot(a, a));
}
/// Point i of a flat list of coordinates.
template <class T>
DualVector<T> point_of(const std::vector<T>& x, std::size_t i) {
  return {x[3 * i], x[3 * i + 1], x[3 * i + 2]};
}

struct ScalarDerivatives {
  double value = 0;
  VecX gradient;
  MatX hessian;
};

/// `f` maps std::vector<T> to T for any T above; twice differentiable at x.
template <class F>
ScalarDerivatives differentiate(const F& f, const VecX& x) {
  const Eigen::Index n = x.size();
  ScalarDerivatives out{0, VecX(n), MatX(n, n)};
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j <= i; ++j) {
      std::vector<Dual2> at;
      for (Eigen::Index k = 0; k < n; ++k)
        at.push_back({Dual1(static_cast<long double>(x[k]), k == i ? 1.0L : 0.0L),
                      Dual1(k == j ? 1.0L : 0.0L, 0.0L)});
      const Dual2 y = f(at);
      out.value = static_cast<double>(y.value.value);
      out.gradient[i] = static_cast<double>(y.value.slope);
      out.hessian(i, j) = out.hessian(j, i) = static_cast<double>(y.slope.slope);
    }
  return out;
}

/// Jacobian of `f`, which maps std::vector<T> to std::vector<T>.
template <class F>
MatX dual_jacobian(const F& f, const VecX& x) {
  MatX out;
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    std::vector<Dual1> at;
    for (Eigen::Index k = 0; k < x.size(); ++k)
      at.push_back({static_cast<long double>(x[k]), k == j ? 1.0L : 0.0L});
    const std::vector<Dual1> y = f(at);
    if (j == 0) out.resize(static_cast<Eigen::Index>(y.size()), x.size());
    for (std::size_t i = 0; i < y.size(); ++i)
      out(static_cast<Eigen::Index>(i), j) = static_cast<double>(y[i].slope);
  }
  return out;
}

}  // namespace weft::testing
