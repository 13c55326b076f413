#include "weft/registration/landmarks.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "weft/base/error.h"
#include "weft/base/quantile.h"
#include "weft/registration/point_tree.h"

namespace weft {
namespace {

using Float = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

cv::Mat view(const Image& image) {
  return {static_cast<int>(image.rows()), static_cast<int>(image.cols()), CV_32F,
          const_cast<float*>(image.data())};
}

FabricImage blank(const GridTemplate& grid, double texel) {
  if (!(texel > 0)) throw Error(fmt::format("a texel of {} m: must be above 0", texel));
  FabricImage image;
  image.texel = texel;
  const auto rows = static_cast<Eigen::Index>(std::floor(grid.height / texel + 1e-9));
  const auto columns = static_cast<Eigen::Index>(std::floor(grid.width / texel + 1e-9));
  if (rows < 1 || columns < 1) throw Error("a texel larger than the swatch");
  image.grey = Image::Zero(rows, columns);
  image.seen = Mask::Zero(rows, columns);
  return image;
}

Vec2 center_of(const FabricImage& image, Eigen::Index row, Eigen::Index column) {
  return image.texel * Vec2(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
}

/// Bilinear over the cells of the grid, clamped to it.
Vec3 position_at(const GridTemplate& grid, const Points& x, const Vec2& uv) {
  const double a = std::clamp(uv.x() / grid.cell_u(), 0.0, grid.columns - 1.0);
  const double b = std::clamp(uv.y() / grid.cell_v(), 0.0, grid.rows - 1.0);
  const int i = std::min(static_cast<int>(a), grid.columns - 2);
  const int j = std::min(static_cast<int>(b), grid.rows - 2);
  const double f = a - i, g = b - j;
  return (1 - g) * ((1 - f) * x.col(grid.vertex(i, j)) + f * x.col(grid.vertex(i + 1, j))) +
         g * ((1 - f) * x.col(grid.vertex(i, j + 1)) + f * x.col(grid.vertex(i + 1, j + 1)));
}

bool bilinear(const Image& picture, const Vec2& at, float& value) {
  const double x = at.x() - 0.5, y = at.y() - 0.5;
  const double column = std::floor(x), row = std::floor(y);
  if (!(column >= 0 && row >= 0 && column + 1 < static_cast<double>(picture.cols()) &&
        row + 1 < static_cast<double>(picture.rows()))) {
    return false;
  }
  const auto j = static_cast<Eigen::Index>(column), i = static_cast<Eigen::Index>(row);
  const auto f = static_cast<float>(x - column), g = static_cast<float>(y - row);
  value = (1 - g) * ((1 - f) * picture(i, j) + f * picture(i, j + 1)) +
          g * ((1 - f) * picture(i + 1, j) + f * picture(i + 1, j + 1));
  return true;
}

/// Depth of the nearest surface at pixels of a coarse raster, from the texels' own positions.
class DepthMap {
 public:
  explicit DepthMap(const Image& picture)
      : depth_(Float::Constant(picture.rows(), picture.cols(),
                               std::numeric_limits<float>::infinity())) {}
  void add(const Vec3& projected) {
    const auto j = static_cast<Eigen::Index>(std::floor(projected.x()));
    const auto i = static_cast<Eigen::Index>(std::floor(projected.y()));
    if (i < 0 || j < 0 || i >= depth_.rows() || j >= depth_.cols()) return;
    depth_(i, j) = std::min(depth_(i, j), static_cast<float>(projected.z()));
  }
  bool hides(const Vec3& projected, double margin) const {
    const auto j = static_cast<Eigen::Index>(std::floor(projected.x()));
    const auto i = static_cast<Eigen::Index>(std::floor(projected.y()));
    if (i < 0 || j < 0 || i >= depth_.rows() || j >= depth_.cols()) return true;
    return static_cast<double>(depth_(i, j)) < projected.z() - margin;
  }

 private:
  Float depth_;
};

}  // namespace

FabricImage unwrap_scan(const GridTemplate& grid, const Points& x, const Scan& scan, double texel) {
  if (scan.colour.cols() != scan.size()) throw Error("the scan has no colours");
  FabricImage image = blank(grid, texel);
  const PointTree tree(scan.position);
  std::vector<PointTree::Neighbour> near;
  std::vector<double> steps;
  for (int i = 0; i < scan.size(); i += std::max(1, scan.size() / 500)) {
    tree.nearest(scan.position.col(i), 2, near);
    steps.push_back(std::sqrt(near.back().squared));
  }
  // The distance to the nearest of scattered points is shorter than the one between neighbours.
  const double reach = std::max(2 * 2 * quantile(std::move(steps), 0.5), texel);
  for (Eigen::Index row = 0; row < image.grey.rows(); ++row) {
    for (Eigen::Index column = 0; column < image.grey.cols(); ++column) {
      tree.nearest(position_at(grid, x, center_of(image, row, column)), 4, near);
      if (near.front().squared > reach * reach) continue;
      double sum = 0, weights = 0;
      for (const auto& point : near) {
        const double weight = 1 / (point.squared + 1e-2 * reach * reach);
        sum += weight * static_cast<double>(scan.colour.col(point.index).mean());
        weights += weight;
      }
      image.grey(row, column) = static_cast<float>(sum / weights);
      image.seen(row, column) = 1;
    }
  }
  return image;
}

FabricImage unwrap_picture(const GridTemplate& grid, const Points& x, const Image& picture,
                           const Pinhole& camera, double texel) {
  constexpr double least_cosine = 0.26;
  FabricImage image = blank(grid, texel);
  const auto rows = image.grey.rows(), columns = image.grey.cols();
  Points projected(3, rows * columns);
  DepthMap depth(picture);
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (Eigen::Index column = 0; column < columns; ++column) {
      const Vec3 at = camera.project(position_at(grid, x, center_of(image, row, column)));
      projected.col(row * columns + column) = at;
      if (at.z() > 0) depth.add(at);
    }
  }
  const Points normals = vertex_normals(grid.mesh, x);
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (Eigen::Index column = 0; column < columns; ++column) {
      const Vec2 uv = center_of(image, row, column);
      const Vec3 at = projected.col(row * columns + column);
      if (!(at.z() > 0) || depth.hides(at, 4 * texel)) continue;
      const Vec3 view_ray = (position_at(grid, x, uv) - camera.center()).normalized();
      const double cosine = std::abs(position_at(grid, normals, uv).normalized().dot(view_ray));
      float value = 0;
      if (cosine < least_cosine || !bilinear(picture, at.head<2>(), value)) continue;
      image.grey(row, column) = value;
      image.seen(row, column) = 1;
    }
  }
  return image;
}

namespace {

enum class LineAlong { u, v };

/// How much darker a line through each texel is than what lies beside it.
Image line_response(const Image& grey, int length, int beside, LineAlong direction) {
  const bool along_u = direction == LineAlong::u;
  cv::Mat line, side, response;
  const cv::Size on = along_u ? cv::Size(2 * length + 1, 1) : cv::Size(1, 2 * length + 1);
  cv::blur(view(grey), line, on, cv::Point(-1, -1), cv::BORDER_REPLICATE);
  const auto shifted = [&](int by) {
    const cv::Mat move = (cv::Mat_<double>(2, 3) << 1, 0, along_u ? 0 : by, 0, 1, along_u ? by : 0);
    cv::Mat out;
    cv::warpAffine(line, out, move, line.size(), cv::INTER_NEAREST, cv::BORDER_REPLICATE);
    return out;
  };
  cv::Mat lower = shifted(beside), upper = shifted(-beside);
  // Darker than both sides, not only than their mean: the rim of a dark patch is no line.
  cv::min(lower, upper, side);
  response = side - line;
  Image out(grey.rows(), grey.cols());
  std::copy(response.ptr<float>(0), response.ptr<float>(0) + out.size(), out.data());
  return out;
}

struct Crossing {
  Vec2 uv;  ///< m
  float response = 0;
  std::array<int, 2> number{};
  bool numbered = false;
};

/// The place of a peak to a fraction of a texel: a parabola through its neighbours in each
/// direction.
Vec2 refine(const Image& response, Eigen::Index row, Eigen::Index column) {
  const auto vertex = [](float a, float b, float c) {
    const float curvature = a - 2 * b + c;
    return curvature < 0
               ? std::clamp(0.5 * static_cast<double>(a - c) / static_cast<double>(curvature), -0.5,
                            0.5)
               : 0.0;
  };
  const double x =
      vertex(response(row, column - 1), response(row, column), response(row, column + 1));
  const double y =
      vertex(response(row - 1, column), response(row, column), response(row + 1, column));
  return {static_cast<double>(column) + 0.5 + x, static_cast<double>(row) + 0.5 + y};
}

/// Where the dark line through (row, column) is, across it: the centre of the darker half of the
/// profile, which is averaged along 0.8 of a pitch. In texels from the middle of the texel.
double line_offset(const FabricImage& image, Eigen::Index row, Eigen::Index column, int step,
                   LineAlong direction) {
  const bool along_u = direction == LineAlong::u;
  const int across = step / 4, along = 2 * step / 5;
  std::vector<double> profile;
  for (int d = -across; d <= across; ++d) {
    double sum = 0;
    int count = 0;
    for (int t = -along; t <= along; ++t) {
      const Eigen::Index i = row + (along_u ? d : t), j = column + (along_u ? t : d);
      if (i < 0 || j < 0 || i >= image.grey.rows() || j >= image.grey.cols()) continue;
      if (!image.seen(i, j)) continue;
      sum += static_cast<double>(image.grey(i, j));
      ++count;
    }
    profile.push_back(count > 0 ? sum / count : kInfinity);
  }
  const auto finite = [](double a) { return std::isfinite(a); };
  double light = -kInfinity, dark = -light;
  for (const double grey : profile) {
    if (!finite(grey)) continue;
    light = std::max(light, grey);
    dark = std::min(dark, grey);
  }
  double sum = 0, weights = 0;
  for (int d = -across; d <= across; ++d) {
    const double grey = profile[static_cast<std::size_t>(d + across)];
    const double weight = finite(grey) ? std::max(0.0, (light + dark) / 2 - grey) : 0.0;
    sum += weight * d;
    weights += weight;
  }
  return weights > 0 ? sum / weights : 0;
}

std::vector<Crossing> find_crossings(const FabricImage& image, double pitch) {
  const int step = static_cast<int>(std::lround(pitch / image.texel));
  const int length = std::max(1, step / 4), beside = std::max(2, step / 4);
  Image grey = image.grey;
  cv::Mat smooth;
  cv::GaussianBlur(view(grey), smooth, cv::Size(0, 0), std::max(0.6, step / 16.0));
  std::copy(smooth.ptr<float>(0), smooth.ptr<float>(0) + grey.size(), grey.data());
  // A line along u varies across v, so its response places v; their least places both.
  const Image response = line_response(grey, length, beside, LineAlong::u)
                             .min(line_response(grey, length, beside, LineAlong::v));
  std::vector<Crossing> all;
  const Eigen::Index reach = std::max(2, 2 * step / 5);
  for (Eigen::Index i = 1; i + 1 < response.rows(); ++i) {
    for (Eigen::Index j = 1; j + 1 < response.cols(); ++j) {
      if (!image.seen(i, j) || response(i, j) <= 0) continue;
      const Eigen::Index i0 = std::max<Eigen::Index>(0, i - reach),
                         j0 = std::max<Eigen::Index>(0, j - reach);
      const auto block = response.block(i0, j0, std::min(response.rows(), i + reach + 1) - i0,
                                        std::min(response.cols(), j + reach + 1) - j0);
      if (response(i, j) < block.maxCoeff()) continue;
      const Vec2 middle(
          static_cast<double>(j) + 0.5 + line_offset(image, i, j, step, LineAlong::v),
          static_cast<double>(i) + 0.5 + line_offset(image, i, j, step, LineAlong::u));
      all.push_back({image.texel * middle, response(i, j), {}, false});
    }
  }
  if (all.empty()) return all;
  // True crossings are about equally dark; what stands out less than half of them is none.
  std::vector<float> responses;
  for (const Crossing& crossing : all) responses.push_back(crossing.response);
  const auto upper = static_cast<std::ptrdiff_t>(3 * responses.size() / 4);
  std::nth_element(responses.begin(), responses.begin() + upper, responses.end());
  const float least = 0.4f * responses[static_cast<std::size_t>(upper)];
  std::erase_if(all, [&](const Crossing& crossing) { return crossing.response < least; });
  return all;
}

/// Numbers the crossings along rows and columns from each largest connected part; returns those of
/// the largest part.
std::vector<Crossing> number_crossings(std::vector<Crossing> all, double pitch) {
  constexpr double tolerance = 0.3;  // of a pitch
  std::vector<Crossing> best;
  for (std::size_t first = 0; first < all.size(); ++first) {
    if (all[first].numbered) continue;
    std::deque<std::size_t> open{first};
    std::vector<Crossing> part;
    all[first].numbered = true;
    while (!open.empty()) {
      const Crossing here = all[open.front()];
      open.pop_front();
      part.push_back(here);
      for (const auto& [du, dv] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const Vec2 expected = here.uv + pitch * Vec2(du, dv);
        for (std::size_t k = 0; k < all.size(); ++k) {
          if (all[k].numbered || (all[k].uv - expected).norm() > tolerance * pitch) continue;
          all[k].numbered = true;
          all[k].number = {here.number[0] + du, here.number[1] + dv};
          open.push_back(k);
        }
      }
    }
    if (part.size() > best.size()) best = std::move(part);
  }
  return best;
}

/// Leaves out crossings that lie off the middle of their neighbours by more than 0.15 pitches, and
/// those without two neighbours.
void keep_regular(std::vector<Crossing>& crossings, double pitch) {
  constexpr double tolerance = 0.15;
  std::vector<char> regular;
  for (const Crossing& here : crossings) {
    std::array<std::vector<double>, 2> offsets;
    for (const Crossing& other : crossings) {
      const int du = other.number[0] - here.number[0], dv = other.number[1] - here.number[1];
      if (std::abs(du) > 1 || std::abs(dv) > 1) continue;
      const Vec2 offset = other.uv - here.uv - pitch * Vec2(du, dv);
      for (std::size_t axis = 0; axis < 2; ++axis) {
        offsets[axis].push_back(offset[static_cast<Eigen::Index>(axis)]);
      }
    }
    const bool near =
        std::hypot(quantile(offsets[0], 0.5), quantile(offsets[1], 0.5)) < tolerance * pitch;
    regular.push_back(near && offsets[0].size() > 2);
  }
  std::size_t k = 0;
  std::erase_if(crossings, [&](const Crossing&) { return !regular[k++]; });
}

}  // namespace

std::vector<Landmark> find_stamped_grid(const GridTemplate& grid, const Points& x,
                                        const FabricImage& image, const StampedGrid& stamp) {
  if (!(stamp.pitch >= 6 * image.texel)) {
    throw Error(fmt::format("a stamped grid of {} m seen in texels of {} m; at least 6 a pitch",
                            stamp.pitch, image.texel));
  }
  if (!(stamp.origin.minCoeff() >= 0 && stamp.origin.maxCoeff() < stamp.pitch)) {
    throw Error("the origin of a stamped grid must be in [0, pitch)");
  }
  auto crossings = number_crossings(find_crossings(image, stamp.pitch), stamp.pitch);
  keep_regular(crossings, stamp.pitch);
  std::vector<Landmark> landmarks;
  if (crossings.empty()) return landmarks;
  std::array<int, 2> shift{};
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> offsets;
    for (const Crossing& crossing : crossings) {
      offsets.push_back((crossing.uv[axis] - stamp.origin[axis]) / stamp.pitch -
                        crossing.number[static_cast<std::size_t>(axis)]);
    }
    shift[static_cast<std::size_t>(axis)] =
        static_cast<int>(std::lround(quantile(std::move(offsets), 0.5)));
  }
  const double margin = 0.3 * stamp.pitch;
  for (const Crossing& crossing : crossings) {
    const Vec2 uv = stamp.origin + stamp.pitch * Vec2(crossing.number[0] + shift[0],
                                                      crossing.number[1] + shift[1]);
    // Beside the rim a crossing shows less than all of its arms.
    const bool on =
        uv.minCoeff() >= margin && uv.x() <= grid.width - margin && uv.y() <= grid.height - margin;
    if (on) landmarks.push_back({uv, position_at(grid, x, crossing.uv), 1});
  }
  return landmarks;
}

std::vector<TextureShift> track_texture(const FabricImage& reference, const FabricImage& image,
                                        const TextureTracking& tracking) {
  if (reference.grey.rows() != image.grey.rows() || reference.grey.cols() != image.grey.cols()) {
    throw Error("textures of two sizes cannot be compared");
  }
  constexpr double least_seen = 0.8;
  const double texel = reference.texel;
  const int half = static_cast<int>(std::lround(tracking.window / texel / 2));
  const int reach = static_cast<int>(std::lround(tracking.reach / texel));
  const int rows = static_cast<int>(image.grey.rows()),
            columns = static_cast<int>(image.grey.cols());
  const double step = tracking.spacing / texel;
  const cv::Mat from = view(reference.grey), to = view(image.grey);
  std::vector<TextureShift> shifts;
  for (double y = half + reach + tracking.offset.y() / texel; y < rows - half - reach; y += step) {
    for (double x = half + reach + tracking.offset.x() / texel; x < columns - half - reach;
         x += step) {
      const int i = static_cast<int>(y), j = static_cast<int>(x);
      const int side = 2 * half + 1, wide = side + 2 * reach;
      const auto seen = [&](const Mask& mask, int extent) {
        return mask.block(i - extent, j - extent, 2 * extent + 1, 2 * extent + 1)
            .cast<double>()
            .mean();
      };
      if (seen(reference.seen, half) < least_seen) continue;
      if (seen(image.seen, half + reach) < least_seen) continue;
      cv::Mat score;
      cv::matchTemplate(to(cv::Rect(j - half - reach, i - half - reach, wide, wide)),
                        from(cv::Rect(j - half, i - half, side, side)), score,
                        cv::TM_CCOEFF_NORMED);
      double best = 0;
      cv::Point place;
      cv::minMaxLoc(score, nullptr, &best, nullptr, &place);
      const bool at_reach =
          place.x == 0 || place.y == 0 || place.x == 2 * reach || place.y == 2 * reach;
      if (at_reach || !(best >= tracking.least_score)) continue;
      Image peak(3, 3);
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
          peak(a, b) = score.at<float>(place.y + a - 1, place.x + b - 1);
        }
      }
      const Vec2 fine = refine(peak, 1, 1) - Vec2(1.5, 1.5);
      shifts.push_back({texel * Vec2(j + 0.5, i + 0.5),
                        texel * (Vec2(place.x - reach, place.y - reach) + fine), best});
    }
  }
  return shifts;
}

std::vector<Landmark> landmarks_of(const GridTemplate& grid, const Points& x,
                                   const std::vector<TextureShift>& shifts) {
  std::vector<Landmark> landmarks;
  for (const TextureShift& shift : shifts) {
    landmarks.push_back({shift.uv, position_at(grid, x, shift.uv + shift.shift), 1});
  }
  return landmarks;
}

ScanRegistration follow_print(const GridTemplate& grid, const Scan& scan,
                              const ScanGeometry& geometry, ScanRegistration registration,
                              const FabricImage& reference,
                              const std::function<FabricImage(const Points&)>& look,
                              const RegistrationOptions& options, const TextureTracking& tracking,
                              std::size_t& landmarks) {
  for (int round = 0; round < 2; ++round) {
    const Points& x = registration.x;
    const auto found = landmarks_of(grid, x, track_texture(reference, look(x), tracking));
    landmarks = found.size();
    if (found.empty()) break;
    registration = register_scan(grid, scan, geometry, RegistrationStart{x, {}}, found, options);
  }
  return registration;
}

}  // namespace weft
