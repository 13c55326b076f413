#include <gmock/gmock.h>

#include <cmath>

#include "capture/temporary_capture.h"
#include "weft/mesh/mesh_io.h"

namespace weft::truth_test {
namespace {

using ::testing::HasSubstr;

class Truth : public TemporaryCapture {};

TruthSurface flat_truth(int columns, int rows) {
  TruthSurface truth;
  truth.mesh = make_swatch(0.5, 0.5, columns, rows);
  Points x = Points::Zero(3, truth.mesh.vertex_count());
  x.row(0) = truth.mesh.material.row(0);
  x.row(2) = -truth.mesh.material.row(1);
  truth.frames = {x};
  return truth;
}

TEST_F(Truth, DistanceOfAShiftedSurfaceIsTheShiftOnAnyMesh) {
  const TruthSurface truth = flat_truth(9, 9);
  const TruthSurface ours = flat_truth(6, 11);
  const Points shifted = ours.frames[0].colwise() + Vec3(0.003, -0.004, 0.012);
  const SurfaceDistance distance = distance_to_truth(ours.mesh, shifted, truth, 0);
  EXPECT_NEAR(distance.mean, 0.013, 1e-12);
  EXPECT_NEAR(distance.rms, 0.013, 1e-12);
  EXPECT_NEAR(distance.max, 0.013, 1e-12);
}

TEST_F(Truth, DistanceAveragesOverTheVerticesOfTheTruth) {
  const TruthSurface truth = flat_truth(5, 5);
  Points moved = truth.frames[0];
  moved(1, 12) += 0.05;
  const SurfaceDistance distance = distance_to_truth(truth.mesh, moved, truth, 0);
  EXPECT_NEAR(distance.mean, 0.05 / 25, 1e-12);
  EXPECT_NEAR(distance.rms, 0.05 / 5, 1e-12);
  EXPECT_NEAR(distance.max, 0.05, 1e-12);
}

// The bundled truth (41 x 41) seen through coarser grids: the distance that remains is what the
// grid cannot represent. It falls with the square of the spacing where folds are resolved.
TEST_F(Truth, CoarserGridsThroughTheTruthStayNearIt) {
  const TruthSurface truth = read_truth(read_capture(bundled_capture()));
  const auto mean_on = [&](int n, int frame) {
    const TriangleMesh mesh = make_swatch(0.5, 0.5, n, n);
    const Points x = interpolate(truth.mesh, MaterialLocator(truth.mesh),
                                 truth.frames[static_cast<std::size_t>(frame)], mesh.material);
    return distance_to_truth(mesh, x, truth, frame).mean;
  };
  for (const int frame : {0, 49, 99}) {
    EXPECT_LT(mean_on(21, frame), 1e-3);
    EXPECT_LT(mean_on(41, frame), 1e-9);
    EXPECT_LT(mean_on(21, frame), mean_on(11, frame));
  }
}

TEST_F(Truth, RejectsAFrameThatItLacks) {
  const TruthSurface truth = flat_truth(5, 5);
  EXPECT_THROW(distance_to_truth(truth.mesh, truth.frames[0], truth, 1), Error);
  EXPECT_THROW(distance_to_truth(truth.mesh, truth.frames[0], truth, -1), Error);
}

TEST_F(Truth, RejectsFilesThatDoNotMatch) {
  const Capture capture = read_capture(folder_);
  const auto says = [&] { return message_of([&] { read_truth(capture); }); };
  EXPECT_THAT(says(), HasSubstr("truth/rest.obj: no such file"));
  const TruthSurface good = flat_truth(3, 3);
  std::filesystem::create_directories(folder_ / "truth");
  write("truth/rest.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_THAT(says(), HasSubstr("truth/rest.obj: vt: each vertex needs one vt"));
  write_obj(folder_ / "truth/rest.obj", good.mesh, good.frames[0]);
  EXPECT_THAT(says(), HasSubstr("truth/points.pc2: no such file"));
  write_pc2(folder_ / "truth/points.pc2", {.frames = {Points::Zero(3, 4)}});
  EXPECT_THAT(says(), HasSubstr("truth/points.pc2: 4 points; rest.obj has 9 vertices"));
  write_pc2(folder_ / "truth/points.pc2", {.frames = {good.frames[0]}});
  EXPECT_THAT(says(), HasSubstr("truth/points.pc2: 1 samples; the video has 100 frames"));
  Capture without = capture;
  without.truth.reset();
  EXPECT_THAT(message_of([&] { read_truth(without); }), HasSubstr("has no [truth]"));
}

}  // namespace
}  // namespace weft::truth_test
