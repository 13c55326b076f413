#pragma once
/// Several doubles that are worked on at once, and small vectors of them. The strain measures are
/// templates over the scalar type `T`: `double` for one element, `Lanes` for kLanes elements.
#include <array>
#include <cmath>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "weft/base/types.h"

namespace weft {

#if defined(__AVX512F__)
inline constexpr int kLanes = 8;
#elif defined(__AVX__)
inline constexpr int kLanes = 4;
#else
inline constexpr int kLanes = 2;
#endif

/// kLanes doubles; arithmetic and comparison act on each.
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));
using LaneMask = decltype(Lanes{} < Lanes{});

/// `value` in each lane; the identity for double.
template <class T>
inline T broadcast(double value) {
  return T{} + value;
}

/// a where `condition` holds, b elsewhere.
inline double select(bool condition, double a, double b) { return condition ? a : b; }
inline Lanes select(LaneMask condition, Lanes a, Lanes b) { return condition ? a : b; }

/// Where both hold.
inline bool both(bool a, bool b) { return a && b; }
inline LaneMask both(LaneMask a, LaneMask b) { return a & b; }

inline double square_root(double a) { return std::sqrt(a); }
inline Lanes square_root(Lanes a) {
#if defined(__AVX512F__)
  return _mm512_maskz_sqrt_pd(0xff, a);  // the unmasked one warns in GCC 12
#elif defined(__AVX__)
  return _mm256_sqrt_pd(a);
#elif defined(__x86_64__)
  return _mm_sqrt_pd(a);
#else
  for (int i = 0; i < kLanes; ++i) a[i] = std::sqrt(a[i]);
  return a;
#endif
}

template <class T>
inline T absolute(T a) {
  return select(a < broadcast<T>(0), -a, a);
}

inline double sum_lanes(double a) { return a; }
inline double sum_lanes(Lanes a) {
  double sum = 0;
  for (int i = 0; i < kLanes; ++i) sum += a[i];
  return sum;
}

/// A vector in space whose coordinates are of type T.
template <class T>
struct Vector3 {
  T x, y, z;

  Vector3 operator+(const Vector3& o) const { return {x + o.x, y + o.y, z + o.z}; }
  Vector3 operator-(const Vector3& o) const { return {x - o.x, y - o.y, z - o.z}; }
  Vector3 operator-() const { return {-x, -y, -z}; }
  friend Vector3 operator*(const T& s, const Vector3& a) { return {s * a.x, s * a.y, s * a.z}; }
};

template <class T>
inline T dot(const Vector3<T>& a, const Vector3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class T>
inline Vector3<T> cross(const Vector3<T>& a, const Vector3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class T>
inline Vector3<T> select(decltype(T{} < T{}) condition, const Vector3<T>& a, const Vector3<T>& b) {
  return {select(condition, a.x, b.x), select(condition, a.y, b.y), select(condition, a.z, b.z)};
}

inline Vector3<double> to_vector3(const Vec3& a) { return {a.x(), a.y(), a.z()}; }
inline Vec3 to_eigen(const Vector3<double>& a) { return {a.x, a.y, a.z}; }

/// A 3 x 3 matrix by rows: entry (r, c) is m[3 r + c].
template <class T>
struct Matrix3 {
  std::array<T, 9> m;
};

/// A symmetric 3 x 3 matrix: xx, yx, yy, zx, zy, zz.
template <class T>
struct SymmetricMatrix3 {
  std::array<T, 6> m;

  SymmetricMatrix3 operator+(const SymmetricMatrix3& o) const {
    return {
        {m[0] + o.m[0], m[1] + o.m[1], m[2] + o.m[2], m[3] + o.m[3], m[4] + o.m[4], m[5] + o.m[5]}};
  }
  friend SymmetricMatrix3 operator*(const T& s, const SymmetricMatrix3& a) {
    return {{s * a.m[0], s * a.m[1], s * a.m[2], s * a.m[3], s * a.m[4], s * a.m[5]}};
  }
  /// The entries by rows.
  Matrix3<T> full() const { return {{m[0], m[1], m[3], m[1], m[2], m[4], m[3], m[4], m[5]}}; }
};

/// a b^T.
template <class T>
inline Matrix3<T> outer(const Vector3<T>& a, const Vector3<T>& b) {
  return {{a.x * b.x, a.x * b.y, a.x * b.z, a.y * b.x, a.y * b.y, a.y * b.z, a.z * b.x, a.z * b.y,
           a.z * b.z}};
}

/// a a^T.
template <class T>
inline SymmetricMatrix3<T> outer(const Vector3<T>& a) {
  return {{a.x * a.x, a.y * a.x, a.y * a.y, a.z * a.x, a.z * a.y, a.z * a.z}};
}

/// a b^T + b a^T.
template <class T>
inline SymmetricMatrix3<T> symmetric_outer(const Vector3<T>& a, const Vector3<T>& b) {
  const T xx = a.x * b.x, yy = a.y * b.y, zz = a.z * b.z;
  return {{xx + xx, a.y * b.x + a.x * b.y, yy + yy, a.z * b.x + a.x * b.z, a.z * b.y + a.y * b.z,
           zz + zz}};
}

template <class T>
inline Mat3 to_eigen(const Matrix3<T>& a) {
  Mat3 out;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) out(r, c) = a.m[static_cast<std::size_t>(3 * r + c)];
  return out;
}

}  // namespace weft
