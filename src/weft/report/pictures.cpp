#include "weft/report/pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "weft/base/error.h"
#include "weft/base/files.h"
#include "weft/report/colour_map.h"
#include "weft/vision/codecs.h"

namespace weft {
namespace {

constexpr Rgb kNoAngle{120, 124, 130};
constexpr Rgb kOutside{24, 26, 29};
constexpr Rgb kCloth{58, 61, 66};
constexpr Rgb kLight{214, 217, 221};
constexpr Rgb kOnlyMeasured{230, 159, 0};
constexpr Rgb kOnlySimulated{86, 180, 233};

/// A picture from a function (row, column) -> Rgb.
template <typename ColourOf>
Picture paint(Eigen::Index rows, Eigen::Index columns, ColourOf&& colour_of) {
  Picture picture{static_cast<int>(columns), static_cast<int>(rows), {}};
  picture.rgb.reserve(static_cast<std::size_t>(3 * rows * columns));
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < columns; ++j) {
      const Rgb colour = colour_of(i, j);
      picture.rgb.insert(picture.rgb.end(), {colour.red, colour.green, colour.blue});
    }
  }
  return picture;
}

std::uint8_t srgb(float linear) {
  const float l = std::clamp(linear, 0.0f, 1.0f);
  const float s = l <= 0.0031308f ? 12.92f * l : 1.055f * std::pow(l, 1 / 2.4f) - 0.055f;
  return static_cast<std::uint8_t>(std::lround(255 * s));
}

cv::Mat to_bgr(const Picture& picture) {
  const cv::Mat rgb(picture.height, picture.width, CV_8UC3,
                    const_cast<std::uint8_t*>(picture.rgb.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  return bgr;
}

/// `encoder`: false if it cannot.
template <typename Encoder>
EncodedPicture encode(const Picture& picture, const char* mime, const Encoder& encoder) {
  EncodedPicture encoded{mime, {}, picture.width, picture.height};
  if (picture.width < 1 || picture.height < 1 || !encoder(to_bgr(picture), encoded.bytes)) {
    throw Error(fmt::format("a picture of {} x {} pixels cannot be encoded as {}", picture.width,
                            picture.height, mime));
  }
  return encoded;
}

void write_bytes(const std::filesystem::path& path, const std::vector<std::uint8_t>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw Error(path.string() + ": cannot be written");
}

EncodedPicture read_encoded(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  EncodedPicture picture;
  picture.bytes.assign(std::istreambuf_iterator<char>(file), {});
  picture.mime = path.extension() == ".png" ? "image/png" : "image/jpeg";
  const cv::Mat image = codecs().decode_picture(picture.bytes);
  if (image.empty()) throw Error(path.string() + ": is not a picture");
  picture.width = image.cols;
  picture.height = image.rows;
  return picture;
}

/// The kinds of pictures and their names in files.
constexpr std::pair<const char*, EncodedPicture FramePictures::*> kKinds[] = {
    {"measured", &FramePictures::measured},
    {"simulated", &FramePictures::simulated},
    {"silhouettes", &FramePictures::silhouettes},
    {"measured_angles", &FramePictures::measured_angles},
    {"simulated_angles", &FramePictures::simulated_angles},
    {"difference", &FramePictures::difference},
};

/// Frame of "KIND_0012"; -1 for another name.
int frame_of(const std::string& stem, std::string_view kind) {
  if (!stem.starts_with(kind) || stem.size() < kind.size() + 2 || stem[kind.size()] != '_')
    return -1;
  const std::string digits = stem.substr(kind.size() + 1);
  if (digits.size() > 8 || digits.find_first_not_of("0123456789") != std::string::npos) return -1;
  return std::stoi(digits);
}

}  // namespace

Rgb angle_colour(double angle) {
  // asinh keeps the map cyclic (odd, and one at one) and raises the contrast 12 / asinh(12) times
  // at 0.
  constexpr double kGain = 12;
  const double s = 2 * angle / std::numbers::pi;
  return colour_at(ColourMap::twilight, 0.5 + 0.5 * std::asinh(kGain * s) / std::asinh(kGain));
}

Rgb difference_colour(double difference) {
  // Zero stands out from the ground: the map is entered above its black.
  return colour_at(ColourMap::inferno, 0.08 + 0.92 * std::abs(difference) / full_difference);
}

Picture intensity_picture(const Image& linear) {
  return paint(linear.rows(), linear.cols(), [&](Eigen::Index i, Eigen::Index j) {
    const std::uint8_t grey = srgb(linear(i, j));
    return Rgb{grey, grey, grey};
  });
}

Picture angle_picture(const AngleMap& map) {
  return paint(map.angle.rows(), map.angle.cols(), [&](Eigen::Index i, Eigen::Index j) {
    return map.valid(i, j) ? angle_colour(map.angle(i, j)) : kNoAngle;
  });
}

Picture mask_picture(const Mask& mask) {
  return paint(mask.rows(), mask.cols(),
               [&](Eigen::Index i, Eigen::Index j) { return mask(i, j) ? kLight : kOutside; });
}

Picture fold_difference_picture(const FrameFeatures& measured, const AngleMap& simulated) {
  const AngleMap& map = measured.angles;
  return paint(map.angle.rows(), map.angle.cols(), [&](Eigen::Index i, Eigen::Index j) {
    if (measured.fold_mask(i, j) && map.valid(i, j) && simulated.valid(i, j)) {
      const float difference = orientation_difference(map.angle(i, j), simulated.angle(i, j));
      return difference_colour(difference);
    }
    return measured.silhouette(i, j) ? kCloth : kOutside;
  });
}

Picture silhouette_picture(const Mask& measured, const Mask& simulated) {
  return paint(measured.rows(), measured.cols(), [&](Eigen::Index i, Eigen::Index j) {
    if (measured(i, j)) return simulated(i, j) ? kLight : kOnlyMeasured;
    return simulated(i, j) ? kOnlySimulated : kOutside;
  });
}

PixelBox bounding_box(const std::vector<Mask>& masks, int margin) {
  Eigen::Index rows = 0, columns = 0, top = -1, bottom = -1, left = 0, right = 0;
  for (const Mask& mask : masks) {
    rows = mask.rows();
    columns = mask.cols();
    for (Eigen::Index i = 0; i < rows; ++i) {
      for (Eigen::Index j = 0; j < columns; ++j) {
        if (!mask(i, j)) continue;
        if (top < 0) top = bottom = i, left = right = j;
        top = std::min(top, i);
        bottom = std::max(bottom, i);
        left = std::min(left, j);
        right = std::max(right, j);
      }
    }
  }
  if (top < 0) return {0, 0, static_cast<int>(columns), static_cast<int>(rows)};
  const auto low = [&](Eigen::Index v) {
    return static_cast<int>(std::max<Eigen::Index>(0, v - margin));
  };
  const auto high = [&](Eigen::Index v, Eigen::Index size) {
    return static_cast<int>(std::min(size, v + margin + 1));
  };
  return {low(left), low(top), high(right, columns) - low(left), high(bottom, rows) - low(top)};
}

Picture crop(const Picture& picture, const PixelBox& box) {
  const int left = std::clamp(box.left, 0, picture.width),
            top = std::clamp(box.top, 0, picture.height);
  const int right = std::clamp(box.left + box.width, left, picture.width);
  const int bottom = std::clamp(box.top + box.height, top, picture.height);
  Picture result{right - left, bottom - top, {}};
  for (int i = top; i < bottom; ++i) {
    const auto row =
        picture.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(i) * picture.width + left);
    result.rgb.insert(result.rgb.end(), row, row + 3 * result.width);
  }
  return result;
}

Picture shrink(const Picture& picture, int max_width) {
  if (picture.width <= max_width || picture.height < 1) return picture;
  const int height = std::max(1, static_cast<int>(std::lround(static_cast<double>(picture.height) *
                                                              max_width / picture.width)));
  const cv::Mat source(picture.height, picture.width, CV_8UC3,
                       const_cast<std::uint8_t*>(picture.rgb.data()));
  Picture result{max_width, height,
                 std::vector<std::uint8_t>(3u * static_cast<std::size_t>(max_width) *
                                           static_cast<std::size_t>(height))};
  cv::Mat target(height, max_width, CV_8UC3, result.rgb.data());
  cv::resize(source, target, target.size(), 0, 0, cv::INTER_AREA);
  return result;
}

Picture montage(const std::vector<Picture>& pictures, int columns, int gap) {
  int cell_width = 0, cell_height = 0;
  for (const Picture& picture : pictures) {
    cell_width = std::max(cell_width, picture.width);
    cell_height = std::max(cell_height, picture.height);
  }
  const int count = static_cast<int>(pictures.size());
  columns = std::clamp(columns, 1, std::max(1, count));
  const int rows = (count + columns - 1) / columns;
  Picture result;
  result.width = columns * cell_width + (columns - 1) * gap;
  result.height = rows * cell_height + std::max(0, rows - 1) * gap;
  result.rgb.assign(
      3u * static_cast<std::size_t>(result.width) * static_cast<std::size_t>(result.height), 255);
  for (int k = 0; k < count; ++k) {
    const Picture& picture = pictures[static_cast<std::size_t>(k)];
    const int left = k % columns * (cell_width + gap), top = k / columns * (cell_height + gap);
    for (int i = 0; i < picture.height; ++i) {
      const auto* row = picture.rgb.data() + 3 * static_cast<std::ptrdiff_t>(i) * picture.width;
      std::copy(
          row, row + 3 * picture.width,
          result.rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(top + i) * result.width + left));
    }
  }
  return result;
}

EncodedPicture encode_png(const Picture& picture) {
  return encode(picture, "image/png", [](const cv::Mat& bgr, std::vector<std::uint8_t>& bytes) {
    return codecs().encode_png(bgr, bytes);
  });
}

EncodedPicture encode_jpeg(const Picture& picture, int quality) {
  return encode(picture, "image/jpeg", [&](const cv::Mat& bgr, std::vector<std::uint8_t>& bytes) {
    return codecs().encode_jpeg(bgr, quality, bytes);
  });
}

void write_picture(const std::filesystem::path& path, const Picture& picture) {
  const auto extension = path.extension();
  if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") {
    throw Error(path.string() + ": the name of a picture ends in .png, .jpg or .jpeg");
  }
  write_bytes(path, (extension == ".png" ? encode_png(picture) : encode_jpeg(picture, 90)).bytes);
}

FramePictures make_frame_pictures(const FrameView& view, const FramePicturesOptions& options) {
  const auto prepare = [&](const Picture& picture) {
    const bool whole = options.crop.width <= 0 || options.crop.height <= 0;
    return shrink(whole ? picture : crop(picture, options.crop), options.max_width);
  };
  const auto jpeg = [&](const Picture& picture) {
    return encode_jpeg(prepare(picture), options.jpeg_quality);
  };
  FramePictures result;
  result.frame = view.frame;
  result.measured = jpeg(intensity_picture(view.measured));
  result.simulated = jpeg(intensity_picture(view.simulated));
  result.silhouettes =
      jpeg(silhouette_picture(view.features.silhouette, view.simulated_silhouette));
  result.measured_angles = jpeg(angle_picture(view.features.angles));
  result.simulated_angles = jpeg(angle_picture(view.simulated_angles));
  result.difference = jpeg(fold_difference_picture(view.features, view.simulated_angles));
  return result;
}

void write_capture_pictures(const std::filesystem::path& folder, const CapturePictures& pictures) {
  std::error_code code;
  std::filesystem::create_directories(folder, code);
  if (code) throw Error(folder.string() + ": cannot be made: " + code.message());
  for (const FramePictures& frame : pictures.frames) {
    for (const auto& [kind, member] : kKinds) {
      const EncodedPicture& picture = frame.*member;
      const char* extension = picture.mime == "image/png" ? "png" : "jpg";
      write_bytes(folder / fmt::format("{}_{:04}.{}", kind, frame.frame, extension), picture.bytes);
    }
  }
}

CapturePictures read_capture_pictures(const std::filesystem::path& folder, std::string capture) {
  std::map<int, std::map<std::string, std::filesystem::path>> found;
  for (const std::filesystem::path& path : entries_of(folder)) {
    if (path.extension() != ".jpg" && path.extension() != ".png") continue;
    for (const auto& [kind, member] : kKinds) {
      const int frame = frame_of(path.stem().string(), kind);
      if (frame >= 0) found[frame][kind] = path;
    }
  }
  CapturePictures result{std::move(capture), {}};
  for (const auto& [frame, files] : found) {
    FramePictures& pictures = result.frames.emplace_back();
    pictures.frame = frame;
    for (const auto& [kind, member] : kKinds) {
      const auto file = files.find(kind);
      if (file == files.end()) {
        throw Error(fmt::format("{}: no picture \"{}\" of frame {}", folder.string(), kind, frame));
      }
      pictures.*member = read_encoded(file->second);
    }
  }
  return result;
}

}  // namespace weft
