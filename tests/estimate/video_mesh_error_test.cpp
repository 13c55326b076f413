#include "weft/estimate/video_mesh_error.h"

#include <gtest/gtest.h>

#include "weft/base/error.h"
#include "weft/estimate/least_squares.h"
#include "weft/estimate/synthetic.h"

namespace weft::video_mesh_error_test {
namespace {

Fabric true_fabric() {
  Fabric fabric = Fabric::with_defaults("truth");
  fabric.set("bend_stiffness", 2e-4);
  fabric.set("stretch_stiffness", 100);
  return fabric;
}

/// A small swatch in a small image, filmed on a finer mesh than the fit's 9 x 9 vertices.
std::shared_ptr<const Trial> small_trial() {
  LayoutOptions layout;
  layout.width = layout.height = 0.3;
  layout.image_width = 160;
  layout.image_height = 120;
  layout.stripe_period = 0.022;
  layout.frame_count = layout.fit_frames = 4;
  TrialOptions options;
  options.columns = options.rows = 9;
  options.angle_map.kernel_radius = 4;
  options.angle_map.blur_sigma = 2;
  options.simulation.steps_per_frame = 2;
  SyntheticOptions synthetic;
  synthetic.columns = synthetic.rows = 25;
  synthetic.simulation.steps_per_frame = 8;
  return simulate_trial(make_layout(layout), true_fabric(), options, synthetic);
}

Problem problem_of(std::shared_ptr<const Trial> trial) {
  return {{std::move(trial)}, true_fabric(), {"stretch_stiffness", "bend_stiffness"}};
}

VecX minimum(const Problem& problem) {
  return minimize_least_squares([&](const VecX& x) { return linearize(problem, x).model; },
                                [&](const VecX& x) { return evaluate_cost(problem, x).cost; },
                                problem.scaled(true_fabric()), VecX::Zero(2), VecX::Ones(2))
      .x;
}

TEST(VideoMeshError, RefinesCellsAndSteps) {
  const auto trial = small_trial();
  const auto finer = refined(*trial);
  EXPECT_EQ(finer->scene.mesh.vertex_count(), 17 * 17);
  EXPECT_EQ(finer->options.simulation.steps_per_frame, 4);
  EXPECT_EQ(finer->frame_count(), trial->frame_count());
  EXPECT_EQ(finer->scene.fixtures.size(), trial->scene.fixtures.size());
  // Each second vertex of each second row is one of the coarse mesh.
  for (int row = 0; row < 9; ++row)
    for (int column = 0; column < 9; ++column)
      EXPECT_LT((finer->scene.start.col(2 * row * 17 + 2 * column) -
                 trial->scene.start.col(row * 9 + column))
                    .norm(),
                1e-12);
  Trial large = *trial;
  large.options.columns = 501;
  EXPECT_THROW(refined(large), Error);
}

// One step of Gauss-Newton on halved cells goes about as far as a fit there, of a motion that bends
// a stiff cloth by some widths of its cells.
TEST(VideoMeshError, TellsWhereAFitOnHalvedCellsEnds) {
  const auto trial = small_trial();
  const Problem problem = problem_of(trial);
  const VecX here = minimum(problem), there = minimum(problem_of(refined(*trial)));
  const ProblemLinearization found = linearize(problem, here);
  const MeshShift mesh = find_mesh_shift(problem, here, found.parts, 1e-6);
  ASSERT_TRUE(mesh.unknown.empty()) << mesh.unknown;
  ASSERT_EQ(mesh.shift.size(), 2);
  for (int i = 0; i < 2; ++i)
    EXPECT_NEAR(mesh.shift[i], there[i] - here[i], 0.5 * std::abs(there[i] - here[i])) << i;
}

TEST(VideoMeshError, IsUnknownWithoutAMotion) {
  const Problem plain = problem_of(small_trial());
  const Problem other(plain.trials(), true_fabric(), plain.free(),
                      [](const Fabric&, int) { return ProblemEvaluation{}; });
  const MeshShift mesh = find_mesh_shift(other, Vec2(0.5, 0.5), {}, 1);
  EXPECT_EQ(mesh.shift.size(), 0);
  EXPECT_FALSE(mesh.unknown.empty());
}

}  // namespace
}  // namespace weft::video_mesh_error_test
