#include "weft/objective/residuals.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "weft/base/error.h"
#include "weft/objective/residual_patches.h"
#include "weft/objective/residuals_motion.h"
#include "weft/vision/plane.h"
#include "weft/vision/steerable_basis.h"

namespace weft {
namespace {

using detail::Box;
using detail::kPack;
using detail::load;
using detail::Pack;
using detail::Plane;
using detail::store;
using detail::Taps;

void require(bool ok, const char* name, double value, const char* range) {
  if (!ok) throw Error(fmt::format("residuals: {} is {:g}, must be {}", name, value, range));
}

/// A silhouette blurred by a Gaussian. Keeps its buffers.
///
/// Most of it is flat: where all that the blur reaches is cloth, or nothing is, the sum of taps is
/// known.
class SoftCoverage {
 public:
  explicit SoftCoverage(double sigma) : taps_(detail::gaussian_taps(sigma)) {
    along_cloth_ = sum_of_alike(1);
    in_cloth_ = sum_of_alike(along_cloth_);
  }
  int reach() const { return int(taps_.size()) - 1; }

  enum Kind : std::uint8_t { nothing, cloth, mixed };

  /// Coverage of the pixels of `box`, 0 to 1; outside the image there is no cloth.
  void blur(const Mask& mask, const Box& box) {
    packs_ = detail::round_up(box.width()) / kPack;
    const int rows = box.height() + 2 * reach();
    bytes_.resize(std::size_t((packs_ + 2 * beside()) * kPack));
    line_.resize_unfilled(1, box.width() + 2 * reach(), reach());
    along_.resize_unfilled(rows, box.width(), 0);
    out_.resize_unfilled(box.height(), box.width(), 0);
    kinds_.resize(std::size_t(box.height() * packs_));
    kinds_in_row_.resize(std::size_t(packs_ + 2 * beside()));
    alike_.assign(std::size_t(packs_), {});
    for (int i = 0; i < rows; ++i) {
      blur_along_x(mask, box, i);
      if (i >= 2 * reach()) blur_along_y(i - 2 * reach());
    }
  }
  const float* row(int i) const { return out_.row(i); }
  /// What lies around the pixels of pack p of a row: all cloth, nothing, or this and that. The
  /// coverage of all is the same where it is one of the first two.
  Kind kind(int i, int p) const { return kinds_[std::size_t(i * packs_ + p)]; }

 private:
  /// Rows above one another whose packs are all of one kind.
  struct Alike {
    Kind kind = mixed;
    int rows = 0;
  };
  /// Packs on either side that the blur reaches.
  int beside() const { return (reach() + kPack - 1) / kPack; }

  float sum_of_alike(float value) const {
    float sum = taps_[0] * value;
    for (std::size_t n = 1; n < taps_.size(); ++n) sum += taps_[n] * (value + value);
    return sum;
  }
  Pack taps_sum(const float* in, std::ptrdiff_t step) const {
    Pack sum = taps_[0] * load(in);
    for (std::size_t n = 1; n < taps_.size(); ++n) {
      const std::ptrdiff_t offset = std::ptrdiff_t(n) * step;
      sum += taps_[n] * (load(in + offset) + load(in - offset));
    }
    return sum;
  }

  /// Copies the row and finds out of which kind its packs are; false: nothing is there.
  bool read_row(const Mask& mask, const Box& box, int y) {
    if (y < 0 || y >= int(mask.rows())) return false;
    const int left = box.x0 - beside() * kPack, right = left + int(bytes_.size());
    const int first = std::clamp(left, 0, int(mask.cols()));
    const int last = std::clamp(right, 0, int(mask.cols()));
    std::fill(bytes_.begin(), bytes_.begin() + (first - left), std::uint8_t{0});
    std::fill(bytes_.end() - (right - last), bytes_.end(), std::uint8_t{0});
    const std::uint8_t* in = mask.data() + y * mask.cols();
    std::transform(in + first, in + last, bytes_.begin() + (first - left),
                   [](std::uint8_t inside) { return std::uint8_t(inside != 0); });
    bool something = false;
    for (std::size_t p = 0; p < kinds_in_row_.size(); ++p) {
      std::array<std::uint64_t, 2> eight;
      static_assert(sizeof eight == kPack);
      std::memcpy(&eight, &bytes_[p * kPack], sizeof eight);
      const bool any = (eight[0] | eight[1]) != 0;
      const bool all = (eight[0] & eight[1]) == 0x0101010101010101u;
      kinds_in_row_[p] = !any ? nothing : all ? cloth : mixed;
      something = something || any;
    }
    return something;
  }

  void blur_along_x(const Mask& mask, const Box& box, int i) {
    float* out = along_.row(i);
    if (!read_row(mask, box, box.y0 - reach() + i)) {
      std::fill_n(out, packs_ * kPack, 0.0f);
      for (Alike& alike : alike_) add_row(alike, nothing);
      return;
    }
    float* line = line_.row(0);
    const std::uint8_t* in = bytes_.data() + beside() * kPack;
    for (int x = -reach(); x < packs_ * kPack + reach(); ++x) line[x] = float(in[x]);
    for (int p = 0; p < packs_; ++p) {
      Kind kind = kinds_in_row_[std::size_t(p)];
      for (int k = 1; k <= 2 * beside(); ++k)
        if (kinds_in_row_[std::size_t(p + k)] != kind) kind = mixed;
      add_row(alike_[std::size_t(p)], kind);
      if (kind == mixed)
        store(out + p * kPack, taps_sum(line + p * kPack, 1));
      else
        std::fill_n(out + p * kPack, kPack, kind == cloth ? along_cloth_ : 0.0f);
    }
  }
  static void add_row(Alike& alike, Kind kind) {
    alike.rows = alike.kind == kind ? alike.rows + 1 : 1;
    alike.kind = kind;
  }

  void blur_along_y(int i) {
    const std::ptrdiff_t stride = along_.row(1) - along_.row(0);
    float* out = out_.row(i);
    for (int p = 0; p < packs_; ++p) {
      const Alike& alike = alike_[std::size_t(p)];
      const Kind kind = alike.rows > 2 * reach() ? alike.kind : mixed;
      kinds_[std::size_t(i * packs_ + p)] = kind;
      if (kind == mixed)
        store(out + p * kPack, taps_sum(along_.row(i + reach()) + p * kPack, stride));
      else
        std::fill_n(out + p * kPack, kPack, kind == cloth ? in_cloth_ : 0.0f);
    }
  }

  const Taps taps_;
  float along_cloth_ = 1, in_cloth_ = 1;  ///< cloth blurred along x, along both
  int packs_ = 0;
  std::vector<std::uint8_t> bytes_;  ///< a row of the mask, from some packs left of the box
  Plane line_, along_, out_;
  std::vector<Kind> kinds_in_row_;  ///< of the packs of `bytes_`
  std::vector<Alike> alike_;
  std::vector<Kind> kinds_;
};

Box enclosing(const Box& a, const Box& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.x0, b.x0), std::min(a.y0, b.y0), std::max(a.x1, b.x1), std::max(a.y1, b.y1)};
}

Box grown(const Box& box, int by, int width, int height) {
  if (box.empty()) return box;
  return {std::max(box.x0 - by, 0), std::max(box.y0 - by, 0), std::min(box.x1 + by, width),
          std::min(box.y1 + by, height)};
}

RenderOptions with_rows(RenderOptions render, bool wanted) {
  render.projector_row = wanted;
  return render;
}

/// Cauchy's loss of a residual.
double loss(double r, double scale) {
  return std::isinf(scale) ? r * r : scale * scale * std::log1p(r * r / (scale * scale));
}
/// Its derivative by r^2.
double loss_slope(double r, double scale) {
  return std::isinf(scale) ? 1 : 1 / (1 + r * r / (scale * scale));
}
/// Its mean over residuals that are spread evenly over (-pi, pi].
double mean_phase_loss(double s) {
  constexpr double pi = std::numbers::pi;
  if (s > 1e3) return pi * pi / 3;  // to 1e-6; below, terms would cancel
  return s * s * (std::log1p(pi * pi / (s * s)) - 2 + 2 * s / pi * std::atan(pi / s));
}

/// Projector row of the surface at a point between the pixel centres of a column; false where no
/// lit surface is. Pixels on either side of a jump by more than half a period belong to different
/// pieces of cloth: the nearer one counts.
bool row_at(const Image& rows, const PhaseSample& sample, double largest_jump, double& row,
            Vec2& slope) {
  const int height = int(rows.rows()), width = int(rows.cols());
  const double position = double(sample.y) - 0.5;
  const int above = int(std::floor(position)), nearest = int(std::lround(position));
  if (sample.column < 0 || sample.column >= width || nearest < 0 || nearest >= height) return false;
  const double here = double(rows(nearest, sample.column));
  if (!std::isfinite(here)) return false;
  const auto step = [&](int i, int j) {  // NaN: not the same piece of cloth
    if (i < 0 || j < 0 || i >= height || j >= width)
      return std::numeric_limits<double>::quiet_NaN();
    const double change = double(rows(i, j)) - here;
    return std::abs(change) < largest_jump ? change : std::numeric_limits<double>::quiet_NaN();
  };
  // Down the column: across the pixel boundary between which the point lies.
  const int other = nearest == above ? above + 1 : above;
  const double down = step(other, sample.column) * (other - nearest);
  const double after = step(nearest, sample.column + 1), before = -step(nearest, sample.column - 1);
  slope.y() = std::isfinite(down) ? down : 0;
  if (std::isfinite(after))
    slope.x() = std::isfinite(before) ? 0.5 * (after + before) : after;
  else
    slope.x() = std::isfinite(before) ? before : 0;
  row = here + (position - nearest) * slope.y();
  return true;
}

/// Coverage this far from 0 and 1 belongs to an outline.
constexpr float kCoverageFloor = 1e-3f;

}  // namespace

/// Renders, compares, differentiates.
class FrameComparison {
 public:
  FrameComparison(const Rig& rig, const TriangleMesh& mesh, const RenderOptions& render,
                  const AngleMapOptions& angle_map, const ResidualOptions& given);

  FrameCost look(const FrameFeatures& measured, const Points& x);
  FrameLinearization linearize(const FrameFeatures& measured, const Points& x,
                               const MatX& directions);
  PatchLinearization linearize(const FrameFeatures& measured, const Points& x,
                               const MatX& directions, const PatchGrid& grid);

 private:
  FrameCost differentiate_all(const FrameFeatures& measured, const Points& x,
                              const MatX& directions);
  std::vector<std::vector<Eigen::Index>> residuals_by_patch(const PatchGrid& grid) const;
  double collect_folds(const FrameFeatures& measured, const AngleMap& simulated);
  double collect_outlines(const FrameFeatures& measured, const Mask& silhouette);
  double collect_outlines(int i, int first, int last, double cost);
  double collect_phase(const FrameFeatures& measured, const Image& rows, FrameCost& cost);
  double fastest_motion(const Points& x, const Eigen::Ref<const VecX>& direction) const;
  void differentiate_stripes(const Points& x, const MatX& directions);
  void follow_folds(const Points& x, const MatX& directions);
  void follow_outlines();
  void follow_phase(const Points& x, const MatX& directions);
  Eigen::Index first_phase() const { return Eigen::Index(pixels_.size() + outline_.size()); }
  Vec2 angle_gradient(int row, int column) const;
  void differentiate(const Points& x, const Eigen::Ref<const VecX>& direction, Eigen::Index column);
  Eigen::Index residual_count() const { return first_phase() + Eigen::Index(edges_.size()); }

  Projection camera_;
  int width_, height_;
  ResidualOptions options_;
  double share_;         ///< pixels that one with derivatives stands for
  double period_;        ///< of the stripes, projector px
  double unseen_phase_;  ///< loss of an edge without simulated cloth
  Renderer renderer_;
  AngleMapper mapper_;
  detail::StripeMotion motion_;
  const AngleMap* simulated_ = nullptr;  ///< of the last look
  SoftCoverage measured_coverage_, coverage_;
  Box box_;  ///< of the outlines
  int margin_;
  // Of the last look: pixels of fold terms with their angle, then pixels of outlines with their
  // coverage, then edges.
  std::vector<Eigen::Index> pixels_;
  std::vector<float> angles_;
  struct OutlinePixel {
    int row, column;  ///< of box_
    float coverage;
  };
  std::vector<OutlinePixel> outline_;
  struct SeenEdge {
    PhaseSample sample;
    double row;  ///< projector row of the simulated surface there
    Vec2 slope;  ///< its gradient in the image
  };
  std::vector<SeenEdge> edges_;
  std::vector<double> residuals_, weights_;  ///< folds, then outlines, then phases
  Points moved_;
  MatX jacobian_, weighted_;  ///< one frame's: its pixels x directions
};

FrameComparison::FrameComparison(const Rig& rig, const TriangleMesh& mesh,
                                 const RenderOptions& render, const AngleMapOptions& angle_map,
                                 const ResidualOptions& given)
    : camera_(rig.camera.projection()),
      width_(rig.width),
      height_(rig.height),
      options_(given),
      share_(double(given.stride) * given.stride),
      period_(rig.pattern.period),
      unseen_phase_(mean_phase_loss(given.phase_scale)),
      renderer_(rig, mesh, with_rows(render, given.phase_weight > 0)),
      mapper_(rig.width, rig.height, angle_map),
      motion_(rig, mesh),
      measured_coverage_(given.silhouette_sigma),
      coverage_(given.silhouette_sigma),
      margin_(coverage_.reach() + int(std::ceil(given.image_step)) + 1) {}

FrameCost FrameComparison::look(const FrameFeatures& measured, const Points& x) {
  const RenderedFrame& image = renderer_.render(x);
  const AngleMap& simulated = mapper_.compute(image.intensity, image.silhouette);
  simulated_ = &simulated;
  FrameCost result;
  result.error = compare(measured, simulated, image.silhouette);
  residuals_.clear();
  weights_.clear();
  result.fold_cost = collect_folds(measured, simulated);
  result.silhouette_cost = collect_outlines(measured, image.silhouette);
  result.phase_cost = collect_phase(measured, image.projector_row, result);
  result.cost = result.fold_cost + result.silhouette_cost + result.phase_cost;
  return result;
}

/// Returns their cost; fills in the counts.
double FrameComparison::collect_phase(const FrameFeatures& measured, const Image& rows,
                                      FrameCost& counts) {
  edges_.clear();
  if (options_.phase_weight == 0) return 0;
  counts.phase_samples = int(measured.phase.size());
  double cost = 0;
  SeenEdge edge;
  for (const PhaseSample& sample : measured.phase) {
    edge.sample = sample;
    if (!row_at(rows, sample, 0.5 * period_, edge.row, edge.slope)) {
      cost += unseen_phase_;
      continue;
    }
    ++counts.phase_seen;
    constexpr double turn = 2 * std::numbers::pi;
    const double r = std::remainder(turn * edge.row / period_ - double(sample.phase), turn);
    cost += loss(r, options_.phase_scale);
    if (sample.column % options_.stride != 0) continue;
    edges_.push_back(edge);
    residuals_.push_back(r);
    weights_.push_back(options_.stride * options_.phase_weight *
                       loss_slope(r, options_.phase_scale));
  }
  return options_.phase_weight * cost;
}

/// Returns their cost.
double FrameComparison::collect_folds(const FrameFeatures& measured, const AngleMap& simulated) {
  pixels_.clear();
  angles_.clear();
  if (options_.fold_weight == 0) return 0;
  double cost = 0;
  const Eigen::Index count = Eigen::Index(height_) * width_;
  const auto both = [&](Eigen::Index i) {
    return measured.fold_mask.data()[i] & measured.angles.valid.data()[i] &
           simulated.valid.data()[i];
  };
  constexpr Eigen::Index kTogether = 32;
  for (Eigen::Index first = 0; first < count; first += kTogether) {
    const Eigen::Index last = std::min(first + kTogether, count);
    if (last - first == kTogether) {
      int any = 0;
      for (Eigen::Index k = 0; k < kTogether; ++k) any |= both(first + k);
      if (!any) continue;
    }
    for (Eigen::Index i = first; i < last; ++i) {
      if (!both(i)) continue;
      const int row = int(i / width_), column = int(i % width_);
      const float angle = simulated.angle.data()[i];
      const double r = double(orientation_difference(angle, measured.angles.angle.data()[i]));
      cost += loss(r, options_.fold_scale);
      if (row % options_.stride != 0 || column % options_.stride != 0) continue;
      pixels_.push_back(i);
      angles_.push_back(angle);
      residuals_.push_back(r);
      weights_.push_back(share_ * options_.fold_weight * loss_slope(r, options_.fold_scale));
    }
  }
  return options_.fold_weight * cost;
}

/// Returns their cost.
double FrameComparison::collect_outlines(const FrameFeatures& measured, const Mask& silhouette) {
  outline_.clear();
  if (options_.alpha == 0) return 0;
  box_ =
      grown(enclosing(detail::bounding_box(measured.silhouette), detail::bounding_box(silhouette)),
            margin_, width_, height_);
  if (box_.empty()) return 0;
  measured_coverage_.blur(measured.silhouette, box_);
  coverage_.blur(silhouette, box_);
  double cost = 0;
  for (int i = 0; i < box_.height(); ++i)
    for (int j = 0; j < box_.width(); j += kPack) {
      const SoftCoverage::Kind kind = coverage_.kind(i, j / kPack);
      const bool same = kind == measured_coverage_.kind(i, j / kPack);
      if (same && kind != SoftCoverage::mixed) continue;  // no outline, no difference
      cost = collect_outlines(i, j, std::min(j + kPack, box_.width()), cost);
    }
  return options_.alpha * cost;
}

/// Of the pixels first..last - 1 of row i of the box; returns `cost` with theirs added.
double FrameComparison::collect_outlines(int i, int first, int last, double cost) {
  const float* seen = measured_coverage_.row(i);
  const float* simulated = coverage_.row(i);
  const bool sampled = (box_.y0 + i) % options_.stride == 0;
  for (int j = first; j < last; ++j) {
    const float s = simulated[j], difference = s - seen[j];
    cost += double(difference * difference);
    if (!sampled || (box_.x0 + j) % options_.stride != 0) continue;
    if (std::abs(difference) < kCoverageFloor && std::min(s, 1 - s) < kCoverageFloor) continue;
    outline_.push_back({i, j, s});
    residuals_.push_back(double(difference));
    weights_.push_back(share_ * options_.alpha);
  }
  return cost;
}

/// Of the vertices along `direction`, px per unit; motion along the ray counts like motion across
/// it (it moves the stripes).
double FrameComparison::fastest_motion(const Points& x,
                                       const Eigen::Ref<const VecX>& direction) const {
  double fastest = 0;
  for (Eigen::Index v = 0; v < x.cols(); ++v) {
    const Vec3 image = camera_ * x.col(v).homogeneous();
    if (!(image.z() > 1e-6)) continue;
    const Vec3 gradient =
        (camera_.block<1, 3>(0, 0) - image.x() / image.z() * camera_.block<1, 3>(2, 0))
            .transpose() /
        image.z();
    fastest = std::max(fastest, gradient.norm() * direction.segment<3>(3 * v).norm());
  }
  return std::isfinite(fastest) ? fastest : 0;
}

void FrameComparison::differentiate(const Points& x, const Eigen::Ref<const VecX>& direction,
                                    Eigen::Index column) {
  auto derivative = jacobian_.col(column);
  const double fastest = fastest_motion(x, direction);
  if (!(fastest > 1e-9)) {
    derivative.setZero();
    return;
  }
  const double step = options_.image_step / fastest;
  moved_ = x;
  flat(moved_) += step * direction;
  const RenderedFrame& image = renderer_.render(moved_);
  const AngleMap& simulated = mapper_.compute(image.intensity, image.silhouette);
  const auto largest = float(options_.largest_turn * options_.image_step);
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const Eigen::Index at = pixels_[i];
    const float change = orientation_difference(simulated.angle.data()[at], angles_[i]);
    const bool follows = simulated.valid.data()[at] != 0 && std::abs(change) <= largest;
    derivative[Eigen::Index(i)] = follows ? double(change) / step : 0;
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    double row = 0;
    Vec2 slope;
    const double turn = 2 * std::numbers::pi / period_;
    const bool seen = row_at(image.projector_row, edges_[i].sample, 0.5 * period_, row, slope);
    const double change = seen ? std::remainder(row - edges_[i].row, period_) * turn : 0;
    const bool follows = std::abs(change) <= options_.largest_phase_turn * options_.image_step;
    derivative[first_phase() + Eigen::Index(i)] = follows ? change / step : 0;
  }
  if (outline_.empty()) return;
  coverage_.blur(image.silhouette, box_);
  for (std::size_t i = 0; i < outline_.size(); ++i) {
    const OutlinePixel& pixel = outline_[i];
    derivative[Eigen::Index(pixels_.size() + i)] =
        double(coverage_.row(pixel.row)[pixel.column] - pixel.coverage) / step;
  }
}

/// Of the simulated angle map, rad/px; one-sided or 0 next to pixels without an angle.
Vec2 FrameComparison::angle_gradient(int row, int column) const {
  const AngleMap& map = *simulated_;
  const auto slope = [&](int dy, int dx) {
    const auto value = [&](int sign) {
      const int y = row + sign * dy, x = column + sign * dx;
      return y >= 0 && x >= 0 && y < height_ && x < width_ && map.valid(y, x) != 0
                 ? double(orientation_difference(map.angle(y, x), map.angle(row, column)))
                 : std::numeric_limits<double>::quiet_NaN();
    };
    const double after = value(1), before = value(-1);
    if (std::isnan(after)) return std::isnan(before) ? 0.0 : -before;
    return std::isnan(before) ? after : 0.5 * (after - before);
  };
  return {slope(0, 1), slope(1, 0)};
}

void FrameComparison::follow_folds(const Points& x, const MatX& directions) {
  detail::StripeMotion::Rates rates;
  VecX turn, largest(directions.cols());
  for (Eigen::Index j = 0; j < directions.cols(); ++j)
    largest[j] = options_.largest_turn * fastest_motion(x, directions.col(j));
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    const int row = int(pixels_[i] / width_), column = int(pixels_[i] % width_);
    auto derivative = jacobian_.row(Eigen::Index(i));
    const int triangle = motion_.triangle(row, column);
    if (triangle < 0) {
      derivative.setZero();
      continue;
    }
    motion_.rates(triangle, row, column, rates);
    const Vec2 slope = angle_gradient(row, column);
    turn = rates.turn - slope.x() * rates.right - slope.y() * rates.down;
    derivative = (turn.array().abs() <= largest.array()).select(turn, 0).transpose();
  }
}

/// Near an outline the coverage is carried along by the surface: its change is minus its gradient
/// times the motion of the nearest surface, found by walking uphill.
void FrameComparison::follow_outlines() {
  detail::StripeMotion::Rates rates;
  const int last_row = box_.height() - 1, last_column = box_.width() - 1;
  for (std::size_t i = 0; i < outline_.size(); ++i) {
    const OutlinePixel& at = outline_[i];
    auto derivative = jacobian_.row(Eigen::Index(pixels_.size() + i));
    derivative.setZero();
    const float* here = coverage_.row(at.row);
    const int left = std::max(at.column - 1, 0), right = std::min(at.column + 1, last_column);
    const int above = std::max(at.row - 1, 0), below = std::min(at.row + 1, last_row);
    const double gx = double(here[right] - here[left]) / std::max(right - left, 1);
    const double gy = double(coverage_.row(below)[at.column] - coverage_.row(above)[at.column]) /
                      std::max(below - above, 1);
    const double steepness = std::hypot(gx, gy);
    if (steepness < 1e-6) continue;
    for (int step = 0; step <= coverage_.reach(); ++step) {
      const int row = box_.y0 + at.row + int(std::lround(step * gy / steepness));
      const int column = box_.x0 + at.column + int(std::lround(step * gx / steepness));
      if (row < 0 || column < 0 || row >= height_ || column >= width_) break;
      const int triangle = motion_.triangle(row, column);
      if (triangle < 0) continue;
      motion_.rates(triangle, row, column, rates);
      derivative = -(gx * rates.right + gy * rates.down).transpose();
      break;
    }
  }
}

/// The row at a fixed pixel: what the surface carries along, minus the motion of its image past
/// the pixel.
void FrameComparison::follow_phase(const Points& x, const MatX& directions) {
  detail::StripeMotion::Rates rates;
  const double to_phase = 2 * std::numbers::pi / period_;
  VecX turn, largest(directions.cols());
  for (Eigen::Index j = 0; j < directions.cols() && !edges_.empty(); ++j)
    largest[j] = options_.largest_phase_turn * fastest_motion(x, directions.col(j));
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    const SeenEdge& edge = edges_[i];
    auto derivative = jacobian_.row(first_phase() + Eigen::Index(i));
    const double row = double(edge.sample.y) - 0.5;
    const int triangle = motion_.triangle(int(std::lround(row)), edge.sample.column);
    if (triangle < 0) {
      derivative.setZero();
      continue;
    }
    motion_.rates(triangle, row, edge.sample.column, rates);
    turn = to_phase * (rates.row - edge.slope.x() * rates.right - edge.slope.y() * rates.down);
    derivative = (turn.array().abs() <= largest.array()).select(turn, 0).transpose();
  }
}

void FrameComparison::differentiate_stripes(const Points& x, const MatX& directions) {
  motion_.look(x);
  motion_.move(x, directions);
  follow_folds(x, directions);
  follow_outlines();
  follow_phase(x, directions);
}

/// Fills the Jacobian and the weighted one.
FrameCost FrameComparison::differentiate_all(const FrameFeatures& measured, const Points& x,
                                             const MatX& directions) {
  if (directions.rows() != x.size())
    throw Error(
        fmt::format("residuals: directions have {} rows, must be {}", directions.rows(), x.size()));
  const FrameCost cost = look(measured, x);
  jacobian_.resize(residual_count(), directions.cols());
  if (options_.derivatives == ResidualOptions::Derivatives::analytic)
    differentiate_stripes(x, directions);
  else
    for (Eigen::Index j = 0; j < directions.cols(); ++j) differentiate(x, directions.col(j), j);
  const Eigen::Map<const VecX> w(weights_.data(), residual_count());
  weighted_ = 2 * (w.asDiagonal() * jacobian_);
  return cost;
}

FrameLinearization FrameComparison::linearize(const FrameFeatures& measured, const Points& x,
                                              const MatX& directions) {
  FrameLinearization result;
  static_cast<FrameCost&>(result) = differentiate_all(measured, x, directions);
  const Eigen::Map<const VecX> r(residuals_.data(), residual_count());
  result.gradient = weighted_.transpose() * r;
  result.hessian = weighted_.transpose() * jacobian_;
  return result;
}

std::vector<std::vector<Eigen::Index>> FrameComparison::residuals_by_patch(
    const PatchGrid& grid) const {
  std::vector<std::vector<Eigen::Index>> indices(static_cast<std::size_t>(grid.count()));
  const auto add = [&](int row, int column, std::size_t i) {
    indices[static_cast<std::size_t>(grid.patch(row, column))].push_back(
        static_cast<Eigen::Index>(i));
  };
  for (std::size_t i = 0; i < pixels_.size(); ++i)
    add(int(pixels_[i] / width_), int(pixels_[i] % width_), i);
  for (std::size_t i = 0; i < outline_.size(); ++i)
    add(box_.y0 + outline_[i].row, box_.x0 + outline_[i].column, pixels_.size() + i);
  for (std::size_t i = 0; i < edges_.size(); ++i)
    add(int(edges_[i].sample.y), edges_[i].sample.column, std::size_t(first_phase()) + i);
  return indices;
}

PatchLinearization FrameComparison::linearize(const FrameFeatures& measured, const Points& x,
                                              const MatX& directions, const PatchGrid& grid) {
  PatchLinearization result;
  result.whole = differentiate_all(measured, x, directions);
  const Eigen::Map<const VecX> r(residuals_.data(), residual_count());
  for (const std::vector<Eigen::Index>& indices : residuals_by_patch(grid)) {
    const MatX weighted = weighted_(indices, Eigen::all);
    result.patches.push_back(
        {weighted.transpose() * r(indices), weighted.transpose() * jacobian_(indices, Eigen::all)});
  }
  return result;
}

struct FrameResiduals::Impl : FrameComparison {
  using FrameComparison::FrameComparison;
};

namespace {

void check(const ResidualOptions& options) {
  require(options.alpha >= 0 && std::isfinite(options.alpha), "alpha", options.alpha, "at least 0");
  require(options.fold_weight >= 0 && std::isfinite(options.fold_weight), "fold_weight",
          options.fold_weight, "at least 0");
  require(options.fold_scale > 0, "fold_scale", options.fold_scale, "above 0 rad");
  require(options.phase_weight >= 0 && std::isfinite(options.phase_weight), "phase_weight",
          options.phase_weight, "at least 0");
  require(options.phase_scale > 0, "phase_scale", options.phase_scale, "above 0 rad");
  require(options.largest_phase_turn > 0, "largest_phase_turn", options.largest_phase_turn,
          "above 0 rad/px");
  require(options.silhouette_sigma > 0 && options.silhouette_sigma <= 64, "silhouette_sigma",
          options.silhouette_sigma, "above 0 and at most 64 px");
  require(options.stride >= 1 && options.stride <= 16, "stride", options.stride, "1 to 16");
  require(options.image_step > 0 && options.image_step <= 16, "image_step", options.image_step,
          "above 0 and at most 16 px");
  require(options.largest_turn > 0, "largest_turn", options.largest_turn, "above 0 rad/px");
}

}  // namespace

FrameResiduals::FrameResiduals(const Rig& rig, const TriangleMesh& mesh,
                               const RenderOptions& render, const AngleMapOptions& angle_map,
                               const ResidualOptions& options) {
  check(options);
  impl_ = std::make_unique<Impl>(rig, mesh, render, angle_map, options);
}
FrameResiduals::~FrameResiduals() = default;
FrameResiduals::FrameResiduals(FrameResiduals&&) noexcept = default;

FrameCost FrameResiduals::evaluate(const FrameFeatures& measured, const Points& x) {
  return impl_->look(measured, x);
}

FrameLinearization FrameResiduals::linearize(const FrameFeatures& measured, const Points& x,
                                             const MatX& directions) {
  return impl_->linearize(measured, x, directions);
}

int PatchGrid::patch(int row, int column) const {
  const auto part = [](double at, double from, double to, int count) {
    return std::clamp(static_cast<int>(std::floor((at - from) / (to - from) * count)), 0,
                      count - 1);
  };
  return part(row + 0.5, top, bottom, rows) * columns + part(column + 0.5, left, right, columns);
}

PatchLinearization linearize_patches(const Rig& rig, const TriangleMesh& mesh,
                                     const RenderOptions& render, const AngleMapOptions& angle_map,
                                     const ResidualOptions& options, const FrameFeatures& measured,
                                     const Points& x, const MatX& directions,
                                     const PatchGrid& grid) {
  check(options);
  return FrameComparison(rig, mesh, render, angle_map, options)
      .linearize(measured, x, directions, grid);
}

}  // namespace weft
