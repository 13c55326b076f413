#pragma once
/// Several floats that are worked on at once; arithmetic and comparison act on each.
#include <array>
#include <bit>
#include <cstring>
#include <utility>

namespace weft {

#if defined(__AVX__)
inline constexpr int kFloatLanes = 8;
#else
inline constexpr int kFloatLanes = 4;
#endif

using FloatLanes = float __attribute__((vector_size(kFloatLanes * sizeof(float))));
/// Integers, and masks of 0 and -1.
using IntLanes = int __attribute__((vector_size(kFloatLanes * sizeof(int))));

namespace detail {
using LaneIndices = std::make_integer_sequence<int, kFloatLanes>;

template <class Values, int... k>
[[gnu::always_inline]] inline Values collect(const auto& value, std::integer_sequence<int, k...>) {
  return Values{value(k)...};
}
}  // namespace detail

/// value(0), value(1), ... of each lane.
inline FloatLanes float_lanes(const auto& value) {
  return detail::collect<FloatLanes>(value, detail::LaneIndices{});
}
inline IntLanes int_lanes(const auto& value) {
  return detail::collect<IntLanes>(value, detail::LaneIndices{});
}

template <class Values>
Values load_lanes(const auto* from) {
  Values values;
  std::memcpy(&values, from, sizeof values);
  return values;
}
template <class Values>
void store_lanes(auto* to, Values values) {
  std::memcpy(to, &values, sizeof values);
}

namespace detail {
using Quad = float __attribute__((vector_size(4 * sizeof(float))));

/// Of every four lanes of a and b those with these indices, 4 to 7: of b.
template <int i0, int i1, int i2, int i3, int... k>
inline FloatLanes shuffled(FloatLanes a, FloatLanes b, std::integer_sequence<int, k...>) {
  constexpr std::array<int, 4> from{i0, i1, i2, i3};
  return __builtin_shufflevector(
      a, b, (k / 4 * 4 + from[k % 4] + (from[k % 4] < 4 ? 0 : kFloatLanes - 4))...);
}
template <int i0, int i1, int i2, int i3>
inline FloatLanes shuffled(FloatLanes a, FloatLanes b) {
  return shuffled<i0, i1, i2, i3>(a, b, LaneIndices{});
}

/// Four floats of each row k, k + 4, ... side by side.
template <std::size_t rows>
inline FloatLanes quads(const std::array<const float*, rows>& row, std::size_t k,
                        std::size_t column) {
  static_assert(rows == kFloatLanes && (rows == 4 || rows == 8));
  const auto quad = [&](std::size_t i) { return load_lanes<Quad>(row[i] + column); };
  if constexpr (rows == 4)
    return quad(k);
  else
    return __builtin_shufflevector(quad(k), quad(k + 4), 0, 1, 2, 3, 4, 5, 6, 7);
}
}  // namespace detail

/// Columns `first` to first + 3 of a table from rows of it, one a lane.
inline std::array<FloatLanes, 4> load_columns(const std::array<const float*, kFloatLanes>& row,
                                              std::size_t first) {
  const FloatLanes a = detail::quads(row, 0, first), b = detail::quads(row, 1, first);
  const FloatLanes c = detail::quads(row, 2, first), d = detail::quads(row, 3, first);
  const FloatLanes ab = detail::shuffled<0, 4, 1, 5>(a, b), cd = detail::shuffled<0, 4, 1, 5>(c, d);
  const FloatLanes ef = detail::shuffled<2, 6, 3, 7>(a, b), gh = detail::shuffled<2, 6, 3, 7>(c, d);
  return {detail::shuffled<0, 1, 4, 5>(ab, cd), detail::shuffled<2, 3, 6, 7>(ab, cd),
          detail::shuffled<0, 1, 4, 5>(ef, gh), detail::shuffled<2, 3, 6, 7>(ef, gh)};
}

/// The other way round: writes these columns of a table to rows of it.
inline void store_columns(const std::array<float*, kFloatLanes>& row, std::size_t first,
                          FloatLanes a, FloatLanes b, FloatLanes c, FloatLanes d) {
  const FloatLanes ab = detail::shuffled<0, 4, 1, 5>(a, b), cd = detail::shuffled<0, 4, 1, 5>(c, d);
  const FloatLanes ef = detail::shuffled<2, 6, 3, 7>(a, b), gh = detail::shuffled<2, 6, 3, 7>(c, d);
  const std::array<FloatLanes, 4> out{
      detail::shuffled<0, 1, 4, 5>(ab, cd), detail::shuffled<2, 3, 6, 7>(ab, cd),
      detail::shuffled<0, 1, 4, 5>(ef, gh), detail::shuffled<2, 3, 6, 7>(ef, gh)};
  for (std::size_t k = 0; k < kFloatLanes; ++k)
    std::memcpy(row[k] + first, reinterpret_cast<const char*>(&out[k % 4]) + k / 4 * 16, 16);
}

namespace detail {
template <class Values, int... k>
inline std::array<Values, 2> even_and_odd(Values a, Values b, std::integer_sequence<int, k...>) {
  return {__builtin_shufflevector(a, b, (2 * k)...), __builtin_shufflevector(a, b, (2 * k + 1)...)};
}
}  // namespace detail

/// Every second lane of a and then of b: the even ones, the odd ones.
template <class Values>
std::array<Values, 2> even_and_odd(Values a, Values b) {
  return detail::even_and_odd(a, b, detail::LaneIndices{});
}

/// Whether a mask is set in all lanes, in any.
inline bool all_of(IntLanes mask) {
  int all = -1;
  for (int k = 0; k < kFloatLanes; ++k) all &= mask[k];
  return all != 0;
}
inline bool any_of(IntLanes mask) { return !all_of(~mask); }

/// table[at] and table[at + 1] of each lane; at >= 0.
inline std::array<FloatLanes, 2> load_pairs(const float* table, IntLanes at) {
  // Each pair at once, as a number that is only carried.
  using Pairs = double __attribute__((vector_size(sizeof(FloatLanes))));
  const auto pair = [&](int k) {
    double both;
    std::memcpy(&both, table + static_cast<unsigned>(at[k]), sizeof both);
    return both;
  };
  // Two pairs of every four to either: 0, 1, 4, 5 and 2, 3, 6, 7.
  constexpr auto half = std::make_integer_sequence<int, kFloatLanes / 2>{};
  const auto first = [](int k) { return k / 2 * 4 + k % 2; };
  const auto a = detail::collect<Pairs>([&](int k) { return pair(first(k)); }, half);
  const auto b = detail::collect<Pairs>([&](int k) { return pair(first(k) + 2); }, half);
  const auto floats = [](Pairs pairs) { return std::bit_cast<FloatLanes>(pairs); };
  return {detail::shuffled<0, 2, 4, 6>(floats(a), floats(b)),
          detail::shuffled<1, 3, 5, 7>(floats(a), floats(b))};
}

inline FloatLanes to_float(IntLanes a) { return __builtin_convertvector(a, FloatLanes); }
/// Towards zero.
inline IntLanes to_int(FloatLanes a) { return __builtin_convertvector(a, IntLanes); }
inline FloatLanes floor_of(FloatLanes a) {
  constexpr float kAllWhole = 8388608;  // 2^23: from there on every float is a whole number
  const FloatLanes cut = to_float(to_int(a));
  const FloatLanes whole = cut > a ? cut - 1 : cut;
  return ((a > -kAllWhole) & (a < kAllWhole)) ? whole : a;
}

}  // namespace weft
