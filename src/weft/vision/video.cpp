#include "weft/vision/video.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "weft/base/error.h"
#include "weft/base/files.h"
#include "weft/vision/codecs.h"

namespace weft {
namespace {

namespace fs = std::filesystem;

double linear_from_srgb(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

double srgb_from_linear(double value) {
  return value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055;
}

std::string frame_of(const fs::path& path, int frame) {
  return path.string() + ": frame " + std::to_string(frame);
}

/// Rec. 709 luma of linearized light; blue, green, red as OpenCV has them.
constexpr std::array<double, 3> kLuma{0.0722, 0.7152, 0.2126};

/// For each channel its part of the grey level, by code value.
class GreyTable {
 public:
  explicit GreyTable(int largest_code) {
    for (std::size_t channel = 0; channel < 3; ++channel)
      for (int code = 0; code <= largest_code; ++code)
        parts_[channel].push_back(
            float(kLuma[channel] * linear_from_srgb(double(code) / largest_code)));
  }
  template <typename Code>
  Image convert(const cv::Mat& picture) const {
    Image grey(picture.rows, picture.cols);
    for (int y = 0; y < picture.rows; ++y) {
      const auto* in = picture.ptr<cv::Vec<Code, 3>>(y);
      float* out = grey.data() + Eigen::Index(y) * picture.cols;
      for (int x = 0; x < picture.cols; ++x)
        out[x] = parts_[0][in[x][0]] + parts_[1][in[x][1]] + parts_[2][in[x][2]];
    }
    return grey;
  }

 private:
  std::array<std::vector<float>, 3> parts_;
};

Image to_grey(const cv::Mat& picture, const std::string& where) {
  static const GreyTable table8(255), table16(65535);
  if (picture.type() == CV_8UC3) return table8.convert<std::uint8_t>(picture);
  if (picture.type() == CV_16UC3) return table16.convert<std::uint16_t>(picture);
  throw Error(where + ": pixels must have 8 or 16 bits a channel");
}

/// A file name with one %d or %0Nd in it.
class NumberedImages {
 public:
  /// Empty if the name has no '%'. Throws Error for any other conversion.
  static std::optional<NumberedImages> parse(const fs::path& path) {
    const std::string name = path.filename().string();
    const std::size_t percent = name.find('%');
    if (percent == std::string::npos) return {};
    const std::size_t end = name.find('d', percent);
    const auto refuse = [&] {
      return Error(path.string() +
                   ": the pattern of numbered images must hold one %d or %0Nd, such as %04d");
    };
    if (end == std::string::npos || name.find('%', end) != std::string::npos) throw refuse();
    NumberedImages images;
    images.folder_ = path.parent_path();
    images.before_ = name.substr(0, percent);
    images.after_ = name.substr(end + 1);
    const std::string digits = name.substr(percent + 1, end - percent - 1);
    if (!digits.empty()) {
      const auto [stop, failure] =
          std::from_chars(digits.data(), digits.data() + digits.size(), images.width_);
      const bool whole = stop == digits.data() + digits.size();
      if (failure != std::errc() || !whole || digits[0] != '0' || images.width_ > 9) throw refuse();
    }
    return images;
  }
  fs::path file(int number) const {
    std::string digits = std::to_string(number);
    if (int(digits.size()) < width_) digits.insert(0, std::size_t(width_) - digits.size(), '0');
    return folder_ / (before_ + digits + after_);
  }

 private:
  fs::path folder_;
  std::string before_, after_;
  int width_ = 0;
};

void require_same_size(const Image& first, const Image& frame, const std::string& where) {
  if (frame.rows() == first.rows() && frame.cols() == first.cols()) return;
  throw Error(where + ": is " + std::to_string(frame.cols()) + " x " +
              std::to_string(frame.rows()) + " px, the first frame " +
              std::to_string(first.cols()) + " x " + std::to_string(first.rows()));
}

std::vector<Image> read_numbered(const NumberedImages& images, int frame_count) {
  const int first = path_exists(images.file(0)) ? 0 : 1;
  std::vector<Image> frames;
  for (int frame = 0; frame < frame_count; ++frame) {
    const fs::path file = images.file(first + frame);
    const std::string where = frame_of(file, frame);
    if (!path_exists(file)) throw Error(where + ": no such file");
    const cv::Mat picture =
        codecs().read_picture(file.string(), PictureChannels::colour_of_any_depth);
    if (picture.empty()) throw Error(where + ": cannot be read as an image");
    frames.push_back(to_grey(picture, where));
    require_same_size(frames.front(), frames.back(), where);
  }
  return frames;
}

std::vector<Image> read_video_file(const fs::path& path, int frame_count) {
  if (!is_file(path)) throw Error(path.string() + ": no such video file");
  const std::unique_ptr<VideoReader> video = codecs().open_video(path.string());
  if (!video) throw Error(path.string() + ": cannot be read as a video");
  std::vector<Image> frames;
  cv::Mat picture;
  for (int frame = 0; frame < frame_count; ++frame) {
    if (!video->read(picture))
      throw Error(frame_of(path, frame) + ": cannot be read; " + std::to_string(frame_count) +
                  " frames are needed");
    frames.push_back(to_grey(picture, frame_of(path, frame)));
  }
  return frames;
}

}  // namespace

std::vector<Image> read_frames(const std::filesystem::path& path, int frame_count) {
  if (frame_count < 1)
    throw Error(path.string() + ": the number of frames to read must be at least 1, is " +
                std::to_string(frame_count));
  try {
    if (const auto images = NumberedImages::parse(path)) return read_numbered(*images, frame_count);
    return read_video_file(path, frame_count);
  } catch (const cv::Exception& failure) {
    throw Error(path.string() + ": cannot be read: " + failure.err);
  }
}

std::optional<double> stated_frame_rate(const std::filesystem::path& path) {
  if (NumberedImages::parse(path)) return {};
  try {
    const std::unique_ptr<VideoReader> video = codecs().open_video(path.string());
    const double rate = video ? video->frame_rate() : 0;
    if (std::isfinite(rate) && rate > 0) return rate;
  } catch (const cv::Exception&) {
  }
  return {};
}

void write_png(const std::filesystem::path& path, const Image& linear) {
  cv::Mat picture(int(linear.rows()), int(linear.cols()), CV_8UC1);
  for (int y = 0; y < picture.rows; ++y)
    for (int x = 0; x < picture.cols; ++x) {
      const double light = std::clamp(double(linear(y, x)), 0.0, 1.0);
      picture.at<std::uint8_t>(y, x) = std::uint8_t(std::lround(255 * srgb_from_linear(light)));
    }
  try {
    if (codecs().write_picture(path.string(), picture)) return;
  } catch (const cv::Exception& failure) {
    throw Error(path.string() + ": cannot be written: " + failure.err);
  }
  throw Error(path.string() + ": cannot be written");
}

}  // namespace weft
