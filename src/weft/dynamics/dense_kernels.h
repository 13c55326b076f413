#pragma once
/// Dense kernels of SparseCholesky, for fronts of 30 to 200 rows: at these sizes Eigen's general
/// kernels spend more on packing and on calls than on arithmetic.
///
/// Matrices are column-major with leading dimension `ld`. Rows are worked on kTileRows at a time,
/// and the last tile may reach past the last row: every column, and the end of the storage, has
/// kTileRows - 1 spare entries, zero at the start and left zero.
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

template <class Scalar>
inline Scalar sum(const Vector<Scalar>& v) {
  Scalar total = 0;
  for (int i = 0; i < kWidth<Scalar>; ++i) total += v[i];
  return total;
}

/// c(rows, columns) -= a b^T for one tile of rows and kColumns columns; a has `depth` columns, and
/// row j of b is that of column j of c.
template <class Scalar, int kColumns>
inline void subtract_product_tile(const Scalar* a, const Scalar* b, int depth, std::ptrdiff_t ld,
                                  Scalar* c, std::ptrdiff_t ldc) {
  constexpr int kVectors = kTileVectors<Scalar>;
  Vector<Scalar> total[kColumns][kVectors] = {};
  for (int k = 0; k < depth; ++k) {
    Vector<Scalar> left[kVectors];
    for (int v = 0; v < kVectors; ++v) left[v] = load(a + k * ld + v * kWidth<Scalar>);
    for (int j = 0; j < kColumns; ++j) {
      const Vector<Scalar> right = Vector<Scalar>{} + b[k * ld + j];
      for (int v = 0; v < kVectors; ++v) total[j][v] = multiply_add(left[v], right, total[j][v]);
    }
  }
  for (int j = 0; j < kColumns; ++j) {
    for (int v = 0; v < kVectors; ++v) {
      Scalar* at = c + j * ldc + v * kWidth<Scalar>;
      store<Scalar>(at, load(at) - total[j][v]);
    }
  }
}

/// Rows from `row` to `rows` of kColumns columns of c, as above.
template <class Scalar, int kColumns>
inline void subtract_product(const Scalar* a, const Scalar* b, int depth, std::ptrdiff_t ld,
                             Scalar* c, std::ptrdiff_t ldc, int row, int rows) {
  for (; row < rows; row += kTileRows<Scalar>) {
    subtract_product_tile<Scalar, kColumns>(a + row, b, depth, ld, c + row, ldc);
  }
}

/// Columns `first` to first + kColumns of the panel's factor; those before are done. False if a
/// pivot is not positive.
template <class Scalar, int kColumns>
inline bool factorize_columns(Scalar* panel, std::ptrdiff_t ld, int rows, int first,
                              Scalar* inverse_diagonal) {
  subtract_product<Scalar, kColumns>(panel, panel + first, first, ld, panel + first * ld, ld, first,
                                     rows);
  Scalar* block = panel + first * ld;  // its columns
  for (int j = 0; j < kColumns; ++j) {
    Scalar* column = block + j * ld + first;
    for (int k = 0; k < j; ++k) {
      const Scalar* left = block + k * ld + first;
      for (int i = j; i < kColumns; ++i) column[i] -= left[i] * left[j];
    }
    if (!(column[j] > 0) || !std::isfinite(column[j])) return false;
    column[j] = std::sqrt(column[j]);
    inverse_diagonal[first + j] = 1 / column[j];
    for (int i = j + 1; i < kColumns; ++i) column[i] *= inverse_diagonal[first + j];
  }
  for (int row = first + kColumns; row < rows; row += kWidth<Scalar>) {
    Vector<Scalar> x[kColumns];
    for (int j = 0; j < kColumns; ++j) {
      x[j] = load(block + j * ld + row);
      for (int k = 0; k < j; ++k) x[j] -= x[k] * block[k * ld + first + j];
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

/// Lower triangle of c (size x size, a multiple of 3) -= a a^T, a with `depth` columns.
template <class Scalar>
void subtract_square(const Scalar* a, int depth, std::ptrdiff_t ld, Scalar* c, std::ptrdiff_t ldc,
                     int size) {
  int j = 0;
  for (; j + 6 <= size; j += 6) {
    subtract_product<Scalar, 6>(a, a + j, depth, ld, c + j * ldc, ldc, j, size);
  }
  if (j < size) subtract_product<Scalar, 3>(a, a + j, depth, ld, c + j * ldc, ldc, j, size);
}

/// x <- L^-1 x for the pivots, and what they leave for the rows below, with x of `rows` entries.
template <class Scalar>
void solve_forward(const Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                   const Scalar* inverse_diagonal, Scalar* x) {
  for (int q = 0; q < pivots; q += 3) {
    const Scalar* l0 = panel + q * ld;
    const Scalar* l1 = l0 + ld;
    const Scalar* l2 = l1 + ld;
    x[q] *= inverse_diagonal[q];
    x[q + 1] = (x[q + 1] - l0[q + 1] * x[q]) * inverse_diagonal[q + 1];
    x[q + 2] = (x[q + 2] - l0[q + 2] * x[q] - l1[q + 2] * x[q + 1]) * inverse_diagonal[q + 2];
    const Vector<Scalar> x0 = Vector<Scalar>{} - x[q];
    const Vector<Scalar> x1 = Vector<Scalar>{} - x[q + 1];
    const Vector<Scalar> x2 = Vector<Scalar>{} - x[q + 2];
    for (int i = q + 3; i < rows; i += kWidth<Scalar>) {
      Vector<Scalar> v = load(x + i);
      v = multiply_add(load(l0 + i), x0, v);
      v = multiply_add(load(l1 + i), x1, v);
      v = multiply_add(load(l2 + i), x2, v);
      store<Scalar>(x + i, v);
    }
  }
}

/// x <- L^-T x for the pivots, given those of the rows below. The spare entries of x must be
/// finite.
template <class Scalar>
void solve_backward(const Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                    const Scalar* inverse_diagonal, Scalar* x) {
  for (int q = pivots - 3; q >= 0; q -= 3) {
    const Scalar* l0 = panel + q * ld;
    const Scalar* l1 = l0 + ld;
    const Scalar* l2 = l1 + ld;
    Vector<Scalar> s0{}, s1{}, s2{};
    for (int i = q + 3; i < rows; i += kWidth<Scalar>) {
      const Vector<Scalar> v = load(x + i);
      s0 = multiply_add(load(l0 + i), v, s0);
      s1 = multiply_add(load(l1 + i), v, s1);
      s2 = multiply_add(load(l2 + i), v, s2);
    }
    x[q + 2] = (x[q + 2] - sum<Scalar>(s2)) * inverse_diagonal[q + 2];
    x[q + 1] = (x[q + 1] - sum<Scalar>(s1) - l1[q + 2] * x[q + 2]) * inverse_diagonal[q + 1];
    x[q] = (x[q] - sum<Scalar>(s0) - l0[q + 1] * x[q + 1] - l0[q + 2] * x[q + 2]) *
           inverse_diagonal[q];
  }
}

/// kDirections numbers side by side: a row of several right-hand sides.
template <class Scalar>
struct RowOf {
  typedef Scalar type __attribute__((vector_size(kDirections * sizeof(Scalar))));
};
template <class Scalar>
using Row = typename RowOf<Scalar>::type;

template <class Scalar>
inline Row<Scalar> load_row(const Scalar* x, int row) {
  Row<Scalar> v;
  std::memcpy(&v, x + std::ptrdiff_t{kDirections} * row, sizeof v);
  return v;
}
template <class Scalar>
inline void store_row(Scalar* x, int row, const Row<Scalar>& v) {
  std::memcpy(x + std::ptrdiff_t{kDirections} * row, &v, sizeof v);
}

/// solve_forward for kDirections right-hand sides: x has `rows` rows of them.
template <class Scalar>
void solve_forward_rows(const Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                        const Scalar* inverse_diagonal, Scalar* x) {
  for (int q = 0; q < pivots; q += 3) {
    const Scalar* l0 = panel + q * ld;
    const Scalar* l1 = l0 + ld;
    const Scalar* l2 = l1 + ld;
    const Row<Scalar> x0 = load_row(x, q) * inverse_diagonal[q];
    const Row<Scalar> x1 = (load_row(x, q + 1) - l0[q + 1] * x0) * inverse_diagonal[q + 1];
    const Row<Scalar> x2 =
        (load_row(x, q + 2) - l0[q + 2] * x0 - l1[q + 2] * x1) * inverse_diagonal[q + 2];
    store_row(x, q, x0);
    store_row(x, q + 1, x1);
    store_row(x, q + 2, x2);
    for (int i = q + 3; i < rows; ++i)
      store_row<Scalar>(x, i, load_row(x, i) - l0[i] * x0 - l1[i] * x1 - l2[i] * x2);
  }
}

/// solve_backward for kDirections right-hand sides.
template <class Scalar>
void solve_backward_rows(const Scalar* panel, std::ptrdiff_t ld, int rows, int pivots,
                         const Scalar* inverse_diagonal, Scalar* x) {
  for (int q = pivots - 3; q >= 0; q -= 3) {
    const Scalar* l0 = panel + q * ld;
    const Scalar* l1 = l0 + ld;
    const Scalar* l2 = l1 + ld;
    Row<Scalar> s0 = load_row(x, q), s1 = load_row(x, q + 1), s2 = load_row(x, q + 2);
    for (int i = q + 3; i < rows; ++i) {
      const Row<Scalar> v = load_row(x, i);
      s0 -= l0[i] * v;
      s1 -= l1[i] * v;
      s2 -= l2[i] * v;
    }
    s2 *= inverse_diagonal[q + 2];
    s1 = (s1 - l1[q + 2] * s2) * inverse_diagonal[q + 1];
    s0 = (s0 - l0[q + 1] * s1 - l0[q + 2] * s2) * inverse_diagonal[q];
    store_row<Scalar>(x, q, s0);
    store_row<Scalar>(x, q + 1, s1);
    store_row<Scalar>(x, q + 2, s2);
  }
}

}  // namespace weft::dense
