#pragma once
/// Energy of the diagonals of a triangle (diagonal.h), 1/2 area k (C_rising^2 + C_falling^2), and
/// its damping, as a function of (w_u, w_v) like the membrane's.
#include "weft/model/hessian_kind.h"
#include "weft/model/membrane.h"
#include "weft/strain/diagonal.h"

namespace weft::detail {

template <class T>
struct DiagonalStrains {
  Stretch<T> rising, falling;
};

template <class T>
inline DiagonalStrains<T> diagonal_strains(const DeformationGradient<T>& w) {
  return {diagonal_stretch(w, Diagonal::rising), diagonal_stretch(w, Diagonal::falling)};
}

/// Derivative of the energy density by w_u and w_v for tensions (N/m) along the diagonals.
template <class T>
inline MembraneGradient<T> diagonal_gradient(const DiagonalStrains<T>& c, const T& rising,
                                             const T& falling) {
  const T scale = broadcast<T>(0.70710678118654752440);
  const Vector3<T> r = (scale * rising) * c.rising.direction;
  const Vector3<T> f = (scale * falling) * c.falling.direction;
  return {r + f, r - f};
}

/// Second derivative by the vector w of one diagonal: k n n^T + t / |w| (I - n n^T).
template <class T>
inline SymmetricMatrix3<T> diagonal_hessian(const Stretch<T>& c, const T& across,
                                            const T& stiffness) {
  SymmetricMatrix3<T> h = (stiffness - across) * outer(c.direction);
  add_to_diagonal(across, h);
  return h;
}

/// `kind`: the projected one leaves out what resists turning where a tension is negative, which
/// damping alone can make it.
template <class T>
inline MembraneHessian<T> diagonals_hessian(const DiagonalStrains<T>& c, const T& rising,
                                            const T& falling, double stiffness, HessianKind kind) {
  const T zero = broadcast<T>(0), half = broadcast<T>(0.5), k = broadcast<T>(stiffness);
  T across_r = rising * c.rising.inverse_length, across_f = falling * c.falling.inverse_length;
  if (kind == HessianKind::positive_semidefinite) {
    across_r = select(across_r > zero, across_r, zero);
    across_f = select(across_f > zero, across_f, zero);
  }
  const SymmetricMatrix3<T> r = half * diagonal_hessian(c.rising, across_r, k);
  const SymmetricMatrix3<T> f = half * diagonal_hessian(c.falling, across_f, k);
  return {r + f, r + f, (r + broadcast<T>(-1) * f).full()};
}

}  // namespace weft::detail
