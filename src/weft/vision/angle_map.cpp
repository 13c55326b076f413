#include "weft/vision/angle_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "weft/base/error.h"
#include "weft/vision/local_mean.h"
#include "weft/vision/plane.h"
#include "weft/vision/steerable_basis.h"

namespace weft {
namespace {

using detail::Box;
using detail::kPack;
using detail::load;
using detail::Pack;
using detail::Plane;
using detail::SteerableBasis;
using detail::store;
using detail::Taps;

constexpr float kPi = std::numbers::pi_v<float>;

/// The last tap stands where the Gaussian is exp(-2.4^2) = 0.3 %: 0.4 / px at radius 6. The
/// response of G2 peaks at a period of pi / 0.4 = 7.9 px and has fallen to 47 % at 17 px and to 15
/// % at 32 px; with the peak at a longer period, 13 taps would cut the Gaussian off and bend the
/// angle.
constexpr double kReach = 2.4;
/// Period at which G2 and H2 are an exact quadrature pair, of the radius: 17 px for 6 px.
constexpr double kPeriodPerRadius = 17.0 / 6.0;
/// Light is divided by its mean over a Gaussian of this many radii, plus this part of the region's
/// mean.
constexpr double kMeanSigmaPerRadius = 1.6;
constexpr float kMeanFloor = 0.05f;
/// The energy of a sinusoid is about 0.8 times its variance; coefficients are divided by the local
/// energy plus this part of that.
constexpr double kEnergyOfVariance = 0.8;
constexpr double kEnergyFloor = 0.15;
/// Relative light that varies less than this has no stripes; and the strength that rounding
/// reaches.
constexpr double kLeastVariance = 1e-5;
constexpr float kLeastStrength = 0.02f;
/// |(C2, C3)| / C1 of a grating at the design period, averaged over its phase.
constexpr float kGratingCoherence = 1.21f;

/// atan(y / x) / 2 over the full turn, in (-pi/2, pi/2]. The polynomial is Abramowitz and Stegun
/// 4.4.49 (|error| <= 2e-8); without branches, so that rows of it vectorize.
inline float half_atan2(float y, float x) {
  const float ax = std::abs(x), ay = std::abs(y);
  const float larger = std::max(ax, ay), smaller = std::min(ax, ay);
  const float t = smaller / std::max(larger, 1e-30f), s = t * t;
  float p = 0.0028662257f;
  p = p * s - 0.0161657367f;
  p = p * s + 0.0429096138f;
  p = p * s - 0.0752896400f;
  p = p * s + 0.1065626393f;
  p = p * s - 0.1420889944f;
  p = p * s + 0.1999355085f;
  p = p * s - 0.3333314528f;
  float a = t + t * s * p;
  a = ay > ax ? kPi / 2 - a : a;
  a = x < 0 ? kPi - a : a;
  a = y < 0 ? -a : a;
  a = a <= -kPi ? kPi : a;
  return 0.5f * a;
}

template <typename T>
T checked(T value, T lower, T upper, const char* name) {
  if (value >= lower && value <= upper) return value;
  throw Error("angle map: " + std::string(name) + " is " + std::to_string(value) +
              ", must be from " + std::to_string(lower) + " to " + std::to_string(upper));
}

/// Sum of a times b: row by row in float, the rows in double. A sum waits for its additions; four
/// rows at a time do not.
template <class RowOfA, class RowOfB>
double sum_of_products(int height, int width, const RowOfA& row_of_a, const RowOfB& row_of_b) {
  constexpr int kRows = 4;
  double total = 0;
  for (int y = 0; y < height; y += kRows) {
    const auto row = [&](int k) { return std::min(y + k, height - 1); };
    const std::array<const float*, kRows> a{row_of_a(row(0)), row_of_a(row(1)), row_of_a(row(2)),
                                            row_of_a(row(3))};
    const std::array<const float*, kRows> b{row_of_b(row(0)), row_of_b(row(1)), row_of_b(row(2)),
                                            row_of_b(row(3))};
    std::array<float, kRows> sums{};
    for (int x = 0; x < width; ++x)
      for (std::size_t k = 0; k < kRows; ++k) sums[k] += a[k][x] * b[k][x];
    for (int k = 0; k < std::min(kRows, height - y); ++k) total += double(sums[std::size_t(k)]);
  }
  return total;
}

/// Two rows at the same columns.
struct RowPair {
  Pack upper, lower;
};

/// Rows above one another, from some above the one at hand to some below it.
using Column = const float* const*;

/// Sums of even taps over the rows around rows[0] and around rows[1]: what one of them reads, the
/// other one reads a step later.
inline RowPair even_sums(const Taps& taps, Column rows, int x) {
  Pack before = load(rows[0] + x), after = load(rows[1] + x);
  RowPair sums{taps[0] * before, taps[0] * after};
  const int reach = int(taps.size()) - 1;
  for (int n = 1; n <= reach; ++n) {
    const float tap = taps[std::size_t(n)];
    const Pack above = load(rows[-n] + x), below = load(rows[n + 1] + x);
    sums.upper += tap * (after + above);
    sums.lower += tap * (below + before);
    before = above;
    after = below;
  }
  return sums;
}

/// The same of odd taps.
inline RowPair odd_sums(const Taps& taps, Column rows, int x) {
  Pack before = load(rows[0] + x), after = load(rows[1] + x);
  RowPair sums{Pack::Zero(), Pack::Zero()};
  const int reach = int(taps.size()) - 1;
  for (int n = 1; n <= reach; ++n) {
    const float tap = taps[std::size_t(n)];
    const Pack above = load(rows[-n] + x), below = load(rows[n + 1] + x);
    sums.upper += tap * (after - above);
    sums.lower += tap * (below - before);
    before = above;
    after = below;
  }
  return sums;
}

/// Rows that are worked on together: they read nearly the same rows, which are then at hand.
constexpr int kRowsTogether = 4;

/// The value at `rank` of the sorted `values`, which are not negative; they may be reordered. Bins
/// first: what is sorted is the few values next to it.
float ranked(std::vector<float>& values, std::size_t rank) {
  constexpr int kBins = 1024;
  const float largest = *std::max_element(values.begin(), values.end());
  const float scale = float(kBins) / std::max(largest, 1e-30f);
  const auto bin = [&](float value) {
    return std::size_t(std::min(int(value * scale), kBins - 1));
  };
  std::array<std::size_t, kBins> counts{};
  for (const float value : values) ++counts[bin(value)];
  std::size_t wanted = 0;
  while (rank >= counts[wanted]) rank -= counts[wanted++];
  const auto end = std::partition(values.begin(), values.end(),
                                  [&](float value) { return bin(value) == wanted; });
  const auto at = values.begin() + std::ptrdiff_t(rank);
  std::nth_element(values.begin(), at, end);
  return *at;
}

}  // namespace

struct AngleMapper::Impl {
  Impl(int width_px, int height_px, const AngleMapOptions& given);
  const AngleMap& compute(const Image& intensity, const Mask& region);

 private:
  void check(const Image& intensity, const Mask& region) const;
  void clear_outputs(const Box& last);
  void set_inside(const Mask& region);
  void normalise(const Image& intensity);
  void filter_along_x(int y);
  using Sums = std::array<Pack, 7>;
  void combine(int y);
  void combine_pack(const Sums& sums, int row, int y, int x);
  void blur_along_y(int y);
  void finish(int row, int y);
  void drop_undefined();
  int ring_rows() const { return 2 * radius_ + kRowsTogether; }
  float* ring(std::size_t factor, int y) {
    return filtered_[factor].row((y + ring_rows()) % ring_rows());
  }
  int reach() const { return int(blur_.size()) - 1; }
  int blurred_rows() const { return 2 * reach() + kRowsTogether; }
  float* blurred(std::size_t coefficient, int y) {
    return blurred_[coefficient].row((y + blurred_rows()) % blurred_rows());
  }
  void blur_along_x(int row, int y);
  void darken(int y);

  const int width_, height_;
  const AngleMapOptions options_;
  const int radius_;
  const SteerableBasis basis_;
  const Taps blur_;
  detail::LocalMean mean_;
  AngleMap map_;
  Box box_;
  // Rows and columns of the box.
  Plane inside_;  ///< 1 inside the region less its rim, else 0
  Plane light_;   ///< less its local mean, over it; 0 outside
  float energy_floor_ = 0;
  std::array<Plane, 3> row_;       ///< kRowsTogether rows of C1, C2, C3, or of the blurred ones
  std::array<Plane, 3> blurred_;   ///< the last blurred_rows() rows of C1, C2, C3 blurred along x
  std::array<Plane, 5> filtered_;  ///< the last ring_rows() rows of e, u1, g2, h2, h3 along x
  /// Rows in one of these rings from the first to the last that a group of rows reads.
  std::array<std::vector<const float*>, 5> columns_;
  Plane coherence_;
  std::vector<float> sample_;
};

AngleMapper::Impl::Impl(int width_px, int height_px, const AngleMapOptions& given)
    : width_(checked(width_px, 1, 1 << 15, "width")),
      height_(checked(height_px, 1, 1 << 15, "height")),
      options_(given),
      radius_(int(std::lround(checked(given.kernel_radius, 2.0, 64.0, "kernel_radius")))),
      basis_(detail::make_steerable_basis(radius_, kReach, kPeriodPerRadius * radius_)),
      blur_(detail::gaussian_taps(checked(given.blur_sigma, 0.1, 64.0, "blur_sigma"))),
      mean_(kMeanSigmaPerRadius * given.kernel_radius) {
  checked(given.energy_threshold, 0.0, 1.0, "energy_threshold");
  checked(given.coherence_threshold, 0.0, 1.0, "coherence_threshold");
  map_.angle = Image::Zero(height_, width_);
  map_.strength = Image::Zero(height_, width_);
  map_.valid = Mask::Zero(height_, width_);
}

void AngleMapper::Impl::check(const Image& intensity, const Mask& region) const {
  const auto require = [&](const auto& plane, const char* name) {
    if (plane.rows() == height_ && plane.cols() == width_) return;
    throw Error("angle map: the " + std::string(name) + " is " + std::to_string(plane.cols()) +
                " x " + std::to_string(plane.rows()) + " px, must be " + std::to_string(width_) +
                " x " + std::to_string(height_));
  };
  require(intensity, "image");
  if (region.size() != 0) require(region, "region");
}

/// What lies in the last box and not in this one, all of which is written.
void AngleMapper::Impl::clear_outputs(const Box& last) {
  const auto clear = [&](int y0, int y1, int x0, int x1) {
    if (y1 <= y0 || x1 <= x0) return;
    map_.angle.block(y0, x0, y1 - y0, x1 - x0).setZero();
    map_.strength.block(y0, x0, y1 - y0, x1 - x0).setZero();
    map_.valid.block(y0, x0, y1 - y0, x1 - x0).setZero();
  };
  if (last.empty()) return;
  if (box_.empty()) return clear(last.y0, last.y1, last.x0, last.x1);
  const int top = std::clamp(box_.y0, last.y0, last.y1);
  const int bottom = std::clamp(box_.y1, last.y0, last.y1);
  clear(last.y0, top, last.x0, last.x1);
  clear(bottom, last.y1, last.x0, last.x1);
  clear(top, bottom, last.x0, std::min(last.x1, box_.x0));
  clear(top, bottom, std::max(last.x0, box_.x1), last.x1);
}

/// The region less the pixels that touch its outside, which are partly background. The frame's
/// border is no rim.
void AngleMapper::Impl::set_inside(const Mask& region) {
  inside_.resize_unfilled(box_.height(), box_.width(), 0);
  for (int i = 0; i < box_.height(); ++i) {
    float* out = inside_.row(i);
    if (region.size() == 0) {
      std::fill_n(out, box_.width(), 1.0f);
      continue;
    }
    const int y = box_.y0 + i;
    const std::uint8_t* here = region.data() + y * region.cols();
    const std::uint8_t* above = y > 0 ? here - region.cols() : here;
    const std::uint8_t* below = y + 1 < height_ ? here + region.cols() : here;
    const auto core = [&](int x, int left, int right) {
      return (here[x] != 0) & (above[x] != 0) & (below[x] != 0) & (here[left] != 0) &
             (here[right] != 0);
    };
    for (int x = std::max(box_.x0, 1); x < std::min(box_.x1, width_ - 1); ++x)
      out[x - box_.x0] = core(x, x - 1, x + 1) ? 1.0f : 0.0f;
    if (box_.x0 == 0) out[0] = core(0, 0, std::min(1, width_ - 1)) ? 1.0f : 0.0f;
    if (box_.x1 == width_)
      out[box_.width() - 1] = core(width_ - 1, std::max(width_ - 2, 0), width_ - 1) ? 1.0f : 0.0f;
  }
}

/// Light relative to its local mean: what shading and albedo multiply cancels, and neither the
/// silhouette nor a shadow's edge is a step between levels that have nothing to do with stripes.
void AngleMapper::Impl::normalise(const Image& intensity) {
  mean_.update(intensity, inside_, box_);
  const auto row_in = [&](int y) {
    return intensity.data() + (box_.y0 + y) * intensity.cols() + box_.x0;
  };
  const auto inside_row = [&](int y) { return inside_.row(y); };
  const double total = sum_of_products(box_.height(), box_.width(), row_in, inside_row);
  double pixels = 0;
  for (int y = 0; y < box_.height(); ++y) {
    // Whole numbers: their sum does not depend on the order.
    const Eigen::Map<const Eigen::ArrayXf> inside(inside_.row(y), box_.width());
    pixels += double(inside.sum());
  }
  const float floor = std::max(kMeanFloor * float(total / std::max(pixels, 1.0)), 1e-6f);
  light_.resize_unfilled(box_.height(), box_.width(), radius_);
  for (int y = 0; y < box_.height(); ++y) {
    const float* in = row_in(y);
    const float* inside = inside_.row(y);
    float* mean = row_[0].row(0);
    float* out = light_.row(y);
    mean_.row(box_.y0 + y, mean);
    for (int x = 0; x < box_.width(); ++x)
      out[x] = inside[x] * (in[x] - mean[x]) / (mean[x] + floor);
  }
  const auto light_row = [&](int y) { return light_.row(y); };
  const double squares = sum_of_products(box_.height(), box_.width(), light_row, light_row);
  const double variance = std::max(squares / std::max(pixels, 1.0), kLeastVariance);
  energy_floor_ = float(kEnergyFloor * kEnergyOfVariance * variance);
}

/// One row of light through the five factors along x; rows outside the box are dark.
void AngleMapper::Impl::filter_along_x(int y) {
  std::array<float*, 5> out;
  for (std::size_t k = 0; k < 5; ++k) out[k] = ring(k, y);
  if (y < 0 || y >= box_.height()) {
    for (float* row : out) std::fill_n(row, detail::round_up(box_.width()), 0.0f);
    return;
  }
  const float* in = light_.row(y);
  const SteerableBasis& b = basis_;
  for (int x = 0; x < box_.width(); x += kPack) {
    const Pack center = load(in + x);
    Pack e = b.e[0] * center, g2 = b.g2[0] * center, h2 = b.h2[0] * center;
    Pack u1 = Pack::Zero(), h3 = Pack::Zero();
    for (int n = 1; n <= radius_; ++n) {
      const auto i = std::size_t(n);
      const Pack after = load(in + x + n), before = load(in + x - n);
      const Pack sum = after + before, difference = after - before;
      e += b.e[i] * sum;
      g2 += b.g2[i] * sum;
      h2 += b.h2[i] * sum;
      u1 += b.u1[i] * difference;
      h3 += b.h3[i] * difference;
    }
    store(out[0] + x, e);
    store(out[1] + x, u1);
    store(out[2] + x, g2);
    store(out[3] + x, h2);
    store(out[4] + x, h3);
  }
}

/// The factors along y, the coefficients of the oriented energy, and their blur along x, for
/// kRowsTogether rows from y on.
void AngleMapper::Impl::combine(int y) {
  for (std::size_t k = 0; k < 5; ++k) {
    columns_[k].clear();
    for (int i = y - radius_; i < y + radius_ + kRowsTogether; ++i)
      columns_[k].push_back(ring(k, i));
  }
  const SteerableBasis& b = basis_;
  for (int x = 0; x < box_.width(); x += kPack)
    for (int row = 0; row < kRowsTogether; row += 2) {
      const auto rows = [&](std::size_t k) { return columns_[k].data() + radius_ + row; };
      const RowPair ga = even_sums(b.e, rows(2), x), gb = odd_sums(b.u1, rows(1), x);
      const RowPair gc = even_sums(b.g2, rows(0), x), ha = even_sums(b.e, rows(4), x);
      const RowPair hb = odd_sums(b.u1, rows(3), x), hc = even_sums(b.h2, rows(1), x);
      const RowPair hd = odd_sums(b.h3, rows(0), x);
      combine_pack({ga.upper, gb.upper, gc.upper, ha.upper, hb.upper, hc.upper, hd.upper}, row,
                   y + row, x);
      combine_pack({ga.lower, gb.lower, gc.lower, ha.lower, hb.lower, hc.lower, hd.lower}, row + 1,
                   y + row + 1, x);
    }
  for (int row = 0; row < kRowsTogether; ++row)
    if (y + row < box_.height())
      blur_along_x(row, y + row);
    else
      darken(y + row);
}

/// As functions of the direction t, G2 = p + q cos 2t + r sin 2t and H2 = a1 cos t + b1 sin t +
/// a3 cos 3t + b3 sin 3t. Of G2^2 + H2^2, C1 is the mean and C2, C3 the coefficients of cos 2t and
/// sin 2t. All are divided by C1 and a floor, so that bright, dark, sharp and blurred stripes count
/// alike in the blur.
void AngleMapper::Impl::combine_pack(const Sums& sums, int row, int y, int x) {
  if (y >= box_.height()) return;
  const SteerableBasis& b = basis_;
  const auto& [ga, gb, gc, ha, hb, hc, hd] = sums;
  const Pack p = 0.5f * (ga + gc), q = 0.5f * (ga - gc), r = 2.0f * gb;
  const Pack a1 = 0.75f * (ha + hc), b1 = 0.75f * (hb + hd);
  const Pack a3 = 0.25f * ha - 0.75f * hc, b3 = 0.75f * hb - 0.25f * hd;
  const float gg = b.gain_g * b.gain_g, hh = b.gain_h * b.gain_h;
  const Pack c1 =
      gg * (p * p + 0.5f * (q * q + r * r)) + hh * (0.5f * (a1 * a1 + b1 * b1 + a3 * a3 + b3 * b3));
  const Pack c2 = gg * (2.0f * p * q) + hh * (0.5f * (a1 * a1 - b1 * b1) + a1 * a3 + b1 * b3);
  const Pack c3 = gg * (2.0f * p * r) + hh * (a1 * b1 + a1 * b3 - b1 * a3);
  const Pack weight = load(inside_.row(y) + x) / (c1 + energy_floor_);
  store(row_[0].row(row) + x, weight * c1);
  store(row_[1].row(row) + x, weight * c2);
  store(row_[2].row(row) + x, weight * c3);
}

/// The three coefficients at a time: a sum waits for its additions, three of them do not.
void AngleMapper::Impl::blur_along_x(int row, int y) {
  const float *in1 = row_[0].row(row), *in2 = row_[1].row(row), *in3 = row_[2].row(row);
  for (int x = 0; x < box_.width(); x += kPack) {
    Pack sum1 = blur_[0] * load(in1 + x), sum2 = blur_[0] * load(in2 + x);
    Pack sum3 = blur_[0] * load(in3 + x);
    for (int n = 1; n <= reach(); ++n) {
      const float tap = blur_[std::size_t(n)];
      sum1 += tap * (load(in1 + x + n) + load(in1 + x - n));
      sum2 += tap * (load(in2 + x + n) + load(in2 + x - n));
      sum3 += tap * (load(in3 + x + n) + load(in3 + x - n));
    }
    store(blurred(0, y) + x, sum1);
    store(blurred(1, y) + x, sum2);
    store(blurred(2, y) + x, sum3);
  }
}

/// A row of the blurred coefficients outside the box.
void AngleMapper::Impl::darken(int y) {
  for (std::size_t k = 0; k < 3; ++k)
    std::fill_n(blurred(k, y), detail::round_up(box_.width()), 0.0f);
}

/// Of kRowsTogether rows from y on.
void AngleMapper::Impl::blur_along_y(int y) {
  for (std::size_t k = 0; k < 3; ++k) {
    columns_[k].clear();
    for (int i = y - reach(); i < y + reach() + kRowsTogether; ++i)
      columns_[k].push_back(blurred(k, i));
  }
  for (int x = 0; x < box_.width(); x += kPack)
    for (int row = 0; row < kRowsTogether; row += 2)
      for (std::size_t k = 0; k < 3; ++k) {
        const RowPair sums = even_sums(blur_, columns_[k].data() + reach() + row, x);
        store(row_[k].row(row) + x, sums.upper);
        store(row_[k].row(row + 1) + x, sums.lower);
      }
}

/// The angle, from a row of blurred coefficients. C2 and C3 point across the stripes; a quarter
/// turn is a change of both signs.
void AngleMapper::Impl::finish(int row, int y) {
  if (y < 0 || y >= box_.height()) return;
  const float* inside = inside_.row(y);
  float* angle = &map_.angle(box_.y0 + y, box_.x0);
  float* strength = &map_.strength(box_.y0 + y, box_.x0);
  float* coherence = coherence_.row(y);
  // In packs, and the square root (which the compiler leaves alone) apart from the rest. Eigen's is
  // not rounded correctly.
  for (int x = 0; x < box_.width(); x += kPack) {
    const Pack c1 = load(row_[0].row(row) + x), c2 = load(row_[1].row(row) + x);
    const Pack c3 = load(row_[2].row(row) + x), in = load(inside + x);
    const Pack square = c2 * c2 + c3 * c3;
    Pack amplitude, half;
    for (int i = 0; i < kPack; ++i) amplitude[i] = std::sqrt(square[i]);
    for (int i = 0; i < kPack; ++i) half[i] = half_atan2(-c3[i], -c2[i]);
    store(coherence + x, amplitude / (c1 + 1e-20f));
    // The last pack may be longer than the row of the map.
    const int count = std::min(kPack, box_.width() - x);
    const Pack turned = in * half, strong = in * amplitude;
    std::copy_n(turned.data(), count, angle + x);
    std::copy_n(strong.data(), count, strength + x);
  }
}

/// Keeps the angles of pixels whose strength and coherence reach their thresholds. The 95th
/// percentile is taken over every third pixel.
void AngleMapper::Impl::drop_undefined() {
  sample_.clear();
  for (int y = 0; y < box_.height(); ++y) {
    const float* inside = inside_.row(y);
    const float* strength = &map_.strength(box_.y0 + y, box_.x0);
    const std::size_t before = sample_.size();
    sample_.resize(before + std::size_t(box_.width()));
    float* next = sample_.data() + before;
    for (int x = y % 3; x < box_.width(); x += 3) {
      *next = strength[x];
      next += inside[x] > 0;
    }
    sample_.resize(std::size_t(next - sample_.data()));
  }
  if (sample_.empty()) {
    map_.valid.block(box_.y0, box_.x0, box_.height(), box_.width()).setZero();
    return;
  }
  const float strong = ranked(sample_, std::size_t(0.95 * double(sample_.size() - 1)));
  const float least_strength = std::max(float(options_.energy_threshold) * strong, kLeastStrength);
  const float least_coherence = float(options_.coherence_threshold) * kGratingCoherence;
  for (int y = 0; y < box_.height(); ++y) {
    const float* strength = &map_.strength(box_.y0 + y, box_.x0);
    const float* coherence = coherence_.row(y);
    std::uint8_t* valid = &map_.valid(box_.y0 + y, box_.x0);
    for (int x = 0; x < box_.width(); ++x)
      valid[x] = ((strength[x] >= least_strength) & (coherence[x] >= least_coherence)) ? 1 : 0;
  }
}

const AngleMap& AngleMapper::Impl::compute(const Image& intensity, const Mask& region) {
  check(intensity, region);
  const Box last = box_;
  box_ = region.size() == 0 ? Box{0, 0, width_, height_} : detail::bounding_box(region);
  clear_outputs(last);
  if (box_.empty()) return map_;
  for (Plane& rows : filtered_) rows.resize_unfilled(ring_rows(), box_.width(), 0);
  for (Plane& rows : row_) rows.resize_unfilled(kRowsTogether, box_.width(), reach());
  for (Plane& rows : blurred_) rows.resize_unfilled(blurred_rows(), box_.width(), 0);
  coherence_.resize_unfilled(box_.height(), box_.width(), 0);

  set_inside(region);
  normalise(intensity);
  for (int y = -radius_; y < radius_; ++y) filter_along_x(y);
  for (int y = -reach(); y < 0; ++y) darken(y);
  for (int y = 0; y < box_.height() + reach(); y += kRowsTogether) {
    if (y < box_.height()) {
      for (int k = 0; k < kRowsTogether; ++k) filter_along_x(y + radius_ + k);
      combine(y);
    } else {
      for (int k = 0; k < kRowsTogether; ++k) darken(y + k);
    }
    blur_along_y(y - reach());
    for (int k = 0; k < kRowsTogether; ++k) finish(k, y - reach() + k);
  }
  drop_undefined();
  return map_;
}

AngleMapper::AngleMapper(int width, int height, const AngleMapOptions& options)
    : impl_(std::make_unique<Impl>(width, height, options)) {}
AngleMapper::~AngleMapper() = default;
AngleMapper::AngleMapper(AngleMapper&&) noexcept = default;

const AngleMap& AngleMapper::compute(const Image& intensity, const Mask& region) {
  return impl_->compute(intensity, region);
}

float orientation_difference(float a, float b) {
  float d = a - b;
  // One turn, which is exact, is what differences of two orientations need.
  if (!(std::abs(d) <= kPi))
    d = std::remainder(d, kPi);
  else if (std::abs(d) > kPi / 2)
    d = d > 0 ? d - kPi : d + kPi;
  return d <= -kPi / 2 ? d + kPi : d;
}

Mask gradient_mask(const AngleMap& map, double threshold) {
  if (!(threshold >= 0)) throw Error("gradient mask: threshold must be at least 0 rad/px");
  const Eigen::Index rows = map.angle.rows(), columns = map.angle.cols();
  Mask mask = Mask::Zero(rows, columns);
  const auto valid = [&](Eigen::Index y, Eigen::Index x) {
    return y >= 0 && x >= 0 && y < rows && x < columns && map.valid(y, x) != 0;
  };
  // The chain rule on (cos 2a, sin 2a) amounts to wrapped differences; one-sided next to pixels
  // without an angle.
  const auto slope = [&](Eigen::Index y, Eigen::Index x, Eigen::Index dy, Eigen::Index dx) {
    const bool after = valid(y + dy, x + dx), before = valid(y - dy, x - dx);
    const float here = map.angle(y, x);
    const float forward = after ? orientation_difference(map.angle(y + dy, x + dx), here) : 0.0f;
    const float backward = before ? orientation_difference(here, map.angle(y - dy, x - dx)) : 0.0f;
    return after && before ? 0.5f * (forward + backward) : forward + backward;
  };
  for (Eigen::Index y = 0; y < rows; ++y)
    for (Eigen::Index x = 0; x < columns; ++x) {
      if (map.valid(y, x) == 0) continue;
      const double gx = double(slope(y, x, 0, 1)), gy = double(slope(y, x, 1, 0));
      mask(y, x) = gx * gx + gy * gy >= threshold * threshold ? 1 : 0;
    }
  return mask;
}

}  // namespace weft
