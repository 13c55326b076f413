#include "weft/report/pictures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>
#include <opencv2/core.hpp>

#include "common/temporary_folder.h"
#include "report/sample_report.h"
#include "weft/base/error.h"
#include "weft/vision/codecs.h"

namespace weft::pictures_test {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

Rgb at(const Picture& picture, int row, int column) {
  const auto k = static_cast<std::size_t>(3 * (row * picture.width + column));
  return {picture.rgb[k], picture.rgb[k + 1], picture.rgb[k + 2]};
}

Picture decode(const EncodedPicture& encoded) {
  const cv::Mat bgr = codecs().decode_picture(encoded.bytes);
  Picture picture{bgr.cols, bgr.rows, {}};
  for (int i = 0; i < bgr.rows; ++i) {
    for (int j = 0; j < bgr.cols; ++j) {
      const auto& c = bgr.at<cv::Vec3b>(i, j);
      picture.rgb.insert(picture.rgb.end(), {c[2], c[1], c[0]});
    }
  }
  return picture;
}

AngleMap angles(std::initializer_list<float> row) {
  AngleMap map;
  map.angle.resize(1, static_cast<Eigen::Index>(row.size()));
  Eigen::Index j = 0;
  for (const float angle : row) map.angle(0, j++) = angle;
  map.strength = Image::Ones(1, map.angle.cols());
  map.valid = Mask::Ones(1, map.angle.cols());
  return map;
}

TEST(Pictures, IntensityGetsTheSrgbCurve) {
  Image linear(1, 5);
  linear << 0, 0.002f, 0.2140411f, 1, 2;
  const Picture picture = intensity_picture(linear);
  // IEC 61966-2-1: linear 0.2140411 is 0.5, and 12.92 * 0.002 * 255 = 6.6.
  const int expected[] = {0, 7, 128, 255, 255};
  for (int j = 0; j < 5; ++j) EXPECT_NEAR(at(picture, 0, j).green, expected[j], 1);
}

TEST(Pictures, AnglesAreColouredModuloPi) {
  const Picture picture = angle_picture(angles({-kPi / 2 + 1e-4f, kPi / 2, 0, 0.3f, -0.3f}));
  EXPECT_NEAR(at(picture, 0, 0).red, at(picture, 0, 1).red, 6);
  EXPECT_NEAR(at(picture, 0, 0).blue, at(picture, 0, 1).blue, 6);
  EXPECT_GT(luminance(at(picture, 0, 2)), luminance(at(picture, 0, 3)));
  EXPECT_GT(luminance(at(picture, 0, 3)), luminance(at(picture, 0, 1)));
  EXPECT_NE(at(picture, 0, 3), at(picture, 0, 4));
}

TEST(Pictures, PixelsWithoutAnAngleAreGrey) {
  AngleMap map = angles({0.1f, 0.1f});
  map.valid(0, 1) = 0;
  const Rgb grey = at(angle_picture(map), 0, 1);
  EXPECT_LT(grey.blue - grey.red, 20);
  EXPECT_NE(at(angle_picture(map), 0, 0), grey);
}

TEST(Pictures, FoldDifferenceShowsWhatTheMetricSums) {
  FrameFeatures measured;
  measured.angles = angles({0, 0, 0, 0, kPi / 2, 0});
  measured.fold_mask = Mask::Ones(1, 6);
  measured.fold_mask(0, 2) = 0;
  measured.silhouette = Mask::Ones(1, 6);
  measured.silhouette(0, 5) = 0;
  measured.fold_mask(0, 5) = 0;
  AngleMap simulated = angles({0, 0.2f, 0.2f, 0.2f, -kPi / 2 + 0.2f, 0.2f});
  simulated.valid(0, 3) = 0;
  const Picture picture = fold_difference_picture(measured, simulated);
  EXPECT_EQ(at(picture, 0, 0), difference_colour(0));
  EXPECT_EQ(at(picture, 0, 1), difference_colour(0.2));
  EXPECT_EQ(at(picture, 0, 4), difference_colour(0.2));  // wrapped at pi
  EXPECT_EQ(at(picture, 0, 2), at(picture, 0, 3));       // not in the mask, not valid
  EXPECT_NE(at(picture, 0, 2), difference_colour(0));
  EXPECT_LT(luminance(at(picture, 0, 5)), luminance(at(picture, 0, 2)));
}

TEST(Pictures, SilhouettesHaveFourColours) {
  Mask measured(1, 4), simulated(1, 4);
  measured << 0, 0, 1, 1;
  simulated << 0, 1, 0, 1;
  const Picture picture = silhouette_picture(measured, simulated);
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < i; ++j) EXPECT_NE(at(picture, 0, i), at(picture, 0, j));
  }
}

TEST(Pictures, BoundingBoxHoldsAllMasksAndIsClamped) {
  Mask a = Mask::Zero(10, 20), b = Mask::Zero(10, 20);
  a(4, 6) = 1;
  b(7, 18) = 1;
  const PixelBox box = bounding_box({a, b}, 2);
  EXPECT_EQ(box.left, 4);
  EXPECT_EQ(box.top, 2);
  EXPECT_EQ(box.width, 16);  // 4 to 19
  EXPECT_EQ(box.height, 8);  // 2 to 9
  const PixelBox whole = bounding_box({Mask::Zero(10, 20)}, 2);
  EXPECT_EQ(whole.width, 20);
  EXPECT_EQ(whole.height, 10);
}

TEST(Pictures, CropAndMontageKeepPixelsInPlace) {
  Picture picture{3, 2, {}};
  for (std::uint8_t k = 0; k < 18; ++k) picture.rgb.push_back(k);
  const Picture part = crop(picture, {1, 1, 5, 5});
  EXPECT_EQ(part.width, 2);
  EXPECT_EQ(part.height, 1);
  EXPECT_EQ(at(part, 0, 0), at(picture, 1, 1));
  const Picture sheet = montage({picture, part, picture}, 2, 1);
  EXPECT_EQ(sheet.width, 7);
  EXPECT_EQ(sheet.height, 5);
  EXPECT_EQ(at(sheet, 1, 2), at(picture, 1, 2));
  EXPECT_EQ(at(sheet, 0, 4), at(part, 0, 0));
  EXPECT_EQ(at(sheet, 3, 0), at(picture, 0, 0));
  EXPECT_EQ(at(sheet, 2, 0), (Rgb{255, 255, 255}));
}

TEST(Pictures, ShrinkingAveragesAndNeverEnlarges) {
  const Picture checks{4, 2, {0,   0,   0,   200, 200, 200, 0,   0,   0,   200, 200, 200,
                              200, 200, 200, 0,   0,   0,   200, 200, 200, 0,   0,   0}};
  const Picture half = shrink(checks, 2);
  ASSERT_EQ(half.width, 2);
  ASSERT_EQ(half.height, 1);
  EXPECT_EQ(at(half, 0, 0), (Rgb{100, 100, 100}));
  EXPECT_EQ(shrink(checks, 100).width, 4);
}

TEST(Pictures, PngKeepsEveryPixelAndJpegNearly) {
  Picture picture{16, 16, {}};
  for (int k = 0; k < 256; ++k) {
    const auto shade = static_cast<std::uint8_t>(k);
    picture.rgb.insert(picture.rgb.end(), {shade, static_cast<std::uint8_t>(255 - k), 30});
  }
  EXPECT_EQ(decode(encode_png(picture)).rgb, picture.rgb);
  const EncodedPicture jpeg = encode_jpeg(picture, 95);
  EXPECT_EQ(jpeg.mime, "image/jpeg");
  EXPECT_NEAR(at(decode(jpeg), 8, 8).red, at(picture, 8, 8).red, 12);
  EXPECT_THROW(encode_png({}), Error);
}

class PictureFiles : public ::testing::Test {
 protected:
  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

TEST_F(PictureFiles, PicturesOfACaptureReadBackInOrderOfFrames) {
  const CapturePictures pictures = test::sample_pictures("a", 3);
  write_capture_pictures(folder_, pictures);
  const CapturePictures back = read_capture_pictures(folder_, "a");
  ASSERT_EQ(back.frames.size(), 3u);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(back.frames[k].frame, static_cast<int>(k));
    EXPECT_EQ(back.frames[k].measured.bytes, pictures.frames[k].measured.bytes);
    EXPECT_EQ(back.frames[k].measured_angles.bytes, pictures.frames[k].measured_angles.bytes);
    EXPECT_EQ(back.frames[k].difference.bytes, pictures.frames[k].difference.bytes);
    EXPECT_EQ(back.frames[k].difference.width, 2);
  }
}

TEST_F(PictureFiles, MissingAndBrokenPicturesAreRejected) {
  write_capture_pictures(folder_, test::sample_pictures("a", 2));
  std::filesystem::remove(folder_ / "simulated_0001.png");
  EXPECT_THROW(read_capture_pictures(folder_, "a"), Error);
  std::filesystem::copy_file(folder_ / "simulated_0000.png", folder_ / "simulated_0001.png");
  EXPECT_NO_THROW(read_capture_pictures(folder_, "a"));
  std::filesystem::resize_file(folder_ / "simulated_0001.png", 5);
  EXPECT_THROW(read_capture_pictures(folder_, "a"), Error);
  EXPECT_THROW(read_capture_pictures(folder_ / "none", "a"), Error);
}

TEST_F(PictureFiles, TheNameOfAPictureSaysItsFormat) {
  std::filesystem::create_directories(folder_);
  const Picture picture{1, 1, {1, 2, 3}};
  write_picture(folder_ / "a.png", picture);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "a.png"));
  EXPECT_THROW(write_picture(folder_ / "a.gif", picture), Error);
  EXPECT_THROW(write_picture(folder_ / "no" / "a.png", picture), Error);
}

TEST(Pictures, ViewOfAFrameIsCroppedAndShrunk) {
  FrameView view;
  view.frame = 7;
  view.measured = view.simulated = Image::Zero(40, 60);
  view.features.angles.angle = view.features.angles.strength = Image::Zero(40, 60);
  view.features.angles.valid = view.features.fold_mask = view.features.silhouette =
      Mask::Ones(40, 60);
  view.simulated_angles = view.features.angles;
  view.simulated_silhouette = view.features.silhouette;
  FramePicturesOptions options;
  options.crop = {10, 10, 40, 20};
  options.max_width = 20;
  const FramePictures pictures = make_frame_pictures(view, options);
  EXPECT_EQ(pictures.frame, 7);
  for (const EncodedPicture* picture :
       {&pictures.measured, &pictures.simulated, &pictures.silhouettes, &pictures.measured_angles,
        &pictures.simulated_angles, &pictures.difference}) {
    EXPECT_EQ(picture->width, 20);
    EXPECT_EQ(picture->height, 10);
  }
}

}  // namespace
}  // namespace weft::pictures_test
