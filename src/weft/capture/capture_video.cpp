#include <fmt/format.h>

#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/toml_reader.h"
#include "weft/capture/capture.h"
#include "weft/capture/capture_file.h"
#include "weft/capture/lens.h"
#include "weft/vision/silhouette.h"
#include "weft/vision/video.h"

namespace weft {
namespace {

/// px in the image: what find_silhouette takes, at half the size too (check_cloth).
constexpr Range kImageStripePeriod{4, 200};

void check_stripe_period(const Capture& capture, double period) {
  if (period >= kImageStripePeriod.lower && period <= kImageStripePeriod.upper) return;
  throw error_at(
      parse_capture_file(capture.folder).table("projector").where("stripe_period"),
      fmt::format("{:g} projector px are {:.3g} px in the camera's image; must be in [{:g}, {:g}]",
                  capture.rig.pattern.period, period, kImageStripePeriod.lower,
                  kImageStripePeriod.upper));
}

void check_size(const Capture& capture, const Image& frame) {
  if (frame.cols() == capture.rig.width && frame.rows() == capture.rig.height) return;
  throw error_at({capture.video, 0, {}},
                 fmt::format("frames of {} x {} px; capture.toml says camera.width = {}, "
                             "camera.height = {}",
                             frame.cols(), frame.rows(), capture.rig.width, capture.rig.height));
}

/// Averages of 2 x 2 pixels; a last odd row or column is left out.
Image half_size(const Image& image) {
  const Eigen::Index rows = image.rows() / 2, columns = image.cols() / 2;
  const auto part = [&](Eigen::Index i, Eigen::Index j) {
    return image(Eigen::seqN(i, rows, 2), Eigen::seqN(j, columns, 2));
  };
  return 0.25f * (part(0, 0) + part(0, 1) + part(1, 0) + part(1, 1));
}

void check_cloth(const Capture& capture, const Image& frame, int index, double period) {
  constexpr double kLeastConfidence = 3;  // see SilhouetteResult
  // Whether there is cloth shows at half the size too, in a quarter of the time.
  const double confidence =
      find_silhouette(half_size(frame), {.stripe_period = period / 2}).confidence;
  if (confidence >= kLeastConfidence) return;
  throw error_at(
      {capture.video, 0, {}},
      fmt::format("frame {}: no cloth to be seen (contrast to the background {:.2g} of its "
                  "spread; at least {:g} is needed)",
                  index, confidence, kLeastConfidence));
}

}  // namespace

double image_stripe_period(const Capture& capture) {
  Vec3 center = Vec3::Zero();
  for (const CaptureFixture& fixture : capture.fixtures) center += fixture.motion.position(0);
  center /= static_cast<double>(capture.fixtures.size());
  const Pinhole& camera = capture.rig.camera;
  const Vec3 image = camera.project(center);
  const auto projector_y = [&](double dx, double dy) {
    const Vec2 pixel(image.x() + dx, image.y() + dy);
    return capture.rig.projector.project(camera.unproject(pixel, image.z())).y();
  };
  const double here = projector_y(0, 0);
  const double gradient = Vec2(projector_y(1, 0) - here, projector_y(0, 1) - here).norm();
  return capture.rig.pattern.period / gradient;
}

std::vector<Image> read_video(const Capture& capture, int first, int last) {
  if (first < 0 || last < first || last >= capture.frame_count) {
    throw Error(fmt::format("frames {} to {}: the capture \"{}\" has frames 0 to {}", first, last,
                            capture.name, capture.frame_count - 1));
  }
  const double period = image_stripe_period(capture);
  check_stripe_period(capture, period);
  std::vector<Image> frames = read_frames(capture.video, last + 1);
  frames.erase(frames.begin(), frames.begin() + first);
  frames.resize(static_cast<std::size_t>(last - first + 1));
  for (const Image& frame : frames) check_size(capture, frame);
  parallel_for(frames.size(), 0, [&](std::size_t i) {
    if (capture.distortion)
      frames[i] = undistort(frames[i], capture.rig.camera, *capture.distortion);
    check_cloth(capture, frames[i], first + static_cast<int>(i), period);
  });
  return frames;
}

}  // namespace weft
