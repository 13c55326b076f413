#pragma once
/// Vectors of the machine's width, and the dense kernels of SparseCholesky, for fronts of 30 to 200
/// rows: at these sizes Eigen's general kernels spend more on packing and on calls than on
/// arithmetic.
///
/// Matrices are column-major with leading dimension `ld`. Rows are worked on kTileRows at a time,
/// and the last tile may reach past the last row: every column, and the end of the storage, has
/// kTileRows - 1 spare entries, zero at the start and left zero.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "weft/base/types.h"

namespace weft::dense {

#if defined(__AVX512F__)
inline constexpr int kVectorBytes = 64;
#elif defined(__AVX__)
inline constexpr int kVectorBytes = 32;
#else
inline constexpr int kVectorBytes = 16;
#endif

template <class Scalar>
struct VectorOf {
  typedef Scalar type __attribute__((vector_size(kVectorBytes)));
};
template <class Scalar>
using Vector = typename VectorOf<Scalar>::type;

template <class Scalar>
inline constexpr int kWidth = kVectorBytes / static_cast<int>(sizeof(Scalar));
/// Vectors a tile is high: enough independent sums to keep the multipliers busy, few enough to stay
/// in registers, and not so high that much of the last tile is spare.
template <class Scalar>
inline constexpr int kTileVectors = kWidth<Scalar> >= 16 ? 1 : 2;
template <class Scalar>
inline constexpr int kTileRows = kWidth<Scalar>* kTileVectors<Scalar>;

template <class Scalar>
inline Vector<Scalar> load(const Scalar* from) {
  Vector<Scalar> v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
template <class Scalar>
inline void store(Scalar* to, const Vector<Scalar>& v) {
  std::memcpy(to, &v, sizeof v);
}

/// load_first: the first `count` lanes from memory, 1 to kWidth of them, zero in the others;
/// store_first: these to memory.
#if defined(__AVX512F__)
inline unsigned first_lanes(int count) { return (1U << count) - 1U; }
inline Vector<double> load_first(const double* from, int count) {
  return _mm512_maskz_loadu_pd(static_cast<__mmask8>(first_lanes(count)), from);
}
inline Vector<float> load_first(const float* from, int count) {
  return _mm512_maskz_loadu_ps(static_cast<__mmask16>(first_lanes(count)), from);
}
inline void store_first(double* to, int count, const Vector<double>& v) {
  _mm512_mask_storeu_pd(to, static_cast<__mmask8>(first_lanes(count)), v);
}
inline void store_first(float* to, int count, const Vector<float>& v) {
  _mm512_mask_storeu_ps(to, static_cast<__mmask16>(first_lanes(count)), v);
}
#elif defined(__AVX__)
inline __m256i first_lanes(int count) {
  static constexpr long long kMasks[8] = {-1, -1, -1, -1, 0, 0, 0, 0};
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kMasks + 4 - count));
}
inline Vector<double> load_first(const double* from, int count) {
  return _mm256_maskload_pd(from, first_lanes(count));
}
inline void store_first(double* to, int count, const Vector<double>& v) {
  _mm256_maskstore_pd(to, first_lanes(count), v);
}
#else
inline Vector<double> load_first(const double* from, int count) {
  return count > 1 ? Vector<double>{from[0], from[1]} : Vector<double>{from[0], 0};
}
inline void store_first(double* to, int count, const Vector<double>& v) {
  for (int i = 0; i < count; ++i) to[i] = v[i];
}
#endif

/// a * b + c, fused where the machine can (the build never fuses by itself).
inline Vector<double> multiply_add(Vector<double> a, Vector<double> b, Vector<double> c) {
#if defined(__AVX512F__)
  return _mm512_fmadd_pd(a, b, c);
#elif defined(__FMA__)
  return _mm256_fmadd_pd(a, b, c);
#else
  return a * b + c;
#endif
}
inline Vector<float> multiply_add(Vector<float> a, Vector<float> b, Vector<float> c) {
#if defined(__AVX512F__)
  return _mm512_fmadd_ps(a, b, c);
#elif defined(__FMA__)
  return _mm256_fmadd_ps(a, b, c);
#else
  return a * b + c;
#endif
}

/// c - a * b, the same way.
inline Vector<double> subtract_product(Vector<double> a, Vector<double> b, Vector<double> c) {
#if defined(__AVX512F__)
  return _mm512_fnmadd_pd(a, b, c);
#elif defined(__FMA__)
  return _mm256_fnmadd_pd(a, b, c);
#else
  return c - a * b;
#endif
}
inline Vector<float> subtract_product(Vector<float> a, Vector<float> b, Vector<float> c) {
#if defined(__AVX512F__)
  return _mm512_fnmadd_ps(a, b, c);
#elif defined(__FMA__)
  return _mm256_fnmadd_ps(a, b, c);
#else
  return c - a * b;
#endif
}

/// A vector of `value`. (Added to zero instead, it would cost an addition: -0 + 0 is not -0.)
template <class Scalar>
inline Vector<Scalar> broadcast(Scalar value) {
  return value - Vector<Scalar>{};
}

/// The sum of the lanes, by halves.
template <class Scalar>
inline Scalar sum(const Vector<Scalar>& v) {
  Scalar lanes[kWidth<Scalar>];
  store(lanes, v);
#pragma GCC unroll 4
  for (int half = kWidth<Scalar> / 2; half > 0; half /= 2)
#pragma GCC unroll 8
    for (int i = 0; i < half; ++i) lanes[i] += lanes[i + half];
  return lanes[0];
}
#if defined(__AVX512F__)
template <>
inline float sum<float>(const Vector<float>& v) {
  return _mm512_reduce_add_ps(v);
}
template <>
inline double sum<double>(const Vector<double>& v) {
  return _mm512_reduce_add_pd(v);
}
#endif

/// to[i] += from[i].
template <class Scalar>
inline void add(const Scalar* from, int count, Scalar* to) {
#if defined(__AVX512F__)
  for (int i = 0; i < count; i += kWidth<Scalar>) {
    const int lanes = std::min(count - i, kWidth<Scalar>);
    store_first(to + i, lanes, load_first(to + i, lanes) + load_first(from + i, lanes));
  }
#else
  for (int i = 0; i < count; ++i) to[i] += from[i];
#endif
}

/// a b^T for one tile of rows and kColumns columns; a has `depth` columns, and row j of b is that
/// of column j of c. To `write(at, product)` vector by vector, `at` its place in c.
template <class Scalar, int kColumns, class Write>
inline void product_tile(const Scalar* a, const Scalar* b, int depth, std::ptrdiff_t ld, Scalar* c,
                         std::ptrdiff_t ldc, const Write& write) {
  constexpr int kVectors = kTileVectors<Scalar>;
  Vector<Scalar> total[kColumns][kVectors] = {};
  for (int k = 0; k < depth; ++k) {
    Vector<Scalar> left[kVectors];
    for (int v = 0; v < kVectors; ++v) left[v] = load(a + k * ld + v * kWidth<Scalar>);
    for (int j = 0; j < kColumns; ++j) {
      const Vector<Scalar> right = broadcast(b[k * ld + j]);
      for (int v = 0; v < kVectors; ++v) total[j][v] = multiply_add(left[v], right, total[j][v]);
    }
  }
  for (int j = 0; j < kColumns; ++j)
    for (int v = 0; v < kVectors; ++v) write(c + j * ldc + v * kWidth<Scalar>, total[j][v]);
}

/// Rows from `row` to `rows` of kColumns columns, as above.
template <class Scalar, int kColumns, class Write>
inline void product_rows(const Scalar* a, const Scalar* b, int depth, std::ptrdiff_t ld, Scalar* c,
                         std::ptrdiff_t ldc, int row, int rows, const Write& write) {
  for (; row < rows; row += kTileRows<Scalar>) {
    product_tile<Scalar, kColumns>(a + row, b, depth, ld, c + row, ldc, write);
  }
}

/// Cholesky factor of a kColumns x kColumns block on the diagonal, in place, lower triangle. False
/// if a pivot is not positive.
template <class Scalar, int kColumns>
inline bool factorize_block(Scalar* block, std::ptrdiff_t ld, Scalar* inverse_diagonal) {
  Scalar l[kColumns][kColumns];  // in registers: reading back what was just stored costs time
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j)
#pragma GCC unroll 8
    for (int i = j; i < kColumns; ++i) l[j][i] = block[j * ld + i];
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j) {
    if (!(l[j][j] > 0) || !std::isfinite(l[j][j])) return false;
    l[j][j] = std::sqrt(l[j][j]);
    const Scalar inverse = 1 / l[j][j];
    inverse_diagonal[j] = inverse;
#pragma GCC unroll 8
    for (int i = j + 1; i < kColumns; ++i) l[j][i] *= inverse;
#pragma GCC unroll 8
    for (int k = j + 1; k < kColumns; ++k)
#pragma GCC unroll 8
      for (int i = k; i < kColumns; ++i) l[k][i] -= l[j][i] * l[j][k];
  }
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j)
#pragma GCC unroll 8
    for (int i = j; i < kColumns; ++i) block[j * ld + i] = l[j][i];
  return true;
}

/// Columns `first` to first + kColumns of the panel's factor; those before are done. False if a
/// pivot is not positive.
template <class Scalar, int kColumns>
inline bool factorize_columns(Scalar* panel, std::ptrdiff_t ld, int rows, int first,
                              Scalar* inverse_diagonal) {
  product_rows<Scalar, kColumns>(
      panel, panel + first, first, ld, panel + first * ld, ld, first, rows,
      [](Scalar* at, const Vector<Scalar>& product) { store<Scalar>(at, load(at) - product); });
  Scalar* block = panel + first * ld;  // its columns
  if (!factorize_block<Scalar, kColumns>(block + first, ld, inverse_diagonal + first)) return false;
  for (int row = first + kColumns; row < rows; row += kWidth<Scalar>) {
    Vector<Scalar> x[kColumns];
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) {
      x[j] = load(block + j * ld + row);
#pragma GCC unroll 8
      for (int k = 0; k < j; ++k)
        x[j] = subtract_product(x[k], broadcast(block[k * ld + first + j]), x[j]);
      x[j] *= inverse_diagonal[first + j];
      store<Scalar>(block + j * ld + row, x[j]);
    }
  }
  return true;
}

/// Cholesky factor of the first `pivots` columns (a multiple of 3) of a symmetric matrix of `rows`
/// rows, lower triangle, in place.
template <class Scalar>
bool factorize_panel(Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                     Scalar* inverse_diagonal) {
  int first = 0;
  for (; first + 6 <= pivots; first += 6) {
    if (!factorize_columns<Scalar, 6>(panel, ld, rows, first, inverse_diagonal)) return false;
  }
  return first == pivots || factorize_columns<Scalar, 3>(panel, ld, rows, first, inverse_diagonal);
}

/// Lower triangle of c (size x size, a multiple of 3) becomes - a a^T, a with `depth` columns.
/// Writes up to five rows above the diagonal, too.
template <class Scalar>
void negative_square(const Scalar* a, int depth, std::ptrdiff_t ld, Scalar* c, std::ptrdiff_t ldc,
                     int size) {
  const auto write = [](Scalar* at, const Vector<Scalar>& product) { store<Scalar>(at, -product); };
  int j = 0;
  for (; j + 6 <= size; j += 6) {
    product_rows<Scalar, 6>(a, a + j, depth, ld, c + j * ldc, ldc, j, size, write);
  }
  if (j < size) product_rows<Scalar, 3>(a, a + j, depth, ld, c + j * ldc, ldc, j, size, write);
}

/// solve_forward for the pivots q to q + kColumns.
template <class Scalar, int kColumns>
inline void solve_forward_at(int q, const Scalar* panel, std::ptrdiff_t ld, int rows,
                             const Scalar* inverse_diagonal, Scalar* x) {
  const Scalar* l = panel + q * ld;
  Scalar pivot[kColumns];
  Vector<Scalar> pivots[kColumns];
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j) pivot[j] = x[q + j];
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j) {
    pivot[j] *= inverse_diagonal[q + j];
#pragma GCC unroll 8
    for (int i = j + 1; i < kColumns; ++i) pivot[i] -= l[j * ld + q + i] * pivot[j];
    x[q + j] = pivot[j];
    pivots[j] = broadcast(pivot[j]);
  }
  for (int i = q + kColumns; i < rows; i += kWidth<Scalar>) {
    Vector<Scalar> v = load(x + i);
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) v = subtract_product(load(l + j * ld + i), pivots[j], v);
    store<Scalar>(x + i, v);
  }
}

/// solve_backward for the pivots q to q + kColumns.
template <class Scalar, int kColumns>
inline void solve_backward_at(int q, const Scalar* panel, std::ptrdiff_t ld, int rows,
                              const Scalar* inverse_diagonal, Scalar* x) {
  const Scalar* l = panel + q * ld;
  Vector<Scalar> sums[kColumns] = {};
  for (int i = q + kColumns; i < rows; i += kWidth<Scalar>) {
    const Vector<Scalar> v = load(x + i);
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) sums[j] = multiply_add(load(l + j * ld + i), v, sums[j]);
  }
  Scalar pivot[kColumns];
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j) pivot[j] = x[q + j] - sum<Scalar>(sums[j]);
#pragma GCC unroll 8
  for (int j = kColumns - 1; j >= 0; --j) {
    pivot[j] *= inverse_diagonal[q + j];
    x[q + j] = pivot[j];
#pragma GCC unroll 8
    for (int i = 0; i < j; ++i) pivot[i] -= l[i * ld + q + j] * pivot[j];
  }
}

/// x <- L^-1 x for the pivots, and what they leave for the rows below, with x of `rows` entries.
template <class Scalar>
void solve_forward(const Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                   const Scalar* inverse_diagonal, Scalar* x) {
  int q = 0;
  for (; q + 6 <= pivots; q += 6)
    solve_forward_at<Scalar, 6>(q, panel, ld, rows, inverse_diagonal, x);
  if (q < pivots) solve_forward_at<Scalar, 3>(q, panel, ld, rows, inverse_diagonal, x);
}

/// x <- L^-T x for the pivots, given those of the rows below. The spare entries of x must be
/// finite.
template <class Scalar>
void solve_backward(const Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                    const Scalar* inverse_diagonal, Scalar* x) {
  int q = pivots;
  if (q % 6 != 0) {
    q -= 3;
    solve_backward_at<Scalar, 3>(q, panel, ld, rows, inverse_diagonal, x);
  }
  for (q -= 6; q >= 0; q -= 6)
    solve_backward_at<Scalar, 6>(q, panel, ld, rows, inverse_diagonal, x);
}

/// Several right-hand sides side by side: x has kDirections numbers a row. A group of them is
/// worked on at once, as many vectors as stay in registers for six pivots.
template <class Scalar>
inline constexpr int kGroupVectors = kDirections > kWidth<Scalar> ? 2 : 1;
template <class Scalar>
inline constexpr int kGroup = kGroupVectors<Scalar>* kWidth<Scalar>;
static_assert(kDirections % kGroup<float> == 0 && kDirections % kGroup<double> == 0);

/// solve_forward_rows for the pivots q to q + kColumns; x begins with the group's first column.
template <class Scalar, int kColumns>
inline void solve_forward_rows_at(int q, const Scalar* panel, std::ptrdiff_t ld, int rows,
                                  const Scalar* inverse_diagonal, Scalar* x) {
  constexpr int kVectors = kGroupVectors<Scalar>, kW = kWidth<Scalar>;
  const Scalar* l = panel + q * ld;
  Vector<Scalar> pivot[kColumns][kVectors];
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j) {
    Scalar* at = x + std::ptrdiff_t{kDirections} * (q + j);
    for (int v = 0; v < kVectors; ++v) pivot[j][v] = load(at + v * kW);
#pragma GCC unroll 8
    for (int k = 0; k < j; ++k) {
      const Vector<Scalar> factor = broadcast(l[k * ld + q + j]);
      for (int v = 0; v < kVectors; ++v)
        pivot[j][v] = subtract_product(factor, pivot[k][v], pivot[j][v]);
    }
    for (int v = 0; v < kVectors; ++v) {
      pivot[j][v] *= inverse_diagonal[q + j];
      store<Scalar>(at + v * kW, pivot[j][v]);
    }
  }
  for (int i = q + kColumns; i < rows; ++i) {
    Scalar* at = x + std::ptrdiff_t{kDirections} * i;
    Vector<Scalar> row[kVectors];
    for (int v = 0; v < kVectors; ++v) row[v] = load(at + v * kW);
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) {
      const Vector<Scalar> factor = broadcast(l[j * ld + i]);
      for (int v = 0; v < kVectors; ++v) row[v] = subtract_product(factor, pivot[j][v], row[v]);
    }
    for (int v = 0; v < kVectors; ++v) store<Scalar>(at + v * kW, row[v]);
  }
}

/// solve_backward_rows for the pivots q to q + kColumns; x begins with the group's first column.
template <class Scalar, int kColumns>
inline void solve_backward_rows_at(int q, const Scalar* panel, std::ptrdiff_t ld, int rows,
                                   const Scalar* inverse_diagonal, Scalar* x) {
  constexpr int kVectors = kGroupVectors<Scalar>, kW = kWidth<Scalar>;
  const Scalar* l = panel + q * ld;
  Scalar* const first = x + std::ptrdiff_t{kDirections} * q;
  Vector<Scalar> pivot[kColumns][kVectors];
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j)
    for (int v = 0; v < kVectors; ++v) pivot[j][v] = load(first + j * kDirections + v * kW);
  for (int i = q + kColumns; i < rows; ++i) {
    Vector<Scalar> row[kVectors];
    for (int v = 0; v < kVectors; ++v) row[v] = load(x + std::ptrdiff_t{kDirections} * i + v * kW);
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) {
      const Vector<Scalar> factor = broadcast(l[j * ld + i]);
      for (int v = 0; v < kVectors; ++v)
        pivot[j][v] = subtract_product(factor, row[v], pivot[j][v]);
    }
  }
#pragma GCC unroll 8
  for (int j = kColumns - 1; j >= 0; --j) {
#pragma GCC unroll 8
    for (int k = j + 1; k < kColumns; ++k) {
      const Vector<Scalar> factor = broadcast(l[j * ld + q + k]);
      for (int v = 0; v < kVectors; ++v)
        pivot[j][v] = subtract_product(factor, pivot[k][v], pivot[j][v]);
    }
    for (int v = 0; v < kVectors; ++v) {
      pivot[j][v] *= inverse_diagonal[q + j];
      store<Scalar>(first + j * kDirections + v * kW, pivot[j][v]);
    }
  }
}

/// solve_forward for kDirections right-hand sides: x has `rows` rows of them.
template <class Scalar>
void solve_forward_rows(const Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                        const Scalar* inverse_diagonal, Scalar* x) {
  for (int group = 0; group < kDirections; group += kGroup<Scalar>) {
    int q = 0;
    for (; q + 6 <= pivots; q += 6)
      solve_forward_rows_at<Scalar, 6>(q, panel, ld, rows, inverse_diagonal, x + group);
    if (q < pivots)
      solve_forward_rows_at<Scalar, 3>(q, panel, ld, rows, inverse_diagonal, x + group);
  }
}

/// solve_backward for kDirections right-hand sides.
template <class Scalar>
void solve_backward_rows(const Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                         const Scalar* inverse_diagonal, Scalar* x) {
  for (int group = 0; group < kDirections; group += kGroup<Scalar>) {
    int q = pivots;
    if (q % 6 != 0) {
      q -= 3;
      solve_backward_rows_at<Scalar, 3>(q, panel, ld, rows, inverse_diagonal, x + group);
    }
    for (q -= 6; q >= 0; q -= 6)
      solve_backward_rows_at<Scalar, 6>(q, panel, ld, rows, inverse_diagonal, x + group);
  }
}

}  // namespace weft::dense
