#include "weft/vision/strip_profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/quantile.h"
#include "weft/vision/codecs.h"

namespace weft {
namespace {

constexpr double kSampling = 0.5;     // px across the line
constexpr double kPart = 0.5;         // of the peak: what belongs to the line
constexpr double kMemory = 40;        // px back along the line that say where it goes
constexpr double kLeastLight = 0.05;  // above the ground, at the clamp
constexpr double kGap = 12;           // px that may be dark within the strip
constexpr std::size_t kLeastPoints = 20;

void check(double value, double lower, double upper, const char* name) {
  if (value >= lower && value <= upper) return;
  throw Error(
      fmt::format("strip profile: {} {:g}; valid is {:g} to {:g}", name, value, lower, upper));
}

class Tracer {
 public:
  Tracer(const Image& grey, const StripProfileOptions& options) : options_(options) {
    const cv::Mat view(static_cast<int>(grey.rows()), static_cast<int>(grey.cols()), CV_32F,
                       const_cast<float*>(grey.data()));
    if (options.blur > 0)
      cv::GaussianBlur(view, smooth_, {}, options.blur);
    else
      smooth_ = view.clone();
    ground_ = median_light();
  }

  MaterialPoints trace() {
    Vec2 place = options_.clamp.value_or(brightest_border());
    if (!inside(place)) throw Error("strip profile: the clamp is outside the picture");
    Vec2 way(place.x() < smooth_.cols / 2.0 ? 1 : -1, 0);
    double dark = 0;
    while (dark <= kGap) {
      const auto [point, peak] = across(place, way);
      if (!inside(point) || (points_.empty() && peak < kLeastLight)) break;
      if (peaks_.size() >= kLeastPoints && peak < options_.contrast * median_peak()) {
        dark += options_.step;
        place += options_.step * way;
        continue;
      }
      dark = 0;
      points_.push_back(point);
      peaks_.push_back(peak);
      const auto back = static_cast<std::size_t>(kMemory / options_.step) + 1;
      if (points_.size() > back) way = (point - points_[points_.size() - 1 - back]).normalized();
      place = point + options_.step * way;
    }
    if (points_.size() < kLeastPoints)
      throw Error("no bright line begins at the clamp in the picture of the strip");
    MaterialPoints result(2, static_cast<Eigen::Index>(points_.size()));
    for (Eigen::Index i = 0; i < result.cols(); ++i) result.col(i) = smoothed(i);
    return result;
  }

 private:
  /// A parabola through the neighbours: a line that jitters from step to step is too long.
  Vec2 smoothed(Eigen::Index i) const {
    const auto reach =
        std::max<Eigen::Index>(3, static_cast<Eigen::Index>(kMemory / options_.step));
    Mat3 normal = Mat3::Zero();
    Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
    const auto count = static_cast<Eigen::Index>(points_.size());
    for (Eigen::Index j = std::max<Eigen::Index>(0, i - reach); j <= std::min(count - 1, i + reach);
         ++j) {
      const double t = static_cast<double>(j - i) / static_cast<double>(reach + 1);
      const double w = std::pow(1 - std::pow(std::abs(t), 3), 3);
      const Vec3 row(1, t, t * t);
      normal += w * row * row.transpose();
      right += w * row * points_[static_cast<std::size_t>(j)].transpose();
    }
    return solve_symmetric(normal, right).row(0).transpose();
  }

  bool inside(const Vec2& p) const {
    return p.x() >= 0.5 && p.y() >= 0.5 && p.x() <= smooth_.cols - 0.5 &&
           p.y() <= smooth_.rows - 0.5;
  }

  /// Bilinear; 0 outside. Pixel (row i, column j) has its centre at (j + 0.5, i + 0.5).
  double light(const Vec2& p) const {
    if (!inside(p)) return 0;
    const double x = p.x() - 0.5, y = p.y() - 0.5;
    const int j = std::clamp(static_cast<int>(x), 0, smooth_.cols - 2);
    const int i = std::clamp(static_cast<int>(y), 0, smooth_.rows - 2);
    const double a = x - j, b = y - i;
    return (1 - b) * ((1 - a) * smooth_.at<float>(i, j) + a * smooth_.at<float>(i, j + 1)) +
           b * ((1 - a) * smooth_.at<float>(i + 1, j) + a * smooth_.at<float>(i + 1, j + 1));
  }

  Vec2 brightest_border() const {
    Vec2 best(0.5, 0.5);
    float most = -1;
    for (const int column : {0, smooth_.cols - 1})
      for (int row = 0; row < smooth_.rows; ++row)
        if (smooth_.at<float>(row, column) > most) {
          most = smooth_.at<float>(row, column);
          best = Vec2(column + 0.5, row + 0.5);
        }
    return best;
  }

  struct Found {
    Vec2 point;
    double peak;
  };
  Found across(const Vec2& place, const Vec2& way) const {
    const Vec2 normal(-way.y(), way.x());
    const int reach = static_cast<int>(options_.reach / kSampling);
    std::vector<double> values;
    for (int i = -reach; i <= reach; ++i)
      values.push_back(std::max(0.0, light(place + i * kSampling * normal) - ground_));
    const auto top = std::max_element(values.begin(), values.end());
    auto first = top, last = top;
    while (first != values.begin() && *(first - 1) >= kPart * *top) --first;
    while (last + 1 != values.end() && *(last + 1) >= kPart * *top) ++last;
    double sum = 0, moment = 0;
    for (auto it = first; it <= last; ++it) {
      sum += *it;
      moment += *it * (static_cast<double>(it - values.begin()) - reach) * kSampling;
    }
    return {sum > 0 ? Vec2(place + moment / sum * normal) : place, *top};
  }

  double median_peak() const { return quantile(peaks_, 0.5); }
  double median_light() const {
    std::vector<double> values;
    for (int i = 0; i < smooth_.rows; ++i)
      values.insert(values.end(), smooth_.ptr<float>(i), smooth_.ptr<float>(i) + smooth_.cols);
    return quantile(std::move(values), 0.5);
  }

  StripProfileOptions options_;
  cv::Mat smooth_;
  double ground_ = 0;  ///< most of the picture
  std::vector<Vec2> points_;
  std::vector<double> peaks_;
};

}  // namespace

Image read_grey_image(const std::filesystem::path& path) {
  cv::Mat grey;
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    throw Error(fmt::format("{}: no such file", path.string()));
  try {
    grey = codecs().read_picture(path.string(), PictureChannels::grey);
  } catch (const cv::Exception&) {
    grey.release();
  }
  if (grey.empty()) throw Error(fmt::format("{}: not a picture that can be read", path.string()));
  Image image(grey.rows, grey.cols);
  for (int i = 0; i < grey.rows; ++i)
    for (int j = 0; j < grey.cols; ++j)
      image(i, j) = static_cast<float>(grey.at<unsigned char>(i, j)) / 255;
  return image;
}

MaterialPoints find_strip_profile(const Image& grey, const StripProfileOptions& options) {
  check(options.blur, 0, 50, "blur");
  check(options.step, 1, 50, "step");
  check(options.reach, 4, 200, "reach");
  check(options.contrast, 0.05, 0.95, "contrast");
  if (grey.rows() < 4 || grey.cols() < 4) throw Error("strip profile: the picture is empty");
  return Tracer(grey, options).trace();
}

}  // namespace weft
