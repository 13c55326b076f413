#include "weft/vision/local_mean.h"

#include <array>
#include <cmath>

namespace weft::detail {
namespace {

constexpr int kBlock = 4;

/// Weights of the samples -1, 0, 1, 2 at fraction t between samples 0 and 1.
std::array<float, 4> spline_weights(double t) {
  const double s = 1 - t;
  return {float(s * s * s / 6), float((3 * t * t * t - 6 * t * t + 4) / 6),
          float((3 * s * s * s - 6 * s * s + 4) / 6), float(t * t * t / 6)};
}

/// Blocks before a pixel's centre, in blocks between the blocks' centres: pixel p of a block lies
/// at (p + 1/2) / 4 - 1/2 from its centre.
double block_offset(int pixel) { return (pixel + 0.5) / kBlock - 0.5; }

void blur_along(const Taps& taps, const float* in, std::ptrdiff_t step, float* out, int count) {
  const int radius = int(taps.size()) - 1;
  for (int i = 0; i < count; ++i) {
    float sum = taps[0] * in[i];
    for (int n = 1; n <= radius; ++n)
      sum += taps[std::size_t(n)] * (in[i - n * step] + in[i + n * step]);
    out[i] = sum;
  }
}

}  // namespace

LocalMean::LocalMean(double sigma) {
  // Variances add up: a block of 4 pixels 4^2 / 12, a cubic B-spline 4^2 / 3.
  const double blocks = std::sqrt(std::max(sigma * sigma - 16.0 / 12 - 16.0 / 3, 1.0)) / kBlock;
  taps_ = gaussian_taps(blocks);
}

void LocalMean::update(const Image& intensity, const Plane& mask, const Box& box) {
  box_ = box;
  first_column_ = box.x0 / kBlock - 2;
  first_row_ = box.y0 / kBlock - 2;
  columns_ = (box.x1 - 1) / kBlock + 3 - first_column_;
  rows_ = (box.y1 - 1) / kBlock + 3 - first_row_;
  const int reach = int(taps_.size());
  for (Plane* plane : {&light_, &count_, &scratch_})
    plane->resize(rows_ + 2 * reach, columns_, reach + 2);
  sum_blocks(intensity, mask);
  blur_blocks();
  light_row_.resize(std::size_t(columns_));
  count_row_.resize(std::size_t(columns_));
}

void LocalMean::sum_blocks(const Image& intensity, const Plane& mask) {
  const int reach = int(taps_.size());
  for (int y = box_.y0; y < box_.y1; ++y) {
    const float* in = intensity.data() + y * intensity.cols();
    const float* inside = mask.row(y - box_.y0) - box_.x0;
    float* light = light_.row(y / kBlock - first_row_ + reach) - first_column_;
    float* count = count_.row(y / kBlock - first_row_ + reach) - first_column_;
    for (int x = box_.x0; x < box_.x1; ++x) {
      light[x / kBlock] += inside[x] * in[x];
      count[x / kBlock] += inside[x];
    }
  }
}

void LocalMean::blur_blocks() {
  const int reach = int(taps_.size());
  for (Plane* plane : {&light_, &count_}) {
    for (int i = 0; i < rows_ + 2 * reach; ++i)
      blur_along(taps_, plane->row(i), 1, scratch_.row(i), columns_);
    const std::ptrdiff_t stride = scratch_.row(1) - scratch_.row(0);
    for (int i = reach; i < rows_ + reach; ++i)
      blur_along(taps_, scratch_.row(i), stride, plane->row(i), columns_);
  }
}

void LocalMean::row(int y, float* mean) {
  const int reach = int(taps_.size());
  const double t = block_offset(y % kBlock);
  const int before = t < 0 ? -1 : 0;
  const auto wy = spline_weights(t < 0 ? t + 1 : t);
  const int first = y / kBlock + before - 1 - first_row_ + reach;
  for (auto [plane, out] : {std::pair{&light_, &light_row_}, std::pair{&count_, &count_row_}})
    for (int i = 0; i < columns_; ++i)
      (*out)[std::size_t(i)] = wy[0] * plane->row(first)[i] + wy[1] * plane->row(first + 1)[i] +
                               wy[2] * plane->row(first + 2)[i] + wy[3] * plane->row(first + 3)[i];

  std::array<std::array<float, 4>, kBlock> wx;
  for (int p = 0; p < kBlock; ++p) {
    const double offset = block_offset(p);
    wx[std::size_t(p)] = spline_weights(offset < 0 ? offset + 1 : offset);
  }
  for (int x = box_.x0; x < box_.x1; ++x) {
    const int p = x % kBlock;
    const auto& w = wx[std::size_t(p)];
    const int i = x / kBlock - first_column_ - (p < kBlock / 2 ? 2 : 1);
    const float* light = light_row_.data() + i;
    const float* count = count_row_.data() + i;
    const float total = w[0] * light[0] + w[1] * light[1] + w[2] * light[2] + w[3] * light[3];
    const float pixels = w[0] * count[0] + w[1] * count[1] + w[2] * count[2] + w[3] * count[3];
    mean[x - box_.x0] = pixels > 1e-3f ? total / pixels : 0.0f;
  }
}

}  // namespace weft::detail
