#pragma once
/// Air drag per area (Bhat 2003, section 3): along the normal k_N s |s| / (1 + k_f s^2) with s the
/// normal speed, along the surface k_T times the tangential velocity. Optional, and not of that
/// paper: k_L s along the normal, the drag of cloth that air seeps through, or of simulators that
/// slow vertices down in proportion to their velocity.
#include "weft/strain/lanes.h"

namespace weft::detail {

struct DragLaw {
  double tangential = 0;   ///< k_T, N s/m^3
  double normal = 0;       ///< k_N, N s^2/m^4
  double degradation = 0;  ///< k_f, s^2/m^2
  double linear = 0;       ///< k_L, N s/m^3

  /// Resistance along the normal, N/m^2, with the sign of s.
  template <class T>
  T pressure(const T& s) const {
    return linear * s + normal * s * absolute(s) / (1.0 + degradation * s * s);
  }
  /// Its derivative by s.
  template <class T>
  T pressure_rate(const T& s) const {
    const T denominator = 1.0 + degradation * s * s;
    return linear + (2 * normal) * absolute(s) / (denominator * denominator);
  }
  /// Minus the derivative of the force per area by the velocity, at the normal speed s.
  template <class T>
  SymmetricMatrix3<T> damping(const T& s, const Vector3<T>& normal) const {
    SymmetricMatrix3<T> out = T(pressure_rate(s) - tangential) * outer(normal);
    for (const std::size_t i : {0U, 2U, 5U}) out.m[i] = out.m[i] + tangential;
    return out;
  }
  /// The derivative of the pressure by k_f.
  template <class T>
  T pressure_by_degradation(const T& s) const {
    const T denominator = 1.0 + degradation * s * s;
    return -normal * s * absolute(s) * s * s / (denominator * denominator);
  }
};

/// Unit normal; zero for a triangle without area.
template <class T>
inline Vector3<T> unit_normal(const Vector3<T>& x0, const Vector3<T>& x1, const Vector3<T>& x2) {
  const Vector3<T> n = cross(x1 - x0, x2 - x0);
  const T squared = dot(n, n), zero = broadcast<T>(0), one = broadcast<T>(1);
  return select(squared > zero, one / square_root(squared), zero) * n;
}

}  // namespace weft::detail
