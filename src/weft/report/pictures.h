#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "weft/base/types.h"
#include "weft/objective/fold_metric.h"
#include "weft/report/colour_map.h"

namespace weft {

/// A colour picture for people: 8 bits a channel, sRGB, rows from the top, RGB interleaved.
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< 3 * width * height
};

/// Intensity in linear light, 0 to 1, with the sRGB curve put on.
Picture intensity_picture(const Image& linear);
/// The colour of an orientation, rad, modulo pi: the cyclic map `twilight`, 0 lightest, pi/2
/// darkest, with more of its colours spent on small angles, where stripes on cloth mostly lie.
Rgb angle_colour(double angle);
/// Orientation by angle_colour; pixels without an angle are grey.
Picture angle_picture(const AngleMap& map);
/// 1 light, 0 dark.
Picture mask_picture(const Mask& mask);
/// The colour of a difference of orientations, rad: from 0 (dark violet) to `full_difference` and
/// more (light yellow).
inline constexpr double full_difference = 0.349;  ///< rad, 20 degrees
Rgb difference_colour(double difference);
/// Where the folds disagree: |angle difference| where `measured.fold_mask` is 1 and both angles are
/// valid: what equation 5 squares and sums. The rest of the measured cloth is grey, what lies
/// outside darker.
Picture fold_difference_picture(const FrameFeatures& measured, const AngleMap& simulated);
/// Where the silhouettes disagree (equation 6): both light grey, only measured orange, only
/// simulated blue, neither dark.
Picture silhouette_picture(const Mask& measured, const Mask& simulated);

/// A part of a picture, clamped to it. Pixels.
struct PixelBox {
  int left = 0, top = 0, width = 0, height = 0;
};
/// The box of all non-zero pixels of the masks, which have one size, grown by `margin`; the whole
/// picture if there are none.
PixelBox bounding_box(const std::vector<Mask>& masks, int margin);
Picture crop(const Picture& picture, const PixelBox& box);
/// Shrunk to at most `max_width` by averaging areas; never enlarged.
Picture shrink(const Picture& picture, int max_width);
/// Side by side in rows of `columns`, `gap` px of white between them. Pictures may differ in size.
Picture montage(const std::vector<Picture>& pictures, int columns, int gap = 8);

/// A picture as the bytes of a file.
struct EncodedPicture {
  std::string mime;  ///< "image/jpeg" or "image/png"
  std::vector<std::uint8_t> bytes;
  int width = 0, height = 0;  ///< px
};
EncodedPicture encode_png(const Picture& picture);
EncodedPicture encode_jpeg(const Picture& picture, int quality);

/// PNG or JPEG, by the extension of `path`. Throws Error if it cannot be written.
void write_picture(const std::filesystem::path& path, const Picture& picture);

/// All that a report shows of one frame.
struct FrameView {
  int frame = 0;              ///< of the capture
  Image measured, simulated;  ///< intensity, linear light
  FrameFeatures features;     ///< of the measured frame
  AngleMap simulated_angles;
  Mask simulated_silhouette;
};
/// The same as encoded pictures, cropped to one box.
struct FramePictures {
  int frame = 0;
  EncodedPicture measured, simulated, silhouettes, measured_angles, simulated_angles, difference;
};
struct FramePicturesOptions {
  PixelBox crop;        ///< empty: the whole frame
  int max_width = 360;  ///< px
  int jpeg_quality = 80;
};
FramePictures make_frame_pictures(const FrameView& view, const FramePicturesOptions& options);

/// The pictures of one capture, in the order of its frames.
struct CapturePictures {
  std::string capture;  ///< its name
  std::vector<FramePictures> frames;
};

/// Keeps the pictures in `folder` as files named KIND_FRAME.jpg or .png, so that a report can be
/// made again; reads them back (all six kinds of a frame must be there). Throws Error for what
/// cannot be written or read.
void write_capture_pictures(const std::filesystem::path& folder, const CapturePictures& pictures);
CapturePictures read_capture_pictures(const std::filesystem::path& folder, std::string capture);

}  // namespace weft
