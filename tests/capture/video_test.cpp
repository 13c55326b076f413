#include "weft/vision/video.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "capture/temporary_capture.h"
#include "weft/base/random.h"
#include "weft/mesh/mesh_io.h"

namespace weft::video_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// A striped rectangle on a dark ground, not symmetric in any way; it moves with `frame`.
Image striped_frame(const Rig& rig, int frame) {
  Image image = Image::Constant(rig.height, rig.width, 0.002f);
  for (int i = 100; i < 380; ++i) {
    for (int j = 150 + 5 * frame; j < 450; ++j) {
      image(i, j) =
          0.3f + 0.2f * std::sin(static_cast<float>(2 * std::numbers::pi * (i + 0.2 * j) / 17));
    }
  }
  return image;
}

class Video : public TemporaryCapture {
 protected:
  void SetUp() override {
    TemporaryCapture::SetUp();
    capture_ = read_capture(bundled_capture());
    capture_.frame_count = 4;
    capture_.fit_first = 1;
    capture_.fit_last = 2;
    for (int frame = 0; frame < 4; ++frame) {
      files_.frames.push_back(striped_frame(capture_.rig, frame));
    }
    target_ = folder_ / "written";
  }

  Capture capture_;
  CaptureFiles files_;
  std::filesystem::path target_;
};

TEST_F(Video, WrittenCapturesComeBack) {
  capture_.description = "quotes \" and \\ and a\ttab";
  capture_.gravity = Vec3(0.1, 0, -9.7);
  capture_.distortion = LensDistortion{1e-3, 2e-3, 3e-4, 4e-4, 5e-3};
  capture_.rig.pattern = {StripePattern::Profile::sine, 20.125, 3, 0.2};
  capture_.rig.projector_width = 1920;
  capture_.rig.projector_height = 1080;
  files_.as_images = true;
  write_capture(target_, capture_, files_);
  const Capture back = read_capture(target_);
  EXPECT_EQ(back.name, capture_.name);
  EXPECT_EQ(back.description, capture_.description);
  EXPECT_EQ(back.width, capture_.width);
  EXPECT_EQ(back.height, capture_.height);
  EXPECT_EQ(back.areal_density, capture_.areal_density);
  EXPECT_EQ(back.gravity, capture_.gravity);
  EXPECT_EQ(back.frame_rate, capture_.frame_rate);
  EXPECT_EQ(back.frame_count, 4);
  EXPECT_EQ(back.fit_first, 1);
  EXPECT_EQ(back.fit_last, 2);
  EXPECT_EQ(back.rig.width, capture_.rig.width);
  EXPECT_EQ(back.rig.height, capture_.rig.height);
  // The third row is a unit vector to rounding, and is scaled to one again.
  EXPECT_TRUE(back.rig.camera.projection().isApprox(capture_.rig.camera.projection(), 1e-14));
  EXPECT_TRUE(back.rig.projector.projection().isApprox(capture_.rig.projector.projection(), 1e-14));
  EXPECT_EQ(back.rig.pattern.profile, capture_.rig.pattern.profile);
  EXPECT_EQ(back.rig.pattern.period, capture_.rig.pattern.period);
  EXPECT_EQ(back.rig.pattern.edge_gain, capture_.rig.pattern.edge_gain);
  EXPECT_EQ(back.rig.pattern.black_level, capture_.rig.pattern.black_level);
  EXPECT_EQ(back.rig.projector_width, capture_.rig.projector_width);
  EXPECT_EQ(back.rig.projector_height, capture_.rig.projector_height);
  EXPECT_EQ(back.distortion->k3, capture_.distortion->k3);
  EXPECT_EQ(back.distortion->p1, capture_.distortion->p1);
  EXPECT_FALSE(back.truth.has_value());
}

TEST_F(Video, WrittenMotionComesBackBetweenFramesToo) {
  // A natural spline through samples that include the knots of another repeats it.
  Capture capture = capture_;
  files_.as_images = true;
  for (CaptureFixture& fixture : capture.fixtures) {
    Points samples(3, 4);
    for (int i = 0; i < 4; ++i) samples.col(i) = fixture.motion.position((40 + 4 * i) / 30.0);
    fixture.motion = Motion({0, 1 / 30.0, 2 / 30.0, 3 / 30.0}, samples);
  }
  write_capture(target_, capture, files_);
  const Capture back = read_capture(target_);
  ASSERT_EQ(back.fixtures.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(back.fixtures[k].name, capture.fixtures[k].name);
    EXPECT_EQ(back.fixtures[k].at, capture.fixtures[k].at);
    for (double time = 0; time < 0.1; time += 0.0071) {
      EXPECT_NEAR(
          (back.fixtures[k].motion.position(time) - capture.fixtures[k].motion.position(time))
              .norm(),
          0, 1e-13);
    }
  }
}

TEST_F(Video, WrittenTruthComesBack) {
  files_.as_images = true;
  TruthSurface truth;
  truth.mesh = make_swatch(0.5, 0.5, 4, 3);
  for (int i = 0; i < 4; ++i) truth.frames.push_back(Points::Random(3, 12));
  files_.truth = truth;
  write_capture(target_, capture_, files_);
  const TruthSurface back = read_truth(read_capture(target_));
  EXPECT_EQ(back.mesh.triangles, truth.mesh.triangles);
  EXPECT_NEAR((back.mesh.material - truth.mesh.material).cwiseAbs().maxCoeff(), 0, 1e-9);
  ASSERT_EQ(back.frames.size(), 4u);
  EXPECT_EQ(back.frames[2], truth.frames[2].cast<float>().cast<double>());
}

TEST_F(Video, ImagesComeBackToEightBits) {
  files_.as_images = true;
  write_capture(target_, capture_, files_);
  const std::vector<Image> back = read_video(read_capture(target_), 1, 3);
  ASSERT_EQ(back.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    // Half a step of 1/255 times the largest slope of the sRGB curve, 2.4 / 1.055.
    EXPECT_LT((back[i] - files_.frames[i + 1]).abs().maxCoeff(), 0.0045f);
  }
}

TEST_F(Video, H264ComesBackNearly) {
  write_capture(target_, capture_, files_);
  const Capture written = read_capture(target_);
  if (written.video.extension() != ".mp4") GTEST_SKIP() << "no H.264 encoder here";
  const std::vector<Image> back = read_video(written, 0, 3);
  ASSERT_EQ(back.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto rms = [&](const Image& other) {
      return std::sqrt((back[i] - other).square().mean());
    };
    // libx264 at its default quality (crf 23) is lossy; a frame flipped, swapped with its neighbour
    // or on another transfer curve is several times as far away.
    EXPECT_LT(rms(files_.frames[i]), 0.01f);
    EXPECT_GT(rms(files_.frames[(i + 1) % 4]), 0.02f);
  }
}

TEST_F(Video, OddSizesAreWrittenAsImages) {
  capture_.rig.width = 639;
  for (Image& frame : files_.frames) frame.conservativeResize(480, 639);
  write_capture(target_, capture_, files_);
  const Capture written = read_capture(target_);
  EXPECT_EQ(written.video.extension(), ".png");
  EXPECT_EQ(read_video(written, 0, 3).size(), 4u);
}

TEST_F(Video, FramesOfTheBundledVideoAreRead) {
  const std::vector<Image> frames = read_video(read_capture(bundled_capture()), 1, 2);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[0].rows(), 480);
  EXPECT_EQ(frames[0].cols(), 640);
  EXPECT_GE(frames[0].minCoeff(), 0);
  EXPECT_LE(frames[0].maxCoeff(), 1);
  EXPECT_GT(frames[0].maxCoeff(), 0.2);
}

TEST_F(Video, FramesOfAnotherSizeAreRejected) {
  files_.as_images = true;
  write_capture(target_, capture_, files_);
  for (int i = 0; i < 4; ++i) {
    write_png(target_ / ("frames/frame_000" + std::to_string(i) + ".png"),
              files_.frames[0].leftCols(600));
  }
  EXPECT_THAT(message_of([&] { read_video(read_capture(target_), 0, 3); }),
              AllOf(HasSubstr("frames of 600 x 480 px"),
                    HasSubstr("camera.width = 640, camera.height = 480")));
}

TEST_F(Video, AVideoWithFewerFramesIsRejected) {
  files_.as_images = true;
  write_capture(target_, capture_, files_);
  std::filesystem::remove(target_ / "frames/frame_0003.png");
  const Capture capture = read_capture(target_);
  EXPECT_EQ(read_video(capture, 0, 2).size(), 3u);
  EXPECT_THAT(message_of([&] { read_video(capture, 0, 3); }), HasSubstr("frame_0003.png"));
}

TEST_F(Video, AVideoThatIsNoneIsRejected) {
  EXPECT_THAT(message_of([&] { read_video(read_capture(folder_), 0, 3); }), HasSubstr("video.mp4"));
}

TEST_F(Video, AVideoWithNoClothInItIsRejected) {
  files_.as_images = true;
  Rng rng(1);
  for (float& pixel : files_.frames[2].reshaped()) {
    pixel = static_cast<float>(0.02 + 0.002 * rng.normal());
  }
  write_capture(target_, capture_, files_);
  const Capture capture = read_capture(target_);
  EXPECT_EQ(read_video(capture, 0, 1).size(), 2u);
  EXPECT_THAT(message_of([&] { read_video(capture, 1, 3); }),
              AllOf(HasSubstr("frame_%04d.png: frame 2: no cloth to be seen")));
}

TEST_F(Video, FramesThatTheCaptureLacksAreRejected) {
  EXPECT_THROW(read_video(capture_, 0, 4), Error);
  EXPECT_THROW(read_video(capture_, -1, 0), Error);
  EXPECT_THROW(read_video(capture_, 2, 1), Error);
}

TEST_F(Video, WriteRejectsImagesThatAreNotTheCaptures) {
  files_.frames.pop_back();
  EXPECT_THROW(write_capture(target_, capture_, files_), Error);
  files_.frames.push_back(Image::Zero(10, 10));
  EXPECT_THROW(write_capture(target_, capture_, files_), Error);
  EXPECT_FALSE(std::filesystem::exists(target_));
}

TEST_F(Video, WriteNamesAFolderThatCannotBeMade) {
  write("written", "a file");
  EXPECT_THAT(message_of([&] { write_capture(target_, capture_, files_); }),
              HasSubstr("cannot be made"));
}

TEST_F(Video, StripePeriodOfAProjectorAtTheCameraIsItsOwn) {
  capture_.rig.projector = capture_.rig.camera;
  capture_.rig.pattern.period = 13;
  EXPECT_NEAR(image_stripe_period(capture_), 13, 1e-9);
}

// On the hanging swatch of the first frame: counts the rising edges of stripes down a column.
TEST_F(Video, StripePeriodOfTheBundledCaptureIsThatOfItsFrames) {
  const Capture capture = read_capture(bundled_capture());
  const Image frame = read_video(capture, 0, 0)[0];
  std::vector<int> edges;
  for (int i = 130; i < 330; ++i) {
    const float mean = frame.col(320).segment(130, 200).mean();
    if (frame(i, 320) < mean && frame(i + 1, 320) >= mean) edges.push_back(i);
  }
  ASSERT_GT(edges.size(), 3u);
  const double period =
      static_cast<double>(edges.back() - edges.front()) / static_cast<double>(edges.size() - 1);
  EXPECT_NEAR(image_stripe_period(capture), period, 0.2 * period);
}

}  // namespace
}  // namespace weft::video_test
