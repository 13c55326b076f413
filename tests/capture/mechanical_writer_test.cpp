/// What is written is what is read back.
#include "weft/capture/mechanical_writer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/temporary_folder.h"
#include "weft/base/error.h"

namespace weft::mechanical_writer_test {
namespace {

Clip clip_at(const MaterialRectangle& region, double shift, double angle) {
  Clip clip;
  clip.region = region;
  clip.position = Vec3(region.center().x() + shift, region.center().y(), 0.1 / 3);
  clip.rotation = Eigen::AngleAxisd(angle, Vec3(1, 2, 2).normalized());
  return clip;
}

/// Two clips, of which the first holds less from frame to frame and the second has forces.
MechanicalCapture example() {
  MechanicalCapture capture;
  capture.name = "a \"test\"";
  capture.description = "of\nthe writer";
  capture.width = 0.1;
  capture.height = 0.05;
  capture.areal_density = 0.15;
  capture.grain_angle = 0.3;
  capture.gravity = Vec3(0, -9.8, 0.1);
  capture.clip_noise = 1e-5 / 3;
  capture.frame_count = 3;
  capture.fixtures.resize(2);
  capture.fixtures[0].name = "table, left";
  capture.fixtures[1].name = "bar";
  capture.fixtures[0].forces.resize(3, 0);
  capture.fixtures[1].forces = Points::Random(3, 3);
  for (int frame = 0; frame < 3; ++frame) {
    capture.fixtures[0].frames.push_back(clip_at({{0, 0}, {0.03 - 0.01 * frame / 3, 0.05}}, 0, 0));
    capture.fixtures[1].frames.push_back(
        clip_at({{0.09, 0}, {0.1, 0.05}}, 0.01 * frame / 3, 0.1 * frame));
  }
  return capture;
}

TEST(WriteMechanicalCapture, IsReadBackAsItWas) {
  const test::TemporaryFolder folder;
  const MechanicalCapture capture = example();
  MechanicalFiles files;
  files.geometry.emplace();
  files.geometry->mesh = make_swatch(0.1, 0.05, 4, 3);
  for (int frame = 0; frame < 3; ++frame) files.geometry->frames.push_back(Points::Random(3, 12));
  files.truth = "a = 1\n";
  write_mechanical_capture(folder.path() / "made", capture, files);

  const MechanicalCapture read = read_mechanical_capture(folder.path() / "made");
  EXPECT_EQ(capture_kind(folder.path() / "made"), CaptureKind::mechanical);
  EXPECT_EQ(read.name, capture.name);
  EXPECT_EQ(read.description, capture.description);
  EXPECT_EQ(read.width, capture.width);
  EXPECT_EQ(read.height, capture.height);
  EXPECT_EQ(read.areal_density, capture.areal_density);
  EXPECT_NEAR(read.grain_angle, capture.grain_angle, 1e-15);
  EXPECT_EQ(read.gravity, capture.gravity);
  EXPECT_EQ(read.clip_noise, capture.clip_noise);
  ASSERT_EQ(read.frame_count, 3);
  ASSERT_EQ(read.fixtures.size(), 2u);
  EXPECT_EQ(read.fixtures[0].forces.cols(), 0);
  EXPECT_EQ(read.fixtures[1].forces, capture.fixtures[1].forces);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(read.fixtures[i].name, capture.fixtures[i].name);
    for (std::size_t frame = 0; frame < 3; ++frame) {
      const Clip &a = read.fixtures[i].frames[frame], &b = capture.fixtures[i].frames[frame];
      EXPECT_EQ(a.region, b.region);
      EXPECT_EQ(a.position, b.position);
      EXPECT_TRUE(a.rotation.isApprox(b.rotation, 1e-15));
    }
  }
  const MeasuredGeometry geometry = read_geometry(read);
  EXPECT_TRUE(geometry.mesh.material.isApprox(files.geometry->mesh.material, 1e-6));
  for (std::size_t frame = 0; frame < 3; ++frame)  // 32-bit floats
    EXPECT_LT((geometry.frames[frame] - files.geometry->frames[frame]).cwiseAbs().maxCoeff(), 6e-8);
  ASSERT_TRUE(read.truth);
  EXPECT_TRUE(std::filesystem::exists(*read.truth));
}

TEST(WriteMechanicalCapture, CordsAreReadBackAsTheyWere) {
  const test::TemporaryFolder folder;
  MechanicalCapture capture = example();
  MechanicalFixture& bar = capture.fixtures[1];
  bar.forces.resize(3, 0);
  bar.mass = 0.01 / 3;
  bar.cords.resize(2);
  bar.cords[0].at = Vec3(0.001, 0.02, -0.003) / 3;
  bar.cords[0].forces = Points::Random(3, 3);
  bar.cords[1].pulley = Vec3(0.5, 0.1, 1.0 / 3);
  bar.cords[1].tensions = VecX::Random(3).cwiseAbs();
  write_mechanical_capture(folder.path() / "made", capture);
  const MechanicalCapture read = read_mechanical_capture(folder.path() / "made");
  const MechanicalFixture& again = read.fixtures[1];
  EXPECT_FALSE(read.fixtures[0].loaded());
  EXPECT_EQ(again.mass, bar.mass);
  ASSERT_EQ(again.cords.size(), 2u);
  EXPECT_EQ(again.cords[0].at, bar.cords[0].at);
  EXPECT_EQ(again.cords[0].forces, bar.cords[0].forces);
  EXPECT_FALSE(again.cords[0].pulley);
  EXPECT_EQ(again.cords[1].pulley, bar.cords[1].pulley);
  EXPECT_EQ(again.cords[1].tensions, bar.cords[1].tensions);
}

TEST(WriteMechanicalCapture, RefusesWhatCannotBeReadBack) {
  const test::TemporaryFolder folder;
  MechanicalCapture capture = example();
  capture.fixtures[1].forces(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(write_mechanical_capture(folder.path(), capture), Error);
  capture = example();
  capture.fixtures[0].frames.pop_back();
  EXPECT_THROW(write_mechanical_capture(folder.path(), capture), Error);
  capture = example();
  MechanicalFiles files;
  files.geometry.emplace();
  EXPECT_THROW(write_mechanical_capture(folder.path(), capture, files), Error);
  capture = example();
  capture.fixtures[1].mass = 1;  // and measured forces
  EXPECT_THROW(write_mechanical_capture(folder.path(), capture), Error);
  capture.fixtures[1].forces.resize(3, 0);
  capture.fixtures[1].cords.resize(1);  // without a force at any frame
  EXPECT_THROW(write_mechanical_capture(folder.path(), capture), Error);
  capture = example();
  capture.picture_frame = PictureFrame{0.1, VecX::Zero(capture.frame_count)};
  EXPECT_THROW(write_mechanical_capture(folder.path(), capture), Error);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "capture.toml"));
}

}  // namespace
}  // namespace weft::mechanical_writer_test
