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

/// Products of taps with in[x - n step] and in[x + n step], for even and odd rows of taps.
Pack even_taps(const Taps& taps, const float* in, std::ptrdiff_t step) {
  Pack sum = taps[0] * load(in);
  for (std::size_t n = 1; n < taps.size(); ++n) {
    const std::ptrdiff_t offset = std::ptrdiff_t(n) * step;
    sum += taps[n] * (load(in + offset) + load(in - offset));
  }
  return sum;
}

}  // namespace

struct AngleMapper::Impl {
  Impl(int width_px, int height_px, const AngleMapOptions& given);
  const AngleMap& compute(const Image& intensity, const Mask& region);

 private:
  void check(const Image& intensity, const Mask& region) const;
  void clear_outputs();
  void set_inside(const Mask& region);
  void normalise(const Image& intensity);
  void filter_along_x(int y);
  void combine(int y);
  void finish(int y);
  void drop_undefined();
  float* ring(std::size_t factor, int y) {
    return filtered_[factor].row((y + 2 * radius_ + 1) % (2 * radius_ + 1));
  }

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
  std::array<Plane, 3> row_;  ///< one row of C1, C2, C3
  std::array<Plane, 3>
      blurred_;  ///< C1, C2, C3 blurred along x; blur radius rows more at both ends
  Plane coherence_;
  std::array<Plane, 5> filtered_;  ///< the last 2 radius + 1 rows of e, u1, g2, h2, h3 along x
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

void AngleMapper::Impl::clear_outputs() {
  if (box_.empty()) return;
  map_.angle.block(box_.y0, box_.x0, box_.height(), box_.width()).setZero();
  map_.strength.block(box_.y0, box_.x0, box_.height(), box_.width()).setZero();
  map_.valid.block(box_.y0, box_.x0, box_.height(), box_.width()).setZero();
}

/// The region less the pixels that touch its outside, which are partly background. The frame's
/// border is no rim.
void AngleMapper::Impl::set_inside(const Mask& region) {
  inside_.resize(box_.height(), box_.width(), 0);
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
    for (int x = box_.x0; x < box_.x1; ++x) {
      const int left = std::max(x - 1, 0), right = std::min(x + 1, width_ - 1);
      const bool core = (here[x] != 0) & (above[x] != 0) & (below[x] != 0) & (here[left] != 0) &
                        (here[right] != 0);
      out[x - box_.x0] = core ? 1.0f : 0.0f;
    }
  }
}

/// Light relative to its local mean: what shading and albedo multiply cancels, and neither the
/// silhouette nor a shadow's edge is a step between levels that have nothing to do with stripes.
void AngleMapper::Impl::normalise(const Image& intensity) {
  mean_.update(intensity, inside_, box_);
  const auto row_in = [&](int y) {
    return intensity.data() + (box_.y0 + y) * intensity.cols() + box_.x0;
  };
  double total = 0, pixels = 0;
  for (int y = 0; y < box_.height(); ++y) {
    const float* in = row_in(y);
    const float* inside = inside_.row(y);
    float light = 0, count = 0;
    for (int x = 0; x < box_.width(); ++x) {
      light += inside[x] * in[x];
      count += inside[x];
    }
    total += double(light);
    pixels += double(count);
  }
  const float floor = std::max(kMeanFloor * float(total / std::max(pixels, 1.0)), 1e-6f);
  light_.resize(box_.height(), box_.width(), radius_);
  double squares = 0;
  for (int y = 0; y < box_.height(); ++y) {
    const float* in = row_in(y);
    const float* inside = inside_.row(y);
    float* mean = row_[0].row(0);
    float* out = light_.row(y);
    mean_.row(box_.y0 + y, mean);
    float sum = 0;
    for (int x = 0; x < box_.width(); ++x) {
      out[x] = inside[x] * (in[x] - mean[x]) / (mean[x] + floor);
      sum += out[x] * out[x];
    }
    squares += double(sum);
  }
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

/// The factors along y, the coefficients of the oriented energy, and their blur along x.
///
/// As functions of the direction t, G2 = p + q cos 2t + r sin 2t and H2 = a1 cos t + b1 sin t +
/// a3 cos 3t + b3 sin 3t. Of G2^2 + H2^2, C1 is the mean and C2, C3 the coefficients of cos 2t and
/// sin 2t. All are divided by C1 and a floor, so that bright, dark, sharp and blurred stripes count
/// alike in the blur.
void AngleMapper::Impl::combine(int y) {
  const SteerableBasis& b = basis_;
  const float* e0 = ring(0, y);
  const float* u0 = ring(1, y);
  const float* g0 = ring(2, y);
  const float* h0 = ring(3, y);
  const float* t0 = ring(4, y);
  const float* inside = inside_.row(y);
  const std::array<float*, 3> out{row_[0].row(0), row_[1].row(0), row_[2].row(0)};
  std::array<std::ptrdiff_t, 65> after{}, before{};
  for (int n = 1; n <= radius_; ++n) {
    after[std::size_t(n)] = ring(0, y + n) - e0;
    before[std::size_t(n)] = ring(0, y - n) - e0;
  }
  for (int x = 0; x < box_.width(); x += kPack) {
    const Pack e = load(e0 + x), u = load(u0 + x);
    Pack ga = b.e[0] * load(g0 + x), gb = Pack::Zero(), gc = b.g2[0] * e;
    Pack ha = b.e[0] * load(t0 + x), hb = Pack::Zero(), hc = b.h2[0] * u, hd = Pack::Zero();
    for (int n = 1; n <= radius_; ++n) {
      const auto i = std::size_t(n);
      const std::ptrdiff_t above = before[i] + x, below = after[i] + x;
      const Pack e_below = load(e0 + below), e_above = load(e0 + above);
      const Pack u_below = load(u0 + below), u_above = load(u0 + above);
      ga += b.e[i] * (load(g0 + below) + load(g0 + above));
      ha += b.e[i] * (load(t0 + below) + load(t0 + above));
      gb += b.u1[i] * (u_below - u_above);
      hb += b.u1[i] * (load(h0 + below) - load(h0 + above));
      gc += b.g2[i] * (e_below + e_above);
      hc += b.h2[i] * (u_below + u_above);
      hd += b.h3[i] * (e_below - e_above);
    }
    const Pack p = 0.5f * (ga + gc), q = 0.5f * (ga - gc), r = 2.0f * gb;
    const Pack a1 = 0.75f * (ha + hc), b1 = 0.75f * (hb + hd);
    const Pack a3 = 0.25f * ha - 0.75f * hc, b3 = 0.75f * hb - 0.25f * hd;
    const float gg = b.gain_g * b.gain_g, hh = b.gain_h * b.gain_h;
    const Pack c1 = gg * (p * p + 0.5f * (q * q + r * r)) +
                    hh * (0.5f * (a1 * a1 + b1 * b1 + a3 * a3 + b3 * b3));
    const Pack c2 = gg * (2.0f * p * q) + hh * (0.5f * (a1 * a1 - b1 * b1) + a1 * a3 + b1 * b3);
    const Pack c3 = gg * (2.0f * p * r) + hh * (a1 * b1 + a1 * b3 - b1 * a3);
    const Pack weight = load(inside + x) / (c1 + energy_floor_);
    store(out[0] + x, weight * c1);
    store(out[1] + x, weight * c2);
    store(out[2] + x, weight * c3);
  }
  const int reach = int(blur_.size()) - 1;
  for (std::size_t k = 0; k < 3; ++k)
    for (int x = 0; x < box_.width(); x += kPack)
      store(blurred_[k].row(y + reach) + x, even_taps(blur_, out[k] + x, 1));
}

/// The blur along y and the angle. C2 and C3 point across the stripes; a quarter turn is a change
/// of both signs.
void AngleMapper::Impl::finish(int y) {
  const int reach = int(blur_.size()) - 1;
  for (std::size_t k = 0; k < 3; ++k) {
    const float* in = blurred_[k].row(y + reach);
    const std::ptrdiff_t stride = blurred_[k].row(1) - blurred_[k].row(0);
    for (int x = 0; x < box_.width(); x += kPack)
      store(row_[k].row(0) + x, even_taps(blur_, in + x, stride));
  }
  const float* c1 = row_[0].row(0);
  const float* c2 = row_[1].row(0);
  const float* c3 = row_[2].row(0);
  const float* inside = inside_.row(y);
  float* coherence = coherence_.row(y);
  float* angle = &map_.angle(box_.y0 + y, box_.x0);
  float* strength = &map_.strength(box_.y0 + y, box_.x0);
  for (int x = 0; x < box_.width(); ++x) {
    const float amplitude = std::sqrt(c2[x] * c2[x] + c3[x] * c3[x]);
    angle[x] = inside[x] * half_atan2(-c3[x], -c2[x]);
    strength[x] = inside[x] * amplitude;
    coherence[x] = amplitude / (c1[x] + 1e-20f);
  }
}

/// Keeps the angles of pixels whose strength and coherence reach their thresholds. The 95th
/// percentile is taken over every third pixel.
void AngleMapper::Impl::drop_undefined() {
  sample_.clear();
  for (int y = 0; y < box_.height(); ++y) {
    const float* inside = inside_.row(y);
    const float* strength = &map_.strength(box_.y0 + y, box_.x0);
    for (int x = y % 3; x < box_.width(); x += 3)
      if (inside[x] > 0) sample_.push_back(strength[x]);
  }
  if (sample_.empty()) return;
  const auto at = sample_.begin() + std::ptrdiff_t(0.95 * double(sample_.size() - 1));
  std::nth_element(sample_.begin(), at, sample_.end());
  const float least_strength = std::max(float(options_.energy_threshold) * *at, kLeastStrength);
  const float least_coherence = float(options_.coherence_threshold) * kGratingCoherence;
  for (int y = 0; y < box_.height(); ++y) {
    const float* strength = &map_.strength(box_.y0 + y, box_.x0);
    const float* coherence = coherence_.row(y);
    std::uint8_t* valid = &map_.valid(box_.y0 + y, box_.x0);
    for (int x = 0; x < box_.width(); ++x)
      valid[x] = (strength[x] >= least_strength) & (coherence[x] >= least_coherence) ? 1 : 0;
  }
}

const AngleMap& AngleMapper::Impl::compute(const Image& intensity, const Mask& region) {
  check(intensity, region);
  clear_outputs();
  box_ = region.size() == 0 ? Box{0, 0, width_, height_} : detail::bounding_box(region);
  if (box_.empty()) return map_;
  const int reach = int(blur_.size()) - 1;
  for (Plane& rows : filtered_) rows.resize(2 * radius_ + 1, box_.width(), 0);
  for (Plane& row : row_) row.resize(1, box_.width(), reach);
  for (Plane& plane : blurred_) plane.resize(box_.height() + 2 * reach, box_.width(), 0);
  coherence_.resize(box_.height(), box_.width(), 0);

  set_inside(region);
  normalise(intensity);
  for (int y = -radius_; y < radius_; ++y) filter_along_x(y);
  for (int y = 0; y < box_.height(); ++y) {
    filter_along_x(y + radius_);
    combine(y);
  }
  for (int y = 0; y < box_.height(); ++y) finish(y);
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
  const float d = std::remainder(a - b, kPi);
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
