#pragma once
/// Elongation along a diagonal of the threads, in tension only:
///
///     C = max(0, |w| - 1),   w = (w_u +- w_v) / sqrt 2,
///
/// with gradient n = w / |w| and Hessian (I - n n^T) / |w| by w where the diagonal is longer than
/// at rest, and none where it is not: a slack diagonal has no force. The energy 1/2 k C^2 has a
/// continuous gradient. C is the relative elongation of a line at 45 degrees to the threads.
///
/// Two families of such diagonals with stiffness k resist shear by the angle g with k g / 4 (only
/// one of them is taut), and couple weft and warp: where both are under tension they add k / 2 to
/// the stiffness along a thread, k / 2 between weft and warp, and k / 2 to that against shear.
#include "weft/strain/stretch.h"

namespace weft {

/// As stretch(); all is zero where the diagonal is slack, so that whatever is built from it
/// vanishes there.
template <class T>
inline Stretch<T> diagonal_stretch(const Vector3<T>& w) {
  const Stretch<T> s = stretch(w);
  const T zero = broadcast<T>(0);
  const auto taut = s.value > zero;
  return {select(taut, s.value, zero), select(taut, s.direction, Vector3<T>{zero, zero, zero}),
          select(taut, s.inverse_length, zero)};
}

}  // namespace weft
