/// Fits to mechanical captures that are killed and started again.
#include "weft/estimate/mechanical_store.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/estimate/curve_fit.h"
#include "weft/estimate/mechanical_rig.h"

namespace weft::mechanical_store_test {
namespace {

using ::testing::HasSubstr;
using Trials = std::vector<std::shared_ptr<const MechanicalTrial>>;

struct Killed {};

RigOptions small_rig() {
  RigOptions options;
  options.steps = 2;
  options.point_lines = 4;
  options.mesh.cells = 2;
  options.noise = {0, 0, 0, 0};
  return options;
}

Fabric true_fabric() {
  Fabric fabric = Fabric::with_defaults("test", "stvk-diagonal");
  fabric.areal_density = 0.2;
  fabric.set_curve("weft_stretch", {VecX::LinSpaced(2, 0, 0.2), Vec2(300, 900)});
  fabric.set("warp_stretch", 150);
  fabric.set("shear", 30);
  fabric.set("weft_bend", 8e-5);
  return fabric;
}

class MechanicalStoreTest : public ::testing::Test {
 protected:
  std::shared_ptr<const MechanicalTrial> trial(RigTest test, const Fabric& fabric, int cells = 2) {
    MechanicalOptions options;
    options.cells = cells;
    const auto folder = folder_.path() / fabric.name / std::string(name_of(test));
    if (!std::filesystem::exists(folder))
      return prepare_mechanical(make_rig_capture(folder, test, fabric, small_rig()), options);
    return prepare_mechanical(read_mechanical_capture(folder), options);
  }
  /// Another one at each call.
  std::filesystem::path path() { return folder_.path() / (std::to_string(++files_) + ".sqlite"); }

  test::TemporaryFolder folder_;
  int files_ = 0;
};

void expect_same(const MechanicalFitResult& a, const MechanicalFitResult& b) {
  EXPECT_EQ(a.fabric.values, b.fabric.values);
  EXPECT_EQ(a.cost_start, b.cost_start);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.end, b.end);
  EXPECT_EQ(a.evaluations, b.evaluations);
  EXPECT_EQ(a.mesh.shift, b.mesh.shift);
  EXPECT_EQ(a.certainty.condition, b.certainty.condition);
  EXPECT_EQ(a.inexact, b.inexact);
  ASSERT_EQ(a.intervals.size(), b.intervals.size());
  for (std::size_t i = 0; i < a.intervals.size(); ++i)
    EXPECT_EQ(a.intervals[i].half_width, b.intervals[i].half_width);
  ASSERT_EQ(a.history.size(), b.history.size());
  for (std::size_t i = 0; i < a.history.size(); ++i)
    EXPECT_EQ(a.history[i].cost, b.history[i].cost) << "evaluation " << i + 1;
}

/// The same test, by a rig whose clips are known to 0.01 mm.
std::shared_ptr<const MechanicalTrial> with_clip_noise(const MechanicalTrial& trial) {
  auto noisy = std::make_shared<MechanicalTrial>(trial);
  noisy->capture.clip_noise = 1e-5;
  return noisy;
}

/// How a fit is done that is killed after `left` evaluations.
using Fit = std::function<MechanicalFitResult(std::shared_ptr<MechanicalStore>, int left)>;

/// Kills it after each of its evaluations in turn; `step`: only after each of so many.
void expect_continues(const Fit& fit, const std::function<std::filesystem::path()>& path,
                      int step = 1) {
  const MechanicalFitResult whole = fit(nullptr, 1000);
  EXPECT_EQ(whole.replayed, 0u);
  const auto count = static_cast<int>(whole.history.size());
  for (int killed = 1; killed < count; killed += step) {
    const ::testing::ScopedTrace trace(__FILE__, __LINE__,
                                       "killed after " + std::to_string(killed));
    const std::filesystem::path file = path();
    EXPECT_THROW(fit(std::make_shared<MechanicalStore>(file, "fit"), killed), Killed);
    const MechanicalFitResult continued = fit(std::make_shared<MechanicalStore>(file, "fit"), 1000);
    expect_same(whole, continued);
    // Also the ends of stages, which are not in the history.
    EXPECT_GE(continued.replayed, static_cast<std::size_t>(killed));
    for (int i = 0; i < count; ++i)
      EXPECT_EQ(continued.history[static_cast<std::size_t>(i)].replayed, i < killed);
    const MechanicalFitResult replayed = fit(std::make_shared<MechanicalStore>(file, "fit"), 1000);
    expect_same(whole, replayed);
    EXPECT_EQ(replayed.replayed, replayed.evaluations);
  }
}

// A bend: its shape, and so where the next equilibrium starts, changes with the parameters. The
// start is so far off that steps may be rejected, too: it depends on the last digits which.
TEST_F(MechanicalStoreTest, AFitContinuesAfterAnyEvaluation) {
  const Fabric truth = true_fabric();
  const Trials trials{trial(RigTest::weft_bend, truth), trial(RigTest::weft_stretch, truth)};
  Fabric start = truth;
  start.set("weft_bend", 3e-3);
  start.set("weft_stretch_1", 3000);
  const std::vector<std::string> free{"weft_bend", "weft_stretch_1", "weft_stretch_2"};
  const MechanicalProblem problem(trials, start, free);
  MechanicalFitOptions options;
  options.mesh_error = MeshError::included;
  const Fit fit = [&](std::shared_ptr<MechanicalStore> store, int left) {
    MechanicalProblem own = problem;
    own.keep_in(std::move(store));
    return fit_mechanical(own, start, options, [&](const MechanicalFitStep&) {
      if (--left == 0) throw Killed();
      return true;
    });
  };
  expect_continues(fit, [&] { return path(); });

  // What the test is good for: without the shapes the last digits would be others.
  MechanicalShapes shapes;
  const VecX from = problem.scaled(start), to = problem.scaled(truth);
  problem.cost(from, nullptr, &shapes);
  EXPECT_NE(problem.cost(to, nullptr, &shapes), problem.cost(to));
}

TEST_F(MechanicalStoreTest, SearchesWithOtherWeightsContinue) {
  const Fabric truth = true_fabric();
  const MechanicalProblem problem({with_clip_noise(*trial(RigTest::weft_stretch, truth)),
                                   with_clip_noise(*trial(RigTest::warp_stretch, truth))},
                                  truth, {"weft_stretch_1", "warp_stretch"});
  Fabric start = truth;
  start.set("weft_stretch_1", 3000);
  start.set("warp_stretch", 1500);
  const Fit fit = [&](std::shared_ptr<MechanicalStore> store, int left) {
    MechanicalProblem own = problem;
    own.keep_in(std::move(store));
    return fit_mechanical(own, start, {}, [&](const MechanicalFitStep&) {
      if (--left == 0) throw Killed();
      return true;
    });
  };
  expect_continues(
      fit, [&] { return path(); }, 3);
}

TEST_F(MechanicalStoreTest, FitsOfCurvesContinueInBothOrders) {
  const Fabric truth = true_fabric();
  const Trials trials{with_clip_noise(*trial(RigTest::weft_stretch, truth)),
                      trial(RigTest::weft_bend, truth)};
  Fabric start = Fabric::with_defaults("start", "stvk-diagonal");
  start.set("weft_stretch", 3000);
  start.set("weft_bend", 8e-4);
  const std::vector<std::string> rows{"weft_stretch", "weft_bend"};
  const std::pair<FitOrder, ThreadSymmetry> variants[] = {
      {FitOrder::incremental, ThreadSymmetry::orthotropic},
      {FitOrder::joint, ThreadSymmetry::isotropic}};
  for (const auto& [order, symmetry] : variants) {
    const Fit fit = [&, order = order, symmetry = symmetry](std::shared_ptr<MechanicalStore> store,
                                                            int left) {
      CurveFitOptions options;
      options.order = order;
      options.symmetry = symmetry;
      options.shape = CurveShape::subdivided;
      options.most_points = 2;
      options.store = std::move(store);
      return fit_curves(trials, start, rows, options,
                        [&](const std::string&, const MechanicalFitStep&) {
                          if (--left == 0) throw Killed();
                          return true;
                        })
          .fit;
    };
    expect_continues(
        fit, [&] { return path(); }, order == FitOrder::joint ? 7 : 13);
  }
}

TEST_F(MechanicalStoreTest, KeepsOnlyTheShapesThatAreOfUse) {
  const Fabric truth = true_fabric();
  const Trials trials{trial(RigTest::weft_bend, truth)};
  MechanicalProblem problem(trials, truth, {"weft_bend"});
  const auto file = path();
  const auto store = std::make_shared<MechanicalStore>(file, "fit");
  problem.keep_in(store);
  NumberStore rows(file, "fit");
  MechanicalShapes shapes;
  const VecX x = problem.scaled(truth);
  problem.cost(x, nullptr, &shapes);
  MechanicalShapes tried = shapes;
  problem.cost(x * 1.01, nullptr, &tried);
  EXPECT_EQ(rows.count(), 4u);  // numbers and shapes of each
  problem.linearize(x, &shapes);
  EXPECT_EQ(rows.count(), 4u);  // three of numbers, one of shapes
  // Without shapes to return none are kept; what is asked for again is not computed again.
  problem.cost(x);
  EXPECT_EQ(rows.count(), 5u);
  EXPECT_EQ(problem.replayed(), 0u);
  problem.cost(x);
  EXPECT_EQ(rows.count(), 5u);
  EXPECT_EQ(problem.replayed(), 1u);

  // From shapes that are gone nothing is computed, least of all from elsewhere in silence.
  MechanicalShapes gone;
  problem.cost(x, nullptr, &gone);
  EXPECT_EQ(problem.replayed(), 2u);
  try {
    problem.cost(x * 1.02, nullptr, &gone);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("1.sqlite: lacks the shapes"));
  }
}

TEST_F(MechanicalStoreTest, RemembersWhyThereIsNoEquilibrium) {
  const Fabric truth = true_fabric();
  MechanicalCostOptions options;
  options.largest_residual = 1e-30;  // N: no frame has so little left
  MechanicalProblem problem({trial(RigTest::weft_bend, truth)}, truth, {"weft_bend"}, options);
  problem.keep_in(std::make_shared<MechanicalStore>(path(), "fit"));
  std::string first, second;
  const VecX x = problem.scaled(truth);
  MechanicalShapes shapes;
  EXPECT_EQ(problem.cost(x, &first, &shapes), INFINITY);
  EXPECT_THAT(first, HasSubstr("no equilibrium at frame 0"));
  shapes = {};
  EXPECT_EQ(problem.cost(x, &second, &shapes), INFINITY);
  EXPECT_EQ(problem.replayed(), 1u);
  EXPECT_EQ(first, second);
  EXPECT_EQ(problem.linearize(x).model.cost, INFINITY);
  EXPECT_EQ(problem.linearize(x).model.gradient, VecX::Zero(1));
  EXPECT_EQ(problem.replayed(), 2u);
  EXPECT_THROW(fit_mechanical(problem, truth), MechanicalStartError);
}

TEST_F(MechanicalStoreTest, WhatIsComputedOtherwiseHasAnotherFingerprint) {
  const Fabric truth = true_fabric();
  const auto same = trial(RigTest::weft_bend, truth);
  const auto of = [&](const std::shared_ptr<const MechanicalTrial>& trial, const Fabric& fabric,
                      const std::vector<std::string>& free = {"weft_bend"},
                      const MechanicalCostOptions& options = {}) {
    return MechanicalProblem({trial}, fabric, free, options).fingerprint();
  };
  const std::string first = of(same, truth);
  EXPECT_EQ(of(trial(RigTest::weft_bend, truth), truth), first);  // read again
  std::vector<std::string> all{first};
  all.push_back(of(trial(RigTest::weft_bend, truth, 3), truth));
  all.push_back(of(trial(RigTest::warp_bend, truth), truth));
  const auto changed = [&](const std::function<void(MechanicalTrial&)>& change) {
    auto other = std::make_shared<MechanicalTrial>(*same);
    change(*other);
    all.push_back(of(other, truth));
  };
  changed([](MechanicalTrial& t) { t.capture.areal_density *= 1.01; });
  changed([](MechanicalTrial& t) { t.capture.grain_angle += 0.01; });
  changed([](MechanicalTrial& t) { t.capture.clip_noise = 1e-5; });
  changed([](MechanicalTrial& t) { t.capture.gravity.z() += 0.01; });
  changed([](MechanicalTrial& t) { t.capture.fixtures[0].frames[1].position.x() += 1e-6; });
  changed([](MechanicalTrial& t) { t.capture.fixtures[0].forces.setZero(3, 3); });
  changed([](MechanicalTrial& t) { t.capture.picture_frame = PictureFrame{0.2, VecX::Ones(3)}; });
  changed([](MechanicalTrial& t) { t.geometry->frames[1](0, 0) += 1e-6; });
  changed([](MechanicalTrial& t) { t.options.statics.force_tolerance *= 2; });
  Fabric other = truth;
  other.set("shear", 31);
  all.push_back(of(same, other));
  other = truth;
  other.set_curve("weft_stretch", {VecX::LinSpaced(2, 0, 0.21), Vec2(300, 900)});
  all.push_back(of(same, other));
  all.push_back(of(same, truth, {"weft_bend", "warp_bend"}));
  MechanicalCostOptions options;
  options.point_noise *= 2;
  all.push_back(of(same, truth, {"weft_bend"}, options));
  options = {};
  options.ties = {{"warp_bend", "weft_bend"}};
  all.push_back(of(same, truth, {"weft_bend"}, options));

  const MechanicalProblem problem({same}, truth, {"weft_bend"});
  all.push_back(fit_fingerprint(problem, truth));
  other = truth;
  other.set("weft_bend", 9e-5);
  all.push_back(fit_fingerprint(problem, other));
  CurveFitOptions curves;
  all.push_back(fit_fingerprint({same}, truth, {}, curves));
  all.push_back(fit_fingerprint({same}, truth, {"weft_bend"}, curves));
  curves.order = FitOrder::joint;
  all.push_back(fit_fingerprint({same}, truth, {}, curves));
  curves.shape = CurveShape::subdivided;
  all.push_back(fit_fingerprint({same}, truth, {}, curves));
  std::sort(all.begin(), all.end());
  EXPECT_EQ(std::unique(all.begin(), all.end()), all.end());
}

}  // namespace
}  // namespace weft::mechanical_store_test
