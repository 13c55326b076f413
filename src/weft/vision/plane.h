#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <vector>

#include "weft/base/types.h"

namespace weft::detail {

/// What the row filters work on at a time; the compiler maps it to vector registers.
constexpr int kPack = 16;
using Pack = Eigen::Array<float, kPack, 1>;

inline Pack load(const float* p) { return Eigen::Map<const Pack>(p); }
inline void store(float* p, const Pack& value) { Eigen::Map<Pack>{p} = value; }
inline int round_up(int value) { return (value + kPack - 1) / kPack * kPack; }

/// Rows of floats, zero at first, with at least `margin` floats before and after each row, and room
/// to write whole packs. Keeps its memory when it shrinks.
class Plane {
 public:
  void resize(int rows, int columns, int margin) {
    margin_ = round_up(margin);
    stride_ = round_up(columns) + 2 * margin_;
    const auto size = std::size_t(rows) * std::size_t(stride_);
    if (data_.size() < size) data_.resize(size);
    std::fill_n(data_.begin(), size, 0.0f);
  }
  /// As resize(), for rows whose `columns` are all written before they are read: zero is only what
  /// lies around them.
  void resize_unfilled(int rows, int columns, int margin) {
    margin_ = round_up(margin);
    stride_ = round_up(columns) + 2 * margin_;
    const auto size = std::size_t(rows) * std::size_t(stride_);
    if (data_.size() < size) data_.resize(size);
    for (int i = 0; i < rows; ++i) {
      float* begin = row(i);
      std::fill_n(begin - margin_, margin_, 0.0f);
      std::fill_n(begin + columns, stride_ - margin_ - columns, 0.0f);
    }
  }
  float* row(int i) { return data_.data() + std::ptrdiff_t(i) * stride_ + margin_; }
  const float* row(int i) const { return data_.data() + std::ptrdiff_t(i) * stride_ + margin_; }

 private:
  std::vector<float> data_;
  int margin_ = 0, stride_ = 0;
};

/// Pixels x0 <= x < x1, y0 <= y < y1.
struct Box {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool empty() const { return x1 <= x0 || y1 <= y0; }
};

/// Of the pixels that are not 0.
Box bounding_box(const Mask& mask);

}  // namespace weft::detail
