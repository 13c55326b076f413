#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "weft/base/error.h"
#include "weft/capture/capture.h"

namespace weft::sensor_noise_test {
namespace {

TEST(SensorNoise, HasTheVarianceOfShotReadAndRounding) {
  const SensorNoise noise{.full_well = 900, .read_noise = 10};
  for (const double level : {0.2, 0.5}) {
    Image image = Image::Constant(300, 400, static_cast<float>(level));
    add_sensor_noise(image, noise, 1, 0);
    const Eigen::ArrayXXd values = image.cast<double>();
    const double n = static_cast<double>(values.size());
    const double mean = values.mean();
    const double variance = (values - mean).square().mean();
    const double photons = level / noise.full_well;
    const double read = std::pow(noise.read_noise / noise.full_well, 2);
    // Steps of the sRGB curve are at most 2.4 / 1.055 / 255 wide: 6.6e-6 of variance, 3 % here.
    EXPECT_NEAR(mean, level, 5 * std::sqrt(variance / n) + 1e-4);
    EXPECT_NEAR(variance, photons + read, 5 * variance * std::sqrt(2 / n) + 6.6e-6);
  }
}

TEST(SensorNoise, LeavesTheLevelsOfEightBits) {
  Image image(1, 4096);
  for (int i = 0; i < 4096; ++i) image(0, i) = static_cast<float>(i) / 4095;
  add_sensor_noise(image, {}, 1, 0);
  std::set<float> levels(image.data(), image.data() + image.size());
  EXPECT_LE(levels.size(), 256u);
  EXPECT_GT(levels.size(), 200u);
  EXPECT_EQ(*levels.begin(), 0.f);
  EXPECT_EQ(*levels.rbegin(), 1.f);
}

// IEC 61966-2-1: code 188 of 255 is 0.5029 of linear light.
TEST(SensorNoise, RoundsOnTheSrgbCurve) {
  Image image = Image::Constant(1, 1, 0.503f);
  add_sensor_noise(image, {.full_well = 1e12, .read_noise = 0}, 1, 0);
  EXPECT_NEAR(image(0, 0), std::pow((188 / 255.0 + 0.055) / 1.055, 2.4), 1e-6);
}

TEST(SensorNoise, DependsOnSeedAndFrameAlone) {
  const Image flat = Image::Constant(50, 50, 0.4f);
  const auto noisy = [&](std::uint64_t seed, int frame) {
    Image image = flat;
    add_sensor_noise(image, {}, seed, frame);
    return image;
  };
  EXPECT_TRUE((noisy(3, 7) == noisy(3, 7)).all());
  EXPECT_FALSE((noisy(3, 7) == noisy(3, 8)).all());
  EXPECT_FALSE((noisy(3, 7) == noisy(4, 7)).all());
}

TEST(SensorNoise, RejectsASensorThatIsNone) {
  Image image = Image::Constant(2, 2, 0.4f);
  EXPECT_THROW(add_sensor_noise(image, {.full_well = 0}, 1, 0), Error);
  EXPECT_THROW(add_sensor_noise(image, {.read_noise = -1}, 1, 0), Error);
}

}  // namespace
}  // namespace weft::sensor_noise_test
