#include "weft/capture/capture_checks.h"

#include <fmt/format.h>

#include <algorithm>

#include "weft/base/files.h"
#include "weft/base/quantile.h"
#include "weft/capture/capture_file.h"

namespace weft {
namespace {

double frame_time(const Capture& capture, int frame) { return frame / capture.frame_rate; }

bool is_pattern(const std::filesystem::path& video) {
  return video.filename().string().find('%') != std::string::npos;
}

/// Checks one pair of fixtures at one time.
void check_pair(const CaptureFixture& a, const CaptureFixture& b, double time,
                const SourceLocation& where) {
  const double rest = (a.at - b.at).norm();
  const double distance = (a.motion.position(time) - b.motion.position(time)).norm();
  if (distance < kLeastDistance * rest)
    throw error_at(where,
                   fmt::format("at {:.4g} s \"{}\" and \"{}\" are {:.3g} m apart; valid: from "
                               "{:g} of their distance on the undeformed swatch, {:.5g} m",
                               time, a.name, b.name, distance, kLeastDistance, rest));
  if (distance <= kMaxStretch * rest) return;
  throw error_at(where, fmt::format("at {:.4g} s \"{}\" and \"{}\" are {:.5g} m apart; on the "
                                    "undeformed swatch they are {:.5g} m apart, and cloth is taken "
                                    "to stretch to {:.5g} m at most",
                                    time, a.name, b.name, distance, rest, kMaxStretch * rest));
}

void check_other_motion(const CaptureFixture& a, const CaptureFixture& b,
                        const FixtureSamples& of_a, const FixtureSamples& of_b) {
  if (of_a.file != of_b.file || of_a.columns != of_b.columns) return;
  throw error_at(of_b.columns_where, fmt::format("\"{}\" and \"{}\" have the same columns of {}",
                                                 a.name, b.name, of_b.file.filename().string()));
}

double median_interval(const std::vector<double>& times) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < times.size(); ++i) intervals.push_back(times[i] - times[i - 1]);
  return quantile(std::move(intervals), 0.5);
}

struct Device {
  const Pinhole& pinhole;
  std::string_view name;
  double width, height;  ///< px; 0: unlimited
  const SourceLocation& where;
};

void check_device(const Capture& capture, const Device& device) {
  for (const CaptureFixture& fixture : capture.fixtures) {
    for (int frame = 0; frame < capture.frame_count; ++frame) {
      const Vec3 image =
          device.pinhole.project(fixture.motion.position(frame_time(capture, frame)));
      if (image.z() <= 0) {
        throw error_at(device.where, fmt::format("\"{}\" is behind the {} at frame {}",
                                                 fixture.name, device.name, frame));
      }
      const bool inside = image.x() >= 0 && image.x() <= device.width && image.y() >= 0 &&
                          image.y() <= device.height;
      if (frame == 0 && device.width > 0 && !inside) {
        throw error_at(device.where,
                       fmt::format("the {} does not see \"{}\": at frame 0 it projects to ({:.1f}, "
                                   "{:.1f}) px, outside its {:g} x {:g} px",
                                   device.name, fixture.name, image.x(), image.y(), device.width,
                                   device.height));
      }
    }
  }
}

}  // namespace

void check_file_exists(const std::filesystem::path& file, const SourceLocation& where) {
  if (!is_file(file, where)) throw error_at(where, fmt::format("no such file: {}", file.string()));
}

void check_video_exists(const std::filesystem::path& video, const SourceLocation& where) {
  const bool found =
      is_pattern(video) ? is_folder(video.parent_path(), where) : is_file(video, where);
  if (!found) throw error_at(where, fmt::format("no such file: {}", video.string()));
}

void check_covers_video(const Capture& capture, const MotionFile& file) {
  const double last_frame = frame_time(capture, capture.frame_count - 1);
  // Times rounded when they were written may fall short by a little; a frame less must not.
  const double slack = 0.05 / capture.frame_rate;
  const double first = file.times().front(), last = file.times().back();
  if (first > slack) {
    throw error_at(
        {file.path(), 0, "time_s"},
        fmt::format("starts at {:g} s; must start at or before the first frame, 0 s", first));
  }
  if (last < last_frame - slack) {
    throw error_at({file.path(), 0, "time_s"},
                   fmt::format("ends at {:g} s; the video's {} frames at {:g}/s last until {:g} s",
                               last, capture.frame_count, capture.frame_rate, last_frame));
  }
}

void check_stretch(const Capture& capture, const std::vector<FixtureSamples>& samples) {
  for (std::size_t j = 1; j < capture.fixtures.size(); ++j) {
    for (std::size_t i = 0; i < j; ++i) {
      const CaptureFixture &a = capture.fixtures[i], &b = capture.fixtures[j];
      if ((a.at - b.at).norm() < 1e-6) {
        throw error_at(samples[j].where, fmt::format("\"{}\" and \"{}\" hold the same point of the "
                                                     "swatch",
                                                     a.name, b.name));
      }
      check_other_motion(a, b, samples[i], samples[j]);
      for (const std::size_t k : {i, j}) {
        for (const double time : samples[k].times) check_pair(a, b, time, samples[j].where);
      }
      for (int frame = 0; frame < capture.frame_count; ++frame) {
        check_pair(a, b, frame_time(capture, frame), samples[j].where);
      }
    }
  }
}

double motion_sample_interval(const Capture& capture) {
  const TomlTable file = parse_capture_file(capture.folder);
  double longest = 0;
  for (const TomlTable& fixture : file.tables("fixture"))
    longest = std::max(
        longest, median_interval(MotionFile(capture.folder / fixture.string("motion")).times()));
  return longest;
}

void check_view(const Capture& capture, const ViewLocations& where) {
  const Rig& rig = capture.rig;
  check_device(capture, {rig.camera, "camera", static_cast<double>(rig.width),
                         static_cast<double>(rig.height), where.camera});
  check_device(capture, {rig.projector, "projector", rig.projector_width, rig.projector_height,
                         where.projector});
}

}  // namespace weft
