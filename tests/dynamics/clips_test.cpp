#include "weft/dynamics/clips.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/gradient_check.h"
#include "weft/base/error.h"
#include "weft/mesh/grid_lines.h"

namespace weft::clips_test {
namespace {

constexpr double kLength = 0.1, kWidth = 0.04, kDepth = 0.01;  // m
const Vec3 kDown(0, 0, -9.81);

Fabric stvk(double membrane, double poisson, double bend) {
  Fabric fabric = Fabric::with_defaults("test", "stvk");
  fabric.set("membrane_uu", membrane);
  fabric.set("membrane_uv", poisson * membrane);
  fabric.set("membrane_vv", membrane);
  fabric.set("membrane_shear", 0.4 * membrane);
  fabric.set("bend_uu", bend);
  fabric.set("bend_uv", std::max(poisson * bend, 1e-12));
  fabric.set("bend_vv", bend);
  fabric.set("bend_twist", 0.5 * bend);
  return fabric;
}

/// A strip along x, held by its two ends, whose grid has the clips' borders.
TriangleMesh strip_mesh() {
  return make_swatch(grid_lines(kLength, {kDepth, kLength - kDepth}, 0.01),
                     grid_lines(kWidth, {}, 0.01));
}

std::vector<Clip> ends(double pull) {
  Clip left, right;
  left.region = {{0, 0}, {kDepth, kWidth}};
  right.region = {{kLength - kDepth, 0}, {kLength, kWidth}};
  left.position = Vec3(kDepth / 2, kWidth / 2, 0);
  right.position = Vec3(kLength - kDepth / 2 + pull, kWidth / 2, 0);
  return {left, right};
}

/// Pulled by 4 mm, one of them turned.
std::vector<Clip> turned_ends() {
  std::vector<Clip> clips = ends(0.004);
  clips[1].rotation = Eigen::AngleAxisd(0.3, Vec3(1, 1, 0).normalized());
  return clips;
}

/// The same clips, carried along by a rigid motion.
std::vector<Clip> moved(std::vector<Clip> clips, const Eigen::Quaterniond& turn, const Vec3& by) {
  for (Clip& clip : clips) {
    clip.position = turn * clip.position + by;
    clip.rotation = turn * clip.rotation;
  }
  return clips;
}

TEST(Clip, PlacesWhatItHolds) {
  Clip clip;
  clip.region = {{0.01, 0.02}, {0.03, 0.06}};
  clip.position = Vec3(1, 2, 3);
  clip.rotation = Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitZ());
  EXPECT_NEAR((clip.place({0.02, 0.04}) - Vec3(1, 2, 3)).norm(), 0, 1e-15);
  // 1 cm along u from the centre; u points along y now.
  EXPECT_NEAR((clip.place({0.03, 0.04}) - Vec3(1, 2.01, 3)).norm(), 0, 1e-15);
}

TEST(ClipOfVertices, RefusesOverlapAndClipsThatHoldNothing) {
  const TriangleMesh mesh = strip_mesh();
  std::vector<Clip> clips = ends(0);
  const std::vector<int> clip_of = clip_of_vertices(mesh, clips);
  EXPECT_EQ(std::count(clip_of.begin(), clip_of.end(), 0), 10);
  EXPECT_EQ(std::count(clip_of.begin(), clip_of.end(), 1), 10);
  clips[1].region = clips[0].region;
  EXPECT_THROW(clip_of_vertices(mesh, clips), Error);
  clips[1].region = {{0.0501, 0.0101}, {0.0599, 0.0199}};
  EXPECT_THROW(clip_of_vertices(mesh, clips), Error);
}

// Without Poisson effect a strip between clips is under uniform tension: the force is the stretch
// times the second Piola-Kirchhoff stress, width (1 + e) A11 (e + e^2 / 2).
TEST(SolveClips, UniformTensionOfAStrip) {
  const TriangleMesh mesh = strip_mesh();
  const Fabric fabric = stvk(50, 1e-5, 1e-6);
  const auto model = make_elastic_model(mesh, fabric);
  const HeavyCloth cloth(*model, 0.1, Vec3::Zero());
  const double free_length = kLength - 2 * kDepth;
  for (const double e : {0.01, 0.1}) {
    const std::vector<Clip> clips = ends(e * free_length);
    const ClipEquilibrium found = solve_clips(cloth, clips, blend_of_clips(mesh.material, clips));
    ASSERT_TRUE(found.converged);
    const double expected = kWidth * (1 + e) * 50 * (e + e * e / 2);
    // What the Poisson effect of 1e-5 leaves, and net forces of 1e-7 N.
    EXPECT_NEAR(found.forces(0, 1), expected, 1e-6);
    EXPECT_NEAR(found.forces(0, 0), -expected, 1e-6);
    EXPECT_LT(found.forces.bottomRows<2>().cwiseAbs().maxCoeff(), 1e-6);
  }
}

TEST(SolveClips, ForcesAndTorquesBalanceTheWeight) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(50, 0.3, 1e-5), 0.5);
  const HeavyCloth cloth(*model, 0.3, kDown);
  std::vector<Clip> clips = ends(0.002);
  clips[1].rotation = Eigen::AngleAxisd(0.2, Vec3(1, 2, 3).normalized());
  const ClipEquilibrium found = solve_clips(cloth, clips, blend_of_clips(mesh.material, clips));
  ASSERT_TRUE(found.converged);
  const Vec3 weight = 0.3 * kLength * kWidth * kDown;
  // Net forces below the tolerance of 1e-7 N are left on some 30 free vertices.
  EXPECT_LT((found.forces.rowwise().sum() + weight).norm(), 3e-6);
  Vec3 torque = Vec3::Zero();
  for (Eigen::Index c = 0; c < 2; ++c) {
    const Vec3 arm = clips[static_cast<std::size_t>(c)].position, force = found.forces.col(c);
    torque += found.torques.col(c) + arm.cross(force);
  }
  for (Eigen::Index i = 0; i < found.x.cols(); ++i) {
    const Vec3 arm = found.x.col(i);
    torque += arm.cross(cloth.masses()[i] * kDown);
  }
  EXPECT_LT(torque.norm(), 3e-7);
}

TEST(SolveClips, RigidMotionOfAllClipsChangesNothing) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(50, 0.3, 1e-5), 0.3);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(1.3, Vec3(2, -1, 0.5).normalized()));
  const HeavyCloth cloth(*model, 0.3, kDown), turned(*model, 0.3, turn * kDown);
  std::vector<Clip> clips = ends(0.003);
  clips[1].rotation = Eigen::AngleAxisd(0.3, Vec3::UnitX());
  const std::vector<Clip> there = moved(clips, turn, Vec3(0.3, -0.2, 1));
  const ClipEquilibrium a = solve_clips(cloth, clips, blend_of_clips(mesh.material, clips));
  const ClipEquilibrium b = solve_clips(turned, there, blend_of_clips(mesh.material, there));
  ASSERT_TRUE(a.converged && b.converged);
  const Points expected = turn.toRotationMatrix() * a.forces;
  // Forces of some 0.1 N from net forces below 1e-7 N.
  EXPECT_LT((b.forces - expected).cwiseAbs().maxCoeff(), 1e-5);
  const Points shape = (turn.toRotationMatrix() * a.x).colwise() + Vec3(0.3, -0.2, 1);
  EXPECT_LT((b.x - shape).cwiseAbs().maxCoeff(), 1e-6);
}

// The only clip of a hanging cloth carries all of it, what it holds included.
TEST(SolveClips, OneClipCarriesTheWholeWeight) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(50, 0.3, 1e-6));
  const HeavyCloth cloth(*model, 0.2, kDown);
  Clip clip = ends(0)[0];
  clip.rotation = Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitY());  // u points down
  const ClipEquilibrium found = solve_clips(cloth, {clip}, blend_of_clips(mesh.material, {clip}));
  ASSERT_TRUE(found.converged);
  EXPECT_LT((found.forces.col(0) - Vec3(0, 0, 9.81 * 0.2 * kLength * kWidth)).norm(), 1e-6);
}

/// Where a strip of `fabric` comes to rest between turned clips.
ClipEquilibrium twisted_strip(const Fabric& fabric, const Points& start,
                              StaticOptions::Start kind) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, fabric, 0.4);
  const std::vector<Clip> clips = turned_ends();
  StaticOptions options;
  options.start = kind;
  return solve_clips(HeavyCloth(*model, 0.3, kDown), clips, start, options);
}

TEST(SolveClips, NearAnEquilibriumFewerIterationsEndAtTheSame) {
  using enum StaticOptions::Start;
  std::vector<Clip> clips = ends(0.004);
  const Points between = blend_of_clips(strip_mesh().material, clips);
  const ClipEquilibrium before = twisted_strip(stvk(50, 0.3, 1e-5), between, any);
  ASSERT_TRUE(before.converged);
  for (const double factor : {1.001, 1.1, 2.0}) {
    const Fabric changed = stvk(50 * factor, 0.3, 1e-5 / factor);
    const ClipEquilibrium far = twisted_strip(changed, between, any),
                          near = twisted_strip(changed, before.x, near_equilibrium);
    EXPECT_TRUE(near.converged);
    EXPECT_LT(near.residual, StaticOptions().force_tolerance);
    EXPECT_LT(near.iterations, far.iterations);
    // Both are as near to it as the tolerance of 1e-7 N on the softest motion of the strip allows.
    EXPECT_LT((near.x - far.x).cwiseAbs().maxCoeff(), 1e-6) << factor;
  }
}

TEST(SolveClips, AStartThatIsSaidToBeNearMayBeASaddle) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(50, 0.3, 1e-6));
  const HeavyCloth cloth(*model, 0.2, Vec3::Zero());
  const std::vector<Clip> clips = ends(-0.004);  // nearer to each other: the strip buckles
  StaticOptions options;
  options.start = StaticOptions::Start::near_equilibrium;
  const Points flat_start = blend_of_clips(mesh.material, clips);
  ASSERT_EQ(flat_start.row(2).cwiseAbs().maxCoeff(), 0);
  const ClipEquilibrium found = solve_clips(cloth, clips, flat_start, options);
  EXPECT_TRUE(found.converged);
  EXPECT_GT(found.x.row(2).cwiseAbs().maxCoeff(), 2e-3);
  EXPECT_FALSE(clip_sensitivities(cloth, clips, found.x).inexact) << "the Hessian is not definite";
}

TEST(ClipSensitivities, AgreeWithDifferences) {
  const TriangleMesh mesh = strip_mesh();
  const Fabric fabric = stvk(50, 0.3, 1e-5);
  const auto model = make_elastic_model(mesh, fabric, 0.4);
  const std::vector<Clip> clips = turned_ends();
  StaticOptions tight;
  tight.force_tolerance = 1e-11;
  const Points start = blend_of_clips(mesh.material, clips);
  const auto equilibrium = [&] {
    return solve_clips(HeavyCloth(*model, 0.3, kDown), clips, start, tight);
  };
  const ClipEquilibrium found = equilibrium();
  ASSERT_TRUE(found.converged);
  const ClipSensitivities s = clip_sensitivities(HeavyCloth(*model, 0.3, kDown), clips, found.x);
  EXPECT_FALSE(s.inexact);
  for (Eigen::Index p = 0; p < fabric.values.size(); ++p) {
    const auto at = [&](double relative) {
      VecX values = fabric.values;
      values[p] *= 1 + relative;
      model->set_parameters(values);
      return equilibrium();
    };
    const double h = 1e-4;
    const ClipEquilibrium above = at(h), below = at(-h);
    const double width = 2 * h * fabric.values[p];
    const VecX x = flat(Points(above.x - below.x)) / width;
    const VecX forces = flat(Points(above.forces - below.forces)) / width;
    // Differences over 2e-4 err by some 1e-8 and by the tolerance of the equilibria.
    EXPECT_TRUE(testing::near(s.x.col(p), x, 1e-5)) << "parameter " << p;
    EXPECT_TRUE(testing::near(s.forces.col(p), forces, 1e-5)) << "parameter " << p;
  }
}

TEST(ClipPoseSensitivities, AgreeWithDifferences) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(50, 0.3, 1e-5), 0.4);
  const HeavyCloth cloth(*model, 0.3, kDown);
  const std::vector<Clip> clips = turned_ends();
  StaticOptions tight;
  tight.force_tolerance = 1e-11;
  const Points start = solve_clips(cloth, clips, blend_of_clips(mesh.material, clips), tight).x;
  // Displacements of both clips, then of each a turn about its position.
  const auto solved = [&](const VecX& poses) {
    std::vector<Clip> there = clips;
    for (std::size_t c = 0; c < 2; ++c) {
      const auto first = 6 * static_cast<Eigen::Index>(c);
      const Vec3 turn = poses.segment<3>(first + 3);
      there[c].position += poses.segment<3>(first);
      if (turn.norm() > 0)
        there[c].rotation = Eigen::AngleAxisd(turn.norm(), turn.normalized()) * there[c].rotation;
    }
    return solve_clips(cloth, there, start, tight);
  };
  const ClipPoseSensitivities sensitivities = clip_pose_sensitivities(cloth, clips, start);
  const MatX& found = sensitivities.forces;
  const MatX numeric = testing::numeric_jacobian(
      [&](const VecX& poses) { return VecX(flat(solved(poses).forces)); }, VecX::Zero(12), 1e-4);
  const MatX shapes = testing::numeric_jacobian(
      [&](const VecX& poses) { return VecX(flat(solved(poses).x)); }, VecX::Zero(12), 1e-4);
  ASSERT_EQ(found.rows(), 6);
  ASSERT_EQ(found.cols(), 12);
  for (const int first : {0, 3, 6, 9})
    EXPECT_TRUE(
        testing::near(MatX(found.middleCols(first, 3)), MatX(numeric.middleCols(first, 3)), 1e-5))
        << "columns from " << first;
  for (const int first : {0, 3, 6, 9})
    EXPECT_TRUE(testing::near(MatX(sensitivities.x.middleCols(first, 3)),
                              MatX(shapes.middleCols(first, 3)), 1e-5))
        << "shapes, columns from " << first;
  // What pulls at one end pulls at the other: no pose changes the sum, and no common one anything.
  EXPECT_LT((found.topRows(3) + found.bottomRows(3)).norm(), 1e-9 * found.norm());
  EXPECT_LT((found.leftCols(3) + found.middleCols(6, 3)).norm(), 1e-9 * found.norm());
}

}  // namespace
}  // namespace weft::clips_test
