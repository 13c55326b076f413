#include "weft/dynamics/loaded_clips.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/gradient_check.h"
#include "weft/base/error.h"
#include "weft/mesh/grid_lines.h"

namespace weft::loaded_clips_test {
namespace {

constexpr double kLength = 0.1, kWidth = 0.04, kDepth = 0.01;  // m
constexpr double kFree = kLength - 2 * kDepth;
constexpr double kStretch = 50;  // N/m
const Vec3 kDown(0, 0, -9.81);
using Loads = std::vector<std::optional<ClipLoad>>;

Fabric stvk(double membrane, double poisson, double shear, double bend) {
  Fabric fabric = Fabric::with_defaults("test", "stvk");
  fabric.set("membrane_uu", membrane);
  fabric.set("membrane_uv", std::max(poisson * membrane, 1e-4));
  fabric.set("membrane_vv", membrane);
  fabric.set("membrane_shear", std::max(shear * membrane, 0.01));
  fabric.set("bend_uu", bend);
  fabric.set("bend_uv", std::max(poisson * bend, 1e-12));
  fabric.set("bend_vv", bend);
  fabric.set("bend_twist", 0.5 * bend);
  return fabric;
}

/// A strip along x with clips at its ends, whose grid has the clips' borders.
TriangleMesh strip_mesh() {
  return make_swatch(grid_lines(kLength, {kDepth, kLength - kDepth}, 0.01),
                     grid_lines(kWidth, {}, 0.01));
}

std::vector<Clip> ends() {
  Clip left, right;
  left.region = {{0, 0}, {kDepth, kWidth}};
  right.region = {{kLength - kDepth, 0}, {kLength, kWidth}};
  for (Clip* clip : {&left, &right})
    clip->position << clip->region.center().x(), clip->region.center().y(), 0;
  return {left, right};
}

Clip turned(Clip clip, double angle, const Vec3& axis) {
  clip.rotation = Eigen::AngleAxisd(angle, axis.normalized()) * clip.rotation;
  return clip;
}

Cord weight(const Vec3& at, const Vec3& force) {
  Cord cord;
  cord.at = at;
  cord.force = force;
  return cord;
}

Cord to_pulley(const Vec3& at, const Vec3& pulley, double tension) {
  Cord cord;
  cord.at = at;
  cord.pulley = pulley;
  cord.tension = tension;
  return cord;
}

/// Pull of the strip at the elongation e, without Poisson effect: its width times the stretch times
/// the second Piola-Kirchhoff stress.
double pull_at(double e) { return kWidth * (1 + e) * kStretch * (e + e * e / 2); }
double elongation_at(double pull) {
  double e = pull / (kWidth * kStretch);
  for (int i = 0; i < 50; ++i)
    e -= (pull_at(e) - pull) / (kWidth * kStretch * (1 + 3 * e + 1.5 * e * e));
  return e;
}

LoadedEquilibrium solve(const HeavyCloth& cloth, const std::vector<Clip>& clips, const Loads& loads,
                        const StaticOptions& options = {}) {
  return LoadedCloth(cloth, clips, loads)
      .solve(blend_of_clips(cloth.mesh().material, clips), clips, options);
}

ClipLoad busy_load() {
  ClipLoad load;
  load.mass = 0.01;
  load.cords = {weight({0.001, 0.02, 0.003}, {0.3, -0.1, -0.2}),
                to_pulley({-0.002, -0.02, 0.001}, {0.4, 0.1, 0.05}, 0.4)};
  return load;
}

TEST(ClipPoses, AMoveIsTheDifferenceThatItMakes) {
  const Clip clip = turned(ends()[1], 2.0, {1, -2, 0.5});
  for (const double size : {1e-6, 0.1, 3.0}) {
    Vec6 move;
    move << 0.1, -0.2, 0.3, size * Vec3(2, 1, -2) / 3;
    const Vec6 found = pose_difference(moved_clip(clip, move), clip);
    EXPECT_LT((found - move).norm(), 1e-14) << size;
  }
}

TEST(ClipPoses, DerivativeOfADifference) {
  const Clip from = turned(ends()[1], 0.7, {1, -2, 0.5});
  for (const double size : {1e-5, 0.3, 2.5}) {
    Vec6 far;
    far << 0.1, -0.2, 0.3, size * Vec3(2, 1, -2) / 3;
    const Clip to = moved_clip(from, far);
    const auto difference = [&](const VecX& move) {
      return VecX(pose_difference(moved_clip(to, move), from));
    };
    EXPECT_TRUE(testing::near(pose_difference_derivative(pose_difference(to, from)),
                              testing::numeric_jacobian(difference, VecX::Zero(6), 1e-3)))
        << size;
  }
}

TEST(ClipPoses, AreFoundInAShape) {
  const TriangleMesh mesh = strip_mesh();
  std::vector<Clip> clips = ends();
  const std::vector<int> clip_of = clip_of_vertices(mesh, clips);
  clips[1] = turned(clips[1], 2.8, {1, 2, -1});
  clips[1].position = Vec3(0.3, -0.1, 0.7);
  Points x = Points::Random(3, mesh.vertex_count());
  detail::place_held(clips, clip_of, mesh, x);
  const Clip found = clip_of_shape(ends()[1], mesh, clip_of, 1, x);
  EXPECT_LT(pose_difference(found, clips[1]).norm(), 1e-13);
}

// Along exp(s turn), and a straight shift, the potential's slope is the gradient there times the
// move, and the slope of that the Hessian's form at s = 0.
TEST(PotentialOfALoad, GradientAndHessianAgreeWithDifferences) {
  const ClipLoad load = busy_load();
  const Clip clip = turned(ends()[1], 0.9, {1, -2, 0.5});
  const auto value = [&](const VecX& move) {
    return potential_of(load, moved_clip(clip, move), kDown).value;
  };
  const LoadPotential found = potential_of(load, clip, kDown);
  EXPECT_TRUE(testing::near(found.gradient, testing::numeric_gradient(value, VecX::Zero(6), 1e-3)));
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) {
      const Vec6 move = Vec6::Unit(i) + Vec6::Unit(j);
      const auto slope = [&](const VecX& s) {
        return potential_of(load, moved_clip(clip, s[0] * move), kDown).gradient.dot(move);
      };
      const double form = testing::derivative(slope, VecX::Zero(1), VecX::Ones(1), 1e-3);
      EXPECT_NEAR(move.dot(found.hessian * move), form, 1e-8) << i << ", " << j;
    }
  }
}

// A weight on a strip: the elongation of the law of stretch, with the weight of what is below.
TEST(LoadedClips, StripHungWithAWeight) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(kStretch, 1e-6, 0.4, 1e-6));
  std::vector<Clip> clips = ends();  // u points down
  for (Clip& clip : clips) {
    clip.position = Vec3(0, kWidth / 2, -clip.position.x());
    clip.rotation = Eigen::AngleAxisd(std::numbers::pi / 2, Vec3::UnitY());
  }
  ClipLoad load;
  load.mass = 0.01;
  load.cords = {weight(Vec3::Zero(), {0, 0, -0.1})};
  for (const double density : {1e-6, 0.5}) {
    const HeavyCloth cloth(*model, density, kDown);
    const LoadedEquilibrium found = solve(cloth, clips, {std::nullopt, load});
    ASSERT_TRUE(found.cloth.converged);
    // Simpson's rule over the free length; what hangs there: clip, weight, cloth below.
    const double per_length = density * kWidth * 9.81;
    const double end = 0.1 + 0.01 * 9.81 + per_length * kDepth;
    const double elongation =
        (elongation_at(end + per_length * kFree) + 4 * elongation_at(end + per_length * kFree / 2) +
         elongation_at(end)) *
        kFree / 6;
    // 1e-6 m: elongations of single cells are those at their middle.
    EXPECT_NEAR(found.clips[1].position.z(), clips[1].position.z() - elongation, 1e-6) << density;
    EXPECT_LT((pose_difference(found.clips[1], clips[1])).head<2>().norm(), 1e-7);
    EXPECT_LT((pose_difference(found.clips[1], clips[1])).tail<3>().norm(), 1e-6);
    EXPECT_NEAR(found.cloth.forces(2, 0), end + per_length * (kFree + kDepth), 1e-6);
  }
}

/// Bundle of threads along u that do not shear, of `stiffness` N/m: pulls and torques about the
/// clip's position of those between the left clip and `clip`, one a grid line.
Vec6 pull_of_threads(const TriangleMesh& mesh, const Clip& clip, double stiffness) {
  std::vector<double> lines;
  for (Eigen::Index i = 0; i < mesh.material.cols(); ++i)
    if (mesh.material(0, i) == 0) lines.push_back(mesh.material(1, i));
  Vec6 sum = Vec6::Zero();
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double below = i > 0 ? lines[i] - lines[i - 1] : 0;
    const double above = i + 1 < lines.size() ? lines[i + 1] - lines[i] : 0;
    const Vec3 end = clip.place({kLength - kDepth, lines[i]});
    const Vec3 stretch = (end - Vec3(kDepth, lines[i], 0)) / kFree;
    const double strain = 0.5 * (stretch.squaredNorm() - 1);
    const Vec3 pull = 0.5 * (below + above) * stiffness * strain * stretch;
    sum.head<3>() += pull;
    sum.tail<3>() += (end - clip.position).cross(pull);
  }
  return sum;
}

// Without shear, threads pull alone: their pulls balance cords of unequal tension, and their
// torques those of the cords, with the bar askew.
TEST(LoadedClips, UnequalCordsTurnABar) {
  const TriangleMesh mesh = strip_mesh();
  constexpr double kStiff = 5000;  // N/m
  Fabric fabric = stvk(kStiff, 1e-8, 2e-6, 1e-9);
  fabric.set("membrane_vv", 1);  // threads come closer to each other at a bar that is askew
  const auto model = make_elastic_model(mesh, fabric);
  const HeavyCloth cloth(*model, 1e-3, Vec3::Zero());
  ClipLoad load;
  load.cords = {weight({0.002, kWidth / 2, 0}, {13, 0, 0}),
                weight({0.002, -kWidth / 2, 0}, {17, 0, 0})};
  const LoadedEquilibrium found = solve(cloth, ends(), {std::nullopt, load});
  ASSERT_TRUE(found.cloth.converged);
  const Clip& bar = found.clips[1];
  const Vec3 first = bar.rotation * load.cords[0].at, second = bar.rotation * load.cords[1].at;
  Vec6 pulls;
  pulls << Vec3(30, 0, 0), first.cross(load.cords[0].force) + second.cross(load.cords[1].force);
  const Vec6 threads = pull_of_threads(mesh, bar, kStiff);
  // Shear of 2e-6 of the stretch, weft of 2e-4.
  EXPECT_LT((threads - pulls).head<3>().norm(), 30 * 1e-5);
  EXPECT_LT((threads - pulls).tail<3>().norm(), 0.08 * 1e-4);
  // The lower cord pulls more: counter-clockwise, by much more than these.
  EXPECT_GT(pose_difference(bar, ends()[1])[5], 0.05);
}

// A limp strip, the clip and a taut cord at its middle lie on one line.
TEST(LoadedClips, ACordToAPulleyStraightensTheStrip) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(kStretch, 1e-6, 0.4, 1e-9));
  const HeavyCloth cloth(*model, 1e-3, Vec3::Zero());
  const Vec3 hinge(kDepth, kWidth / 2, 0);
  const Vec3 line = Vec3(std::cos(1.0), 0, std::sin(1.0));
  ClipLoad load;
  load.cords = {to_pulley(Vec3::Zero(), hinge + 0.3 * line, 0.2)};
  const LoadedEquilibrium found = solve(cloth, ends(), {std::nullopt, load});
  ASSERT_TRUE(found.cloth.converged);
  const double way = kFree * (1 + elongation_at(0.2)) + kDepth / 2;
  // The bend at the hinge takes 1e-9 N m of 1e-3.
  EXPECT_LT((found.clips[1].position - (hinge + way * line)).norm(), 1e-5);
  EXPECT_LT((found.clips[1].rotation * Vec3::UnitX() - line).norm(), 1e-4);
}

// Tied to the inner side of where the cloth begins, a cord turns the clip over: the straight strip
// is an equilibrium, but a saddle.
TEST(LoadedClips, EndAtAStableEquilibrium) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(kStretch, 1e-6, 0.4, 1e-8));
  const HeavyCloth cloth(*model, 1e-3, Vec3::Zero());
  ClipLoad load;
  load.cords = {weight({-0.02, 0, 0}, {0.2, 0, 0})};
  const LoadedEquilibrium found = solve(cloth, ends(), {std::nullopt, load});
  ASSERT_TRUE(found.cloth.converged);
  const Clip& clip = found.clips[1];
  EXPECT_LT((clip.rotation * Vec3::UnitX() + Vec3::UnitX()).norm(), 1e-2);
  EXPECT_NEAR(clip.position.x(), kDepth + kFree * (1 + elongation_at(0.2)) - kDepth / 2, 1e-4);
}

TEST(LoadedClips, NearAnEquilibriumFewerIterationsEndAtTheSame) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(kStretch, 0.3, 0.4, 1e-5));
  const HeavyCloth cloth(*model, 0.3, kDown);
  const Loads loads{std::nullopt, busy_load()};
  const LoadedEquilibrium before = solve(cloth, ends(), loads);
  ASSERT_TRUE(before.cloth.converged);
  model->set_parameters(stvk(1.1 * kStretch, 0.3, 0.4, 1e-5).values);
  const LoadedEquilibrium far = solve(cloth, ends(), loads);
  StaticOptions options;
  options.start = StaticOptions::Start::near_equilibrium;
  LoadedCloth loaded(cloth, ends(), loads);
  const LoadedEquilibrium near =
      loaded.solve(before.cloth.x, loaded.clips_of_shape(before.cloth.x), options);
  ASSERT_TRUE(far.cloth.converged && near.cloth.converged);
  EXPECT_LT(near.cloth.iterations, far.cloth.iterations / 2);
  EXPECT_LT(near.cloth.residual, 1e-5);
  // Net forces of 1e-7 N on a clip that is held by some N/m.
  EXPECT_LT(pose_difference(near.clips[1], far.clips[1]).norm(), 1e-5);
}

/// Two loaded clips at the ends and one in the middle that is held.
struct ThreeClips {
  TriangleMesh mesh = strip_mesh();
  std::vector<Clip> clips = ends();
  Loads loads;

  ThreeClips() {
    Clip middle;
    middle.region = {{0.04, 0}, {0.06, kWidth}};
    middle.position = Vec3(0.05, kWidth / 2, 0);
    clips.push_back(turned(middle, 0.2, {1, 1, 0}));
    ClipLoad left = busy_load();
    left.cords[0].force = Vec3(-0.4, 0, 0.1);
    left.cords[1].pulley = Vec3(-0.3, 0, 0.1);
    loads = {left, busy_load(), std::nullopt};
  }
};

StaticOptions tight() {
  StaticOptions options;
  options.force_tolerance = 1e-11;
  return options;
}

TEST(LoadedSensitivities, AgreeWithDifferences) {
  const ThreeClips three;
  const Fabric fabric = stvk(kStretch, 0.3, 0.4, 1e-5);
  const auto model = make_elastic_model(three.mesh, fabric, 0.4);
  const HeavyCloth cloth(*model, 0.3, kDown);
  const LoadedEquilibrium found = solve(cloth, three.clips, three.loads, tight());
  ASSERT_TRUE(found.cloth.converged);
  const LoadedSensitivities s = LoadedCloth(cloth, three.clips, three.loads).sensitivities(found);
  EXPECT_FALSE(s.inexact);
  const auto all = [&](const VecX& relative) {
    model->set_parameters(fabric.values.cwiseProduct(relative));
    LoadedCloth loaded(cloth, three.clips, three.loads);
    const LoadedEquilibrium there = loaded.solve(found.cloth.x, found.clips, tight());
    VecX result(there.cloth.x.size() + 9 + 18);
    result << flat(there.cloth.x), flat(there.cloth.forces),
        pose_difference(there.clips[0], found.clips[0]),
        pose_difference(there.clips[1], found.clips[1]),
        pose_difference(there.clips[2], found.clips[2]);
    return result;
  };
  const VecX ones = VecX::Ones(fabric.values.size());
  for (Eigen::Index p = 0; p < ones.size(); ++p) {
    const VecX numeric = testing::derivative(all, ones, VecX::Unit(ones.size(), p), 1e-2);
    const double value = fabric.values[p];
    const Eigen::Index n = s.x.rows();
    // Equilibria are at rest to some 1e-10 N. Bends move vertices by 1e-5 m and clips by 1e-4 m per
    // unit, on stiffnesses of some N/m.
    EXPECT_TRUE(testing::near(value * s.x.col(p), numeric.head(n), 1e-5)) << "x, " << p;
    EXPECT_TRUE(testing::near(value * s.forces.col(p), numeric.segment(n, 9), 1e-5, 1e-3))
        << "forces, " << p;
    EXPECT_TRUE(testing::near(value * s.poses.col(p), numeric.tail(18), 1e-5)) << "poses, " << p;
  }
}

TEST(LoadedPoseSensitivities, AgreeWithDifferences) {
  const ThreeClips three;
  const auto model = make_elastic_model(three.mesh, stvk(kStretch, 0.3, 0.4, 1e-5), 0.4);
  const HeavyCloth cloth(*model, 0.3, kDown);
  const LoadedEquilibrium found = solve(cloth, three.clips, three.loads, tight());
  ASSERT_TRUE(found.cloth.converged);
  const LoadedPoseSensitivities s =
      LoadedCloth(cloth, three.clips, three.loads).pose_sensitivities(found);
  const auto all = [&](const VecX& move) {
    std::vector<Clip> clips = three.clips;
    clips[2] = moved_clip(clips[2], move);
    LoadedCloth loaded(cloth, clips, three.loads);
    const LoadedEquilibrium there = loaded.solve(found.cloth.x, found.clips, tight());
    VecX result(9 + 12);
    result << flat(there.cloth.forces), pose_difference(there.clips[0], found.clips[0]),
        pose_difference(there.clips[1], found.clips[1]);
    return result;
  };
  const MatX numeric = testing::numeric_jacobian(all, VecX::Zero(6), 1e-3);
  EXPECT_TRUE(testing::near(s.forces.rightCols(6), numeric.topRows(9), 1e-6));
  EXPECT_TRUE(testing::near(MatX(s.poses.topRows(12).rightCols(6)), numeric.bottomRows(12), 1e-6));
  EXPECT_EQ(s.forces.leftCols(12).cwiseAbs().maxCoeff(), 0);
  EXPECT_EQ(s.poses.bottomRows(6).cwiseAbs().maxCoeff(), 0);
}

TEST(LoadedClips, OneMustBeHeldAndOneLoaded) {
  const TriangleMesh mesh = strip_mesh();
  const auto model = make_elastic_model(mesh, stvk(kStretch, 0.3, 0.4, 1e-5));
  const HeavyCloth cloth(*model, 0.3, kDown);
  EXPECT_THROW(LoadedCloth(cloth, ends(), {busy_load(), busy_load()}), Error);
  EXPECT_THROW(LoadedCloth(cloth, ends(), {std::nullopt, std::nullopt}), Error);
}

}  // namespace
}  // namespace weft::loaded_clips_test
