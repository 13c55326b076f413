#include "weft/estimate/fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>

#include "common/temporary_folder.h"
#include "estimate/analytic_problem.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/estimate/landscape.h"

namespace weft::fit_test {
namespace {

const std::vector<std::string> kFree{"stretch_stiffness", "shear_stiffness", "bend_stiffness",
                                     "bend_damping", "drag_linear"};

VecX target() {
  VecX t(5);
  t << 0.3, 0.62, 0.78, 0.41, 0.55;
  return t;
}

Problem bowl(std::atomic<int>* calls = nullptr) {
  return analytic_problem(
      kFree, [](const VecX& scaled) { return rippled_bowl(scaled, target()); }, calls);
}

FitOptions quick() {
  FitOptions options;
  options.annealing.max_evaluations = 150;
  options.with_variability = false;
  options.threads = 2;
  return options;
}

void expect_same(const FitResult& a, const FitResult& b) {
  EXPECT_EQ(a.fabric.values, b.fabric.values);
  EXPECT_EQ(a.final.error, b.final.error);
  EXPECT_EQ(a.evaluations, b.evaluations);
  ASSERT_EQ(a.history.size(), b.history.size());
  for (std::size_t i = 0; i < a.history.size(); ++i) {
    EXPECT_EQ(a.history[i].phase, b.history[i].phase);
    EXPECT_EQ(a.history[i].evaluation, i + 1);
    EXPECT_EQ(a.history[i].error, b.history[i].error);
    EXPECT_EQ(a.history[i].best, b.history[i].best);
  }
}

TEST(RunFit, FollowsTheProtocol) {
  const FitResult result = run_fit(bowl(), quick());
  std::size_t start = 0, coarse = 0, finalists = 0, annealed = 0;
  for (const FitStep& step : result.history) {
    start += step.phase == "start";
    coarse += step.phase == "coarse";
    finalists += step.phase == "finalists";
    annealed += step.phase == "anneal";
  }
  EXPECT_EQ(start, 1u);
  EXPECT_EQ(coarse, 64u);
  EXPECT_EQ(finalists, 4u);
  EXPECT_EQ(annealed, 150u);
  EXPECT_DOUBLE_EQ(result.initial.error, rippled_bowl(VecX::Constant(5, 0.5), target()));
  EXPECT_LT(result.start.error, result.initial.error);
  EXPECT_LT(result.final.error - 1, 0.25 * (result.initial.error - 1));
  EXPECT_FALSE(result.stopped);
  EXPECT_EQ(result.seed, 1u);
  // The fabric is where the error is, and only free parameters have moved.
  EXPECT_EQ(bowl().evaluator()(result.fabric, 0).error, result.final.error);
  EXPECT_EQ(result.fabric.value("drag_quadratic"), bowl().initial().value("drag_quadratic"));
}

TEST(RunFit, IsTheSameForASeedWhateverTheThreads) {
  FitOptions options = quick();
  options.start = FitOptions::Start::random;
  options.with_variability = true;
  options.threads = 1;
  const FitResult one = run_fit(bowl(), options);
  options.threads = 4;
  const FitResult four = run_fit(bowl(), options);
  expect_same(one, four);
  ASSERT_EQ(one.variability.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i)
    EXPECT_EQ(one.variability[i].error, four.variability[i].error);
  options.seed = 2;
  EXPECT_NE(run_fit(bowl(), options).fabric.values, one.fabric.values);
}

TEST(RunFit, StartsWhereItIsTold) {
  FitOptions options = quick();
  options.coarse_parameters.clear();
  options.annealing.max_evaluations = 1;
  options.start = FitOptions::Start::initial;
  const Problem problem = bowl();
  const FitResult result = run_fit(problem, options);
  EXPECT_TRUE(result.start_fabric.values.isApprox(problem.initial().values, 1e-12));
  options.start = FitOptions::Start::middle;
  const VecX middle = problem.scaled(run_fit(problem, options).start_fabric);
  EXPECT_LT((middle - VecX::Constant(5, 0.5)).norm(), 1e-9);
  options.start = FitOptions::Start::random;
  const VecX drawn = run_fit(problem, options).start_fabric.values;
  options.start_seed = options.seed;
  EXPECT_EQ(run_fit(problem, options).start_fabric.values, drawn);
  options.start_seed = options.seed + 1;
  EXPECT_NE(run_fit(problem, options).start_fabric.values, drawn);
}

// The paper's own protocol: the coarse search alone decides where annealing starts.
TEST(RunFit, OneFinalistIsTheMinimumOfTheCoarseSearch) {
  FitOptions options = quick();
  options.coarse_finalists = 1;
  options.annealing.max_evaluations = 1;
  const Problem problem = bowl();
  const VecX start = problem.scaled(run_fit(problem, options).start_fabric);
  VecX best = VecX::Constant(5, 0.5);
  double least = kInfinity;
  for (int i = 0; i < 64; ++i) {
    VecX x = VecX::Constant(5, 0.5);
    x.head<3>() << (i / 16 + 0.5) / 4, (i / 4 % 4 + 0.5) / 4, (i % 4 + 0.5) / 4;
    if (rippled_bowl(x, target()) >= least) continue;
    least = rippled_bowl(x, target());
    best = x;
  }
  EXPECT_LT((start - best).norm(), 1e-9);
}

TEST(RunFit, AKilledRunContinuesFromItsStore) {
  const test::TemporaryFolder temporary;
  const auto& folder = temporary.path();
  std::atomic<int> calls = 0;
  const Problem problem = bowl(&calls);
  FitOptions options = quick();
  options.threads = 1;
  const FitResult whole = run_fit(problem, options);
  const int needed = calls;
  {
    // Killed: whatever the observer throws ends the run without any clean-up of its own.
    calls = 0;
    EvaluationStore store(folder / "evaluations.sqlite");
    EXPECT_THROW(run_fit(problem, options, &store,
                         [&](const FitProgress& progress) -> bool {
                           if (progress.step.phase == "anneal" && progress.done > 60)
                             throw std::runtime_error("killed");
                           return true;
                         }),
                 std::runtime_error);
  }
  const int before = calls;
  calls = 0;
  EvaluationStore store(folder / "evaluations.sqlite");
  const FitResult resumed = run_fit(problem, options, &store);
  EXPECT_GT(before, 100);
  EXPECT_EQ(before + calls, needed);  // nothing was evaluated twice
  EXPECT_EQ(resumed.replayed, std::size_t(before));
  expect_same(whole, resumed);

  calls = 0;
  expect_same(whole, run_fit(problem, options, &store));
  EXPECT_EQ(calls, 0);
}

TEST(RunFit, StopsWithTheBestSoFar) {
  for (const char* phase : {"start", "coarse", "finalists", "anneal", "variability"}) {
    FitOptions options = quick();
    options.with_variability = true;
    // The first phase has a single step.
    const std::size_t allowed = std::string(phase) == "start" ? 1 : 2;
    std::size_t seen = 0;
    const FitResult result = run_fit(bowl(), options, nullptr, [&](const FitProgress& progress) {
      return progress.step.phase != phase || ++seen < allowed;
    });
    EXPECT_TRUE(result.stopped) << phase;
    EXPECT_LE(result.final.error, result.initial.error) << phase;
    EXPECT_FALSE(result.warnings.empty()) << phase;
    EXPECT_EQ(bowl().evaluator()(result.fabric, 0).error, result.final.error) << phase;
  }
}

TEST(RunFit, StopsOnASignalWithTheBestSoFar) {
  const InterruptGuard guard;
  const FitResult result = run_fit(bowl(), quick(), nullptr, [](const FitProgress& progress) {
    if (progress.step.phase == "anneal" && progress.done == 10) std::raise(SIGINT);
    return true;
  });
  EXPECT_TRUE(result.stopped);
  // Two moves are made at a time.
  EXPECT_LE(result.history.size(), 1u + 64 + 4 + 12);
  EXPECT_LT(result.final.error, result.initial.error);
}

// A signal while the finalists are compared: those that were not begun are left out.
TEST(RunFit, StopsOnASignalAmongTheFinalists) {
  const InterruptGuard guard;
  std::atomic<int> after = 0;
  std::atomic<bool> coarse = true;
  FitOptions options = quick();
  options.threads = 1;
  options.coarse_finalists = 6;
  const Problem known = bowl();
  const Problem problem(known.trials(), known.initial(), kFree,
                        [&](const Fabric& fabric, int frames) {
                          if (frames == 0 && !coarse && ++after == 2) std::raise(SIGINT);
                          return known.evaluator()(fabric, frames);
                        });
  const FitResult result = run_fit(problem, options, nullptr, [&](const FitProgress& progress) {
    if (progress.step.phase == "coarse") coarse = false;
    return true;
  });
  EXPECT_TRUE(result.stopped);
  std::size_t finalists = 0;
  for (const FitStep& step : result.history) finalists += step.phase == "finalists";
  EXPECT_EQ(finalists, 2u);
  EXPECT_EQ(result.start.error, result.initial.error);
  EXPECT_LE(result.final.error, result.initial.error);
}

TEST(RunFit, GoesOnPastDivergedSimulationsAndCountsThem) {
  const Problem problem = analytic_problem(kFree, [](const VecX& scaled) {
    return scaled[0] > 0.5 ? kInfinity : rippled_bowl(scaled, target());
  });
  const FitResult result = run_fit(problem, quick());
  EXPECT_LT(result.final.error, 1.5);
  std::size_t infinite = 0;
  for (const FitStep& step : result.history) infinite += std::isinf(step.error);
  EXPECT_GT(infinite, 30u);
  EXPECT_GE(infinite, result.diverged);
  EXPECT_GT(result.diverged, 30u);
}

TEST(RunFit, AllDivergedIsSaidPlainly) {
  const Problem problem = analytic_problem(kFree, [](const VecX&) { return kInfinity; });
  const FitResult result = run_fit(problem, quick());
  EXPECT_EQ(result.final.error, kInfinity);
  EXPECT_EQ(result.diverged, result.evaluations);
  EXPECT_NE(std::find(result.warnings.begin(), result.warnings.end(),
                      "every simulation diverged: there is no estimate"),
            result.warnings.end());
}

TEST(RunFit, WarnsOfAParameterAtABound) {
  const Problem problem =
      analytic_problem({"bend_stiffness"}, [](const VecX& scaled) { return 1 + scaled[0]; });
  FitOptions options = quick();
  options.with_variability = true;
  const FitResult result = run_fit(problem, options);
  ASSERT_FALSE(result.warnings.empty());
  EXPECT_NE(result.warnings[0].find("lower bound"), std::string::npos);
}

TEST(RunFit, RejectsBadOptions) {
  FitOptions options = quick();
  options.coarse_parameters = {"bend_stifness"};
  EXPECT_THROW(run_fit(bowl(), options), Error);
  options = quick();
  options.coarse_finalists = 0;
  EXPECT_THROW(run_fit(bowl(), options), Error);
  options = quick();
  options.coarse_levels = 0;
  EXPECT_THROW(run_fit(bowl(), options), Error);
}

TEST(Problem, RejectsWhatCannotBeSearched) {
  const Fabric fabric = Fabric::with_defaults("test");
  const auto trial = std::make_shared<Trial>();
  EXPECT_THROW(Problem({}, fabric, {"bend_stiffness"}), Error);
  EXPECT_THROW(Problem({trial}, fabric, {}), Error);
  EXPECT_THROW(Problem({trial}, fabric, {"bend"}), Error);
  EXPECT_THROW(Problem({trial}, fabric, {"bend_stiffness", "bend_stiffness"}), Error);
}

TEST(Problem, ScaledCoordinatesGoThereAndBack) {
  const Problem problem = bowl();
  const VecX scaled = target();
  EXPECT_LT((problem.scaled(problem.fabric(scaled)) - scaled).norm(), 1e-9);
  for (const double end : {0.0, 1.0}) {
    const Fabric fabric = problem.fabric(VecX::Constant(5, end));
    for (int i = 0; i < 5; ++i)
      EXPECT_EQ(fabric.value(problem.info(i).name),
                end == 0 ? problem.info(i).lower : problem.info(i).upper);
  }
}

TEST(Landscape, HoldsTheErrorAtEachPairOfValues) {
  const Problem problem = bowl();
  LandscapeOptions options;
  options.x_count = 5;
  options.y_count = 4;
  options.x_lower = 0.2;
  options.threads = 2;
  const Fabric fabric = problem.fabric(target());
  const Landscape map = landscape(problem, fabric, options);
  ASSERT_EQ(map.error.rows(), 4);
  ASSERT_EQ(map.error.cols(), 5);
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 5; ++column) {
      VecX scaled = target();
      scaled[problem.index_of("stretch_stiffness")] = 0.2 + 0.8 * column / 4;
      scaled[problem.index_of("bend_stiffness")] = row / 3.0;
      EXPECT_NEAR(map.error(row, column), rippled_bowl(scaled, target()), 1e-9);
    }
  EXPECT_NEAR(map.x.back(), problem.info(0).upper, 1e-9 * problem.info(0).upper);
  EXPECT_TRUE(std::is_sorted(map.y.begin(), map.y.end()));
}

TEST(Landscape, HoldsTheErrorAlongOneParameter) {
  const Problem problem = bowl();
  LandscapeOptions options;
  options.x_parameter = "shear_stiffness";
  options.y_parameter = "";
  options.x_count = 3;
  const Landscape line = landscape(problem, problem.fabric(target()), options);
  EXPECT_TRUE(line.y.empty());
  ASSERT_EQ(line.error.rows(), 1);
  ASSERT_EQ(line.error.cols(), 3);
  for (int column = 0; column < 3; ++column) {
    VecX scaled = target();
    scaled[problem.index_of("shear_stiffness")] = column / 2.0;
    EXPECT_NEAR(line.error(0, column), rippled_bowl(scaled, target()), 1e-9);
  }
}

TEST(Landscape, ChangesAnOptionalTermItselfWhereOthersAreLeftOut) {
  const Problem problem =
      analytic_problem({"bend_stiffness", "drag_normal_linear"},
                       [](const VecX& scaled) { return 1 + scaled[0] + 10 * scaled[1]; });
  LandscapeOptions options;
  options.x_parameter = "drag_normal_linear";
  options.x_count = options.y_count = 2;
  const Landscape map = landscape(problem, problem.fabric(VecX::Constant(2, 0.5)), options);
  EXPECT_NEAR(map.error(1, 0), 2, 1e-9);
  EXPECT_NEAR(map.error(0, 1), 11, 1e-9);
}

TEST(Landscape, RejectsBadOptions) {
  const Problem problem = bowl();
  const auto run = [&](auto change) {
    LandscapeOptions options;
    change(options);
    landscape(problem, problem.initial(), options);
  };
  EXPECT_THROW(run([](auto& o) { o.x_parameter = "drag_quadratic"; }), Error);  // not free
  EXPECT_THROW(run([](auto& o) { o.x_parameter = o.y_parameter; }), Error);
  EXPECT_THROW(run([](auto& o) { o.x_count = 1; }), Error);
  EXPECT_THROW(run([](auto& o) { o.y_lower = 0.9, o.y_upper = 0.2; }), Error);
}

}  // namespace
}  // namespace weft::fit_test
