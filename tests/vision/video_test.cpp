#include "weft/vision/video.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/vision/codecs.h"

namespace weft::video_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class Video : public ::testing::Test {
 protected:
  /// What read_frames throws.
  std::string failure(const fs::path& path, int count) {
    try {
      read_frames(path, count);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing thrown";
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
};

/// Light that differs from frame to frame and over the picture.
Image ramp(int frame, int width = 64, int height = 48) {
  Image image(height, width);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image(y, x) = float(0.02 + 0.1 * frame + 0.5 * x / width + 0.1 * y / height);
  return image;
}

TEST_F(Video, NumberedImagesComeBack) {
  for (int frame = 0; frame < 3; ++frame)
    write_png(folder_ / ("f_" + std::to_string(100 + frame).substr(1) + ".png"), ramp(frame));
  const auto frames = read_frames(folder_ / "f_%02d.png", 3);
  ASSERT_EQ(frames.size(), 3U);
  for (int frame = 0; frame < 3; ++frame)
    // Half a code of 8-bit sRGB is at most 1.0 % of full scale (at white).
    EXPECT_LT((frames[std::size_t(frame)] - ramp(frame)).abs().maxCoeff(), 0.01 * 0.5 * 1.0 + 1e-4);
}

TEST_F(Video, NumbersMayStartAtOne) {
  write_png(folder_ / "1.png", ramp(0));
  write_png(folder_ / "2.png", ramp(1));
  EXPECT_LT((read_frames(folder_ / "%d.png", 2)[1] - ramp(1)).abs().maxCoeff(), 0.006);
}

TEST_F(Video, GreyIsTheLumaOfLinearLight) {
  // sRGB 188 is linear 0.5029 by the curve's definition; Rec. 709 weights.
  cv::Mat picture(2, 3, CV_8UC3, cv::Scalar(0, 0, 0));
  picture.at<cv::Vec3b>(0, 0) = {0, 0, 188};
  picture.at<cv::Vec3b>(0, 1) = {0, 188, 0};
  picture.at<cv::Vec3b>(0, 2) = {188, 0, 0};
  picture.at<cv::Vec3b>(1, 0) = {188, 188, 188};
  picture.at<cv::Vec3b>(1, 1) = {255, 255, 255};
  picture.at<cv::Vec3b>(1, 2) = {8, 8, 8};  // the straight part of the curve
  codecs().write_picture((folder_ / "0.png").string(), picture);
  const Image grey = read_frames(folder_ / "%d.png", 1).front();
  EXPECT_NEAR(grey(0, 0), 0.2126 * 0.50289, 1e-5);
  EXPECT_NEAR(grey(0, 1), 0.7152 * 0.50289, 1e-5);
  EXPECT_NEAR(grey(0, 2), 0.0722 * 0.50289, 1e-5);
  EXPECT_NEAR(grey(1, 0), 0.50289, 1e-5);
  EXPECT_NEAR(grey(1, 1), 1, 1e-6);
  EXPECT_NEAR(grey(1, 2), 8.0 / 255 / 12.92, 1e-6);
}

TEST_F(Video, SixteenBitImagesKeepTheirDepth) {
  cv::Mat picture(1, 2, CV_16UC1);
  picture.at<std::uint16_t>(0, 0) = 48400;
  picture.at<std::uint16_t>(0, 1) = 48401;
  codecs().write_picture((folder_ / "0.png").string(), picture);
  const Image grey = read_frames(folder_ / "%d.png", 1).front();
  EXPECT_NEAR(grey(0, 0), std::pow((48400.0 / 65535 + 0.055) / 1.055, 2.4), 1e-6);
  EXPECT_GT(grey(0, 1), grey(0, 0));
}

TEST_F(Video, EncodedFramesComeBackInOrder) {
  const fs::path file = folder_ / "video.avi";
  std::unique_ptr<VideoWriter> writer = codecs().create_video(file.string(), "MJPG", 30, 64, 48);
  if (!writer) GTEST_SKIP() << "no encoder";
  for (int frame = 0; frame < 4; ++frame) {
    write_png(folder_ / "frame.png", ramp(frame));
    writer->write(codecs().read_picture((folder_ / "frame.png").string(), PictureChannels::colour));
  }
  writer.reset();
  const auto frames = read_frames(file, 4);
  ASSERT_EQ(frames.size(), 4U);
  for (int frame = 0; frame < 4; ++frame) {
    const Image& read = frames[std::size_t(frame)];
    EXPECT_LT(std::abs(read.mean() - ramp(frame).mean()), 0.02);  // frames differ by 0.1
    EXPECT_LT((read - ramp(frame)).abs().mean(), 0.02);
  }
  EXPECT_EQ(read_frames(file, 2).size(), 2U);
  EXPECT_THAT(failure(file, 5), AllOf(HasSubstr("video.avi"), HasSubstr("frame 4")));
}

TEST_F(Video, ErrorsNameTheFileAndTheFrame) {
  EXPECT_THAT(failure(folder_ / "none.mp4", 1), HasSubstr("none.mp4"));
  EXPECT_THAT(failure(folder_, 1), HasSubstr(folder_.filename().string()));
  const std::string longest(300, 'a');
  for (const std::string& name : {longest, longest + "_%d.png"})
    EXPECT_THAT(failure(folder_ / name, 1), AllOf(HasSubstr(longest), HasSubstr("too long")));
  write_png(folder_ / "a_0.png", ramp(0));
  write_png(folder_ / "a_2.png", ramp(0));
  EXPECT_THAT(failure(folder_ / "a_%d.png", 3), AllOf(HasSubstr("a_1.png"), HasSubstr("frame 1")));
  write_png(folder_ / "a_1.png", ramp(0, 32));
  EXPECT_THAT(failure(folder_ / "a_%d.png", 3), AllOf(HasSubstr("a_1.png"), HasSubstr("32 x 48")));
  std::ofstream(folder_ / "a_1.png") << "no picture";
  EXPECT_THAT(failure(folder_ / "a_%d.png", 3), AllOf(HasSubstr("a_1.png"), HasSubstr("read")));
  EXPECT_THAT(failure(folder_ / "a_0.png", 0), HasSubstr("at least 1"));
}

TEST_F(Video, RefusesOtherPatterns) {
  for (const char* name : {"a_%s.png", "a_%x.png", "a_%4d.png", "a_%04d_%d.png", "100%.png",
                           "a_%0.d.png", "a_%n%d.png"})
    EXPECT_THAT(failure(folder_ / name, 1), HasSubstr(name)) << name;
}

TEST_F(Video, WritingToNowhereFails) {
  EXPECT_THROW(write_png(folder_ / "missing" / "a.png", ramp(0)), Error);
  EXPECT_THROW(write_png(folder_ / "a.unknown", ramp(0)), Error);
}

}  // namespace
}  // namespace weft::video_test
