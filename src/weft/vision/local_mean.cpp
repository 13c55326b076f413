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

/// In whole packs; what is written beyond `count` means nothing.
void blur_along(const Taps& taps, const float* in, std::ptrdiff_t step, float* out, int count) {
  for (int i = 0; i < count; i += kPack) {
    Pack sum = taps[0] * load(in + i);
    for (std::size_t n = 1; n < taps.size(); ++n) {
      const std::ptrdiff_t offset = std::ptrdiff_t(n) * step;
      sum += taps[n] * (load(in + i - offset) + load(in + i + offset));
    }
    store(out + i, sum);
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
  // Room to read and write whole packs.
  light_row_.assign(std::size_t(round_up(columns_) + kPack + 4), 0.0f);
  count_row_.assign(light_row_.size(), 0.0f);
  mean_row_.resize(std::size_t(kBlock * round_up(columns_)));
}

void LocalMean::sum_blocks(const Image& intensity, const Plane& mask) {
  const int reach = int(taps_.size());
  // Whole blocks of the row, and what of the box lies before and after them.
  const int begin = std::min((box_.x0 + kBlock - 1) / kBlock * kBlock, box_.x1);
  const int end = std::max(box_.x1 / kBlock * kBlock, begin);
  for (int y = box_.y0; y < box_.y1; ++y) {
    const float* in = intensity.data() + y * intensity.cols();
    const float* inside = mask.row(y - box_.y0) - box_.x0;
    float* light = light_.row(y / kBlock - first_row_ + reach) - first_column_;
    float* count = count_.row(y / kBlock - first_row_ + reach) - first_column_;
    const auto add = [&](int x) {
      light[x / kBlock] += inside[x] * in[x];
      count[x / kBlock] += inside[x];
    };
    for (int x = box_.x0; x < begin; ++x) add(x);
    for (int block = begin / kBlock; block < end / kBlock; ++block) {
      const float* i = inside + kBlock * block;
      const float* l = in + kBlock * block;
      light[block] = light[block] + i[0] * l[0] + i[1] * l[1] + i[2] * l[2] + i[3] * l[3];
      count[block] = count[block] + i[0] + i[1] + i[2] + i[3];
    }
    for (int x = end; x < box_.x1; ++x) add(x);
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
    for (int i = 0; i < columns_; i += kPack)
      store(out->data() + i,
            wy[0] * load(plane->row(first) + i) + wy[1] * load(plane->row(first + 1) + i) +
                wy[2] * load(plane->row(first + 2) + i) + wy[3] * load(plane->row(first + 3) + i));

  // For all blocks at a time: pixels at the same place of their blocks have the same weights.
  const int first_block = box_.x0 / kBlock, blocks = (box_.x1 - 1) / kBlock + 1 - first_block;
  std::array<Pack, kBlock> means;
  for (int block = 0; block < blocks; block += kPack) {
    for (int p = 0; p < kBlock; ++p) {
      const double offset = block_offset(p);
      const auto w = spline_weights(offset < 0 ? offset + 1 : offset);
      const int i = first_block + block - first_column_ - (p < kBlock / 2 ? 2 : 1);
      const auto spline = [&](const float* in) -> Pack {
        return w[0] * load(in) + w[1] * load(in + 1) + w[2] * load(in + 2) + w[3] * load(in + 3);
      };
      const Pack total = spline(light_row_.data() + i), pixels = spline(count_row_.data() + i);
      means[std::size_t(p)] = (pixels > 1e-3f).select(total / pixels, 0.0f);
    }
    float* out = mean_row_.data() + kBlock * block;
    for (int k = 0; k < kPack; ++k)
      for (int p = 0; p < kBlock; ++p) out[kBlock * k + p] = means[std::size_t(p)][k];
  }
  std::copy_n(mean_row_.data() + (box_.x0 - kBlock * first_block), box_.width(), mean);
}

}  // namespace weft::detail
