#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>

#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/capture/capture.h"
#include "weft/capture/srgb.h"
#include "weft/mesh/mesh_io.h"
#include "weft/vision/codecs.h"
#include "weft/vision/video.h"

namespace weft {
namespace {

constexpr std::string_view kMotionFile = "fixtures.csv";
/// Samples of motion a frame: a spline through them follows the one that is written at least as
/// closely as the cloth can tell, and repeats it where its own samples are at frame times.
constexpr int kSamplesPerFrame = 4;

/// The shortest text that reads back as the same double.
std::string number(double value) { return fmt::format("{}", value); }

std::string projection_text(const Projection& projection) {
  std::string text = "projection = [\n";
  for (int row = 0; row < 3; ++row) {
    text += fmt::format("  [{}, {}, {}, {}]{}\n", projection(row, 0), projection(row, 1),
                        projection(row, 2), projection(row, 3), row < 2 ? "," : "");
  }
  return text + "]\n";
}

std::string fixture_column(std::size_t fixture, char axis) {
  return fmt::format("fixture{}_{}_m", fixture, axis);
}

std::string head_text(const Capture& capture, std::string_view video) {
  std::string text = "format = \"weft-capture\"\nversion = 1\nkind = \"video\"\n";
  text += "name = " + toml_string(capture.name) + "\n";
  text += "description = " + toml_string(capture.description) + "\n";
  text += "\n[swatch]\n";
  text += "width = " + number(capture.width) + "  # m, along u (weft)\n";
  text += "height = " + number(capture.height) + "  # m, along v (warp)\n";
  text += "areal_density = " + number(capture.areal_density) + "  # kg/m^2\n";
  text += "hem_width = " + number(capture.hem_width) + "  # m\n";
  text += fmt::format("\n[world]\ngravity = [{}, {}, {}]  # m/s^2\n", capture.gravity.x(),
                      capture.gravity.y(), capture.gravity.z());
  text += "\n[video]\n";
  text += "file = " + toml_string(video) + "\n";
  text += "frame_rate = " + number(capture.frame_rate) + "  # 1/s\n";
  text += fmt::format("frame_count = {}\n", capture.frame_count);
  text += fmt::format("fit_frames = [{}, {}]  # inclusive\n", capture.fit_first, capture.fit_last);
  text += "start = \"at-rest\"\n";
  return text;
}

std::string rig_text(const Capture& capture) {
  const Rig& rig = capture.rig;
  std::string text =
      fmt::format("\n[camera]\nwidth = {}   # px\nheight = {}  # px\n", rig.width, rig.height);
  text += projection_text(rig.camera.projection());
  if (const auto& lens = capture.distortion) {
    text += fmt::format("distortion = [{}, {}, {}, {}, {}]  # k1, k2, p1, p2, k3\n", lens->k1,
                        lens->k2, lens->p1, lens->p2, lens->k3);
  }
  text += "\n[projector]\n" + projection_text(rig.projector.projection());
  const bool sine = rig.pattern.profile == StripePattern::Profile::sine;
  text += fmt::format("pattern = \"{}\"\n", sine ? "sine" : "square");
  text += "stripe_period = " + number(rig.pattern.period) + "  # projector px along y\n";
  text += "edge_gain = " + number(rig.pattern.edge_gain) + "\n";
  text += "black_level = " + number(rig.pattern.black_level) + "\n";
  if (rig.projector_width > 0) {
    text += "width = " + number(rig.projector_width) + "   # px\n";
    text += "height = " + number(rig.projector_height) + "  # px\n";
  }
  return text;
}

std::string fixtures_text(const Capture& capture) {
  std::string text;
  for (std::size_t i = 0; i < capture.fixtures.size(); ++i) {
    const CaptureFixture& fixture = capture.fixtures[i];
    text += "\n[[fixture]]\nname = " + toml_string(fixture.name) + "\nkind = \"point\"\n";
    text += fmt::format("at = [{}, {}]  # (u, v), m\n", fixture.at.x(), fixture.at.y());
    text += "motion = " + toml_string(kMotionFile) + "\n";
    text += fmt::format("columns = [\"{}\", \"{}\", \"{}\"]\n", fixture_column(i, 'x'),
                        fixture_column(i, 'y'), fixture_column(i, 'z'));
  }
  return text;
}

std::string motion_text(const Capture& capture) {
  std::string text = "time_s";
  for (std::size_t i = 0; i < capture.fixtures.size(); ++i) {
    for (const char axis : {'x', 'y', 'z'}) (text += ',') += fixture_column(i, axis);
  }
  text += "\n";
  for (int sample = 0; sample <= (capture.frame_count - 1) * kSamplesPerFrame; ++sample) {
    const double time = sample / (kSamplesPerFrame * capture.frame_rate);
    text += number(time);
    for (const CaptureFixture& fixture : capture.fixtures) {
      const Vec3 position = fixture.motion.position(time);
      for (int axis = 0; axis < 3; ++axis) text += fmt::format(",{}", position[axis]);
    }
    text += "\n";
  }
  return text;
}

/// False where this machine's OpenCV has no H.264 encoder, or cannot encode this size.
bool write_h264(const std::filesystem::path& path, const std::vector<Image>& frames, double rate) {
  const int rows = static_cast<int>(frames.front().rows());
  const int columns = static_cast<int>(frames.front().cols());
  // 4:2:0 has one colour sample for 2 x 2 pixels.
  if (rows % 2 != 0 || columns % 2 != 0) return false;
  const std::unique_ptr<VideoWriter> writer =
      codecs().create_video(path.string(), "avc1", rate, columns, rows);
  if (!writer) return false;
  cv::Mat picture(rows, columns, CV_8UC3);
  for (const Image& frame : frames) {
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) {
        const unsigned char grey = srgb_byte(static_cast<double>(frame(i, j)));
        picture.at<cv::Vec3b>(i, j) = cv::Vec3b(grey, grey, grey);
      }
    }
    writer->write(picture);
  }
  return true;
}

/// Returns what [video] file is called.
std::string write_video(const std::filesystem::path& folder, const Capture& capture,
                        const CaptureFiles& files) {
  std::string video = "video.mp4";
  if (!files.as_images && write_h264(folder / video, files.frames, capture.frame_rate))
    return video;
  make_folder(folder / "frames");
  for (std::size_t i = 0; i < files.frames.size(); ++i) {
    write_png(folder / "frames" / fmt::format("frame_{:04}.png", i), files.frames[i]);
  }
  return "frames/frame_%04d.png";
}

std::string write_truth(const std::filesystem::path& folder, const TruthSurface& truth) {
  make_folder(folder / "truth");
  Points flat = Points::Zero(3, truth.mesh.vertex_count());
  flat.row(0) = truth.mesh.material.row(0);
  flat.row(2) = -truth.mesh.material.row(1);
  write_obj(folder / "truth/rest.obj", truth.mesh, flat,
            "rest grid of the true surface; vt = (u, v) in m on the undeformed swatch");
  write_pc2(folder / "truth/points.pc2", {.frames = truth.frames});
  return "\n[truth]\nrest_mesh = \"truth/rest.obj\"\npoints = \"truth/points.pc2\"\n";
}

void check_frames(const std::filesystem::path& folder, const Capture& capture,
                  const CaptureFiles& files) {
  if (files.frames.size() != static_cast<std::size_t>(capture.frame_count)) {
    throw error_at({folder, 0, {}}, fmt::format("{} images for a capture of {} frames",
                                                files.frames.size(), capture.frame_count));
  }
  for (const Image& frame : files.frames) {
    if (frame.rows() != capture.rig.height || frame.cols() != capture.rig.width) {
      throw error_at({folder, 0, {}},
                     fmt::format("an image of {} x {} px for a camera of {} x {} px", frame.cols(),
                                 frame.rows(), capture.rig.width, capture.rig.height));
    }
  }
}

}  // namespace

void write_capture(const std::filesystem::path& folder, const Capture& capture,
                   const CaptureFiles& files) {
  check_frames(folder, capture, files);
  make_folder(folder);
  const std::string video = write_video(folder, capture, files);
  std::string text = head_text(capture, video) + rig_text(capture) + fixtures_text(capture);
  if (files.truth) text += write_truth(folder, *files.truth);
  write_text(folder / kMotionFile, motion_text(capture));
  // Last: a folder with a capture.toml is a whole capture.
  write_text(folder / "capture.toml", text);
}

}  // namespace weft
