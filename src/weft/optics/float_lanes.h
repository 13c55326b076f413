#pragma once
/// Several floats that are worked on at once; arithmetic and comparison act on each.
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
