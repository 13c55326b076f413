#include "weft/estimate/linearize_trial.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "common/difference_sensitivities.h"
#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/estimate/least_squares_fit.h"
#include "weft/estimate/patch_parts.h"
#include "weft/estimate/synthetic.h"
#include "weft/estimate/uncertainty.h"
#include "weft/estimate/variability.h"

namespace weft::linearize_trial_test {
namespace {

Fabric true_fabric() {
  Fabric fabric = Fabric::with_defaults("truth");
  fabric.set("bend_stiffness", 2e-5);
  fabric.set("stretch_stiffness", 100);
  fabric.set("shear_stiffness", 60);
  return fabric;
}

/// A small swatch in a small image: 17 x 17 vertices as truth, 13 x 13 to fit. Made once.
class LinearizeTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<test::TemporaryFolder>();
    root_ = folder_->path();
    LayoutOptions layout;
    layout.width = layout.height = 0.3;
    layout.image_width = 160;
    layout.image_height = 120;
    layout.stripe_period = 0.022;
    layout.frame_count = layout.fit_frames = 4;
    layout.wave_frequency = 3;
    SyntheticOptions synthetic;
    synthetic.columns = synthetic.rows = 17;
    synthetic.simulation.steps_per_frame = 4;
    const Capture capture =
        make_synthetic_capture(root_, make_layout(layout), true_fabric(), synthetic);
    TrialOptions options;
    options.columns = options.rows = 13;
    options.angle_map.kernel_radius = 4;
    options.angle_map.blur_sigma = 2;
    options.simulation.steps_per_frame = 2;
    with_starts_ = prepare_trial(capture, 0, 3, options);
    // Most of a fit of four frames would be the search for starts.
    auto trial = std::make_shared<Trial>(*with_starts_);
    trial->other_starts.clear();
    trial_ = std::move(trial);
    later_ = prepare_trial(capture, 2, 3, options);
    first_ = prepare_trial(capture, 0, 0, options);
  }
  static void TearDownTestSuite() {
    with_starts_.reset();
    trial_.reset();
    later_.reset();
    first_.reset();
    folder_.reset();
  }

  static Problem problem() { return problem_of(trial_); }
  static Problem problem_with_starts() { return problem_of(with_starts_); }
  static Problem problem_of(const std::shared_ptr<const Trial>& trial) {
    return Problem({trial}, true_fabric(), {"stretch_stiffness", "bend_stiffness"});
  }
  /// Away from the truth by a quarter and by a factor of two.
  static VecX wrong() {
    Fabric fabric = true_fabric();
    fabric.set("stretch_stiffness", 125);
    fabric.set("bend_stiffness", 4e-5);
    return problem().scaled(fabric);
  }

  static inline std::unique_ptr<test::TemporaryFolder> folder_;
  static inline std::filesystem::path root_;
  static inline std::shared_ptr<const Trial> with_starts_, trial_, later_, first_;
};

TEST_F(LinearizeTest, SlopeOfAParameterIsThatOfItsScale) {
  for (const ParameterInfo& info : baraff_witkin_parameters()) {
    const double scaled = 0.37, value = from_scaled(info, scaled);
    const double exact = info.scale == Scale::logarithmic
                             ? value * std::log(info.upper / info.lower)
                             : (value + 0.1) * std::log((info.upper + 0.1) / (info.lower + 0.1));
    EXPECT_NEAR(scaled_slope(info, scaled), exact, 1e-6 * exact) << info.name;
    EXPECT_GT(scaled_slope(info, 0), 0);
    EXPECT_GT(scaled_slope(info, 1), 0);
  }
}

TEST_F(LinearizeTest, EvaluationIsThePapers) {
  const ProblemEvaluation expected = evaluate(problem(), problem().fabric(wrong()));
  const ProblemCost cost = evaluate_cost(problem(), wrong());
  EXPECT_DOUBLE_EQ(cost.evaluation.error, expected.error);
  EXPECT_DOUBLE_EQ(cost.evaluation.error_per_frame, expected.error_per_frame);
  EXPECT_DOUBLE_EQ(cost.evaluation.silhouette, expected.silhouette);
  // The trajectories differ by Newton's tolerance, 1e-6 m or some 1e-3 px in each step.
  const ProblemLinearization found = linearize(problem(), wrong());
  EXPECT_NEAR(found.evaluation.error, expected.error, 1e-3 * expected.error);
  EXPECT_NEAR(found.model.cost, cost.cost, 1e-3 * cost.cost);
  EXPECT_EQ(found.inexact, 0);
  LinearizationOptions two;
  two.frame_count = 2;
  EXPECT_DOUBLE_EQ(evaluate_cost(problem(), wrong(), two).evaluation.error,
                   evaluate(problem(), problem().fabric(wrong()), 2).error);
}

// Differences over 0.04 of the range (bend: a factor of 1.6): narrower ones see single pixels flip.
TEST_F(LinearizeTest, GradientIsTheSlopeOfTheCost) {
  const ProblemLinearization found = linearize(problem(), wrong());
  for (int i = 0; i < 2; ++i) {
    VecX above = wrong(), below = wrong();
    above[i] += 0.02;
    below[i] -= 0.02;
    const double slope =
        (evaluate_cost(problem(), above).cost - evaluate_cost(problem(), below).cost) / 0.04;
    EXPECT_NEAR(found.model.gradient[i], slope, 0.25 * std::abs(slope)) << i;
  }
}

TEST_F(LinearizeTest, SensitivitiesByDifferencesGiveTheSame) {
  LinearizationOptions options;
  options.simulator = difference_sensitivities;
  const ProblemLinearization exact = linearize(problem(), wrong());
  const ProblemLinearization differences = linearize(problem(), wrong(), options);
  EXPECT_LT((exact.model.gradient - differences.model.gradient).norm(),
            0.01 * exact.model.gradient.norm());
  EXPECT_LT((exact.model.hessian - differences.model.hessian).norm(),
            0.01 * exact.model.hessian.norm());
}

TEST_F(LinearizeTest, TheSameForAnyThreadsAndThePartsAddUp) {
  LinearizationOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const ProblemLinearization a = linearize(problem(), wrong(), one);
  const ProblemLinearization b = linearize(problem(), wrong(), three);
  EXPECT_EQ(a.model.cost, b.model.cost);
  EXPECT_EQ(a.model.gradient, b.model.gradient);
  EXPECT_EQ(a.model.hessian, b.model.hessian);
  ASSERT_EQ(a.parts.size(), 4u);
  VecX gradient = VecX::Zero(2);
  for (const CostPart& part : a.parts) gradient += part.gradient;
  EXPECT_LT((gradient - a.model.gradient).norm(), 1e-12 * gradient.norm());
}

TEST_F(LinearizeTest, TrialsWeighTheSame) {
  const std::vector<std::string> free{"stretch_stiffness", "bend_stiffness"};
  const ProblemLinearization first = linearize(problem(), wrong());
  const ProblemLinearization second = linearize(Problem({later_}, true_fabric(), free), wrong());
  const ProblemLinearization both =
      linearize(Problem({trial_, later_}, true_fabric(), free), wrong());
  EXPECT_NEAR(both.model.cost, 0.5 * (first.model.cost + second.model.cost), 1e-12);
  EXPECT_LT((both.model.hessian - 0.5 * (first.model.hessian + second.model.hessian)).norm(),
            1e-9 * both.model.hessian.norm());
  ASSERT_EQ(both.parts.size(), 6u);
  EXPECT_EQ(both.parts[4].trial, 1u);
}

TEST_F(LinearizeTest, AParameterThatMovesNothingHasNoDerivative) {
  // Drag before anything moves.
  const Problem drag({trial_}, true_fabric(), {"drag_quadratic", "bend_stiffness"});
  LinearizationOptions options;
  options.frame_count = 1;
  const ProblemLinearization found = linearize(drag, VecX::Constant(2, 0.5), options);
  EXPECT_EQ(found.model.gradient[0], 0);
  EXPECT_EQ(found.model.hessian(0, 0), 0);
  EXPECT_GT(found.model.hessian(1, 1), 0);
}

TEST_F(LinearizeTest, VariabilityFromDerivativesIsThatOfAParabola) {
  // E (1 + 0.01) = E + H t^2 / 2, and bend = lower (upper / lower)^t.
  const Problem p = problem();
  QuadraticModel model{3, Vec2(0, -7), MatX::Zero(2, 2)};  // the slope of a dent does not count
  model.hessian(1, 1) = 600;
  const VecX percent = variability_from_derivatives(p, wrong(), 3, model);
  const ParameterInfo& bend = p.info(1);
  EXPECT_NEAR(percent[1], std::sqrt(2 * 0.01 * 3 / 600.0) * 100 * std::log(bend.upper / bend.lower),
              1e-5 * percent[1]);
  EXPECT_TRUE(std::isinf(percent[0]));
  EXPECT_THROW(variability_from_derivatives(p, wrong(), 3, model, 0), Error);
}

TEST_F(LinearizeTest, VariabilityAtABoundHasTheSlopeThatHoldsIt) {
  // 7 t + 600 t^2 / 2 = 0.01 E, inwards from the upper end.
  const Problem p = problem();
  QuadraticModel model{3, Vec2(0, -7), MatX::Zero(2, 2)};
  const ParameterInfo& bend = p.info(1);
  const double to_percent = 100 * std::log(bend.upper / bend.lower);
  const VecX scaled = Vec2(0.5, 1);
  EXPECT_NEAR(variability_from_derivatives(p, scaled, 3, model)[1], 0.03 / 7 * to_percent,
              1e-5 * to_percent);
  model.hessian(1, 1) = 600;
  const double t = (-7 + std::sqrt(49 + 2 * 600 * 0.03)) / 600;
  EXPECT_NEAR(variability_from_derivatives(p, scaled, 3, model)[1], t * to_percent,
              1e-5 * to_percent);
}

TEST_F(LinearizeTest, VariabilityFromDerivativesRaisesTheCostByOnePercent) {
  const Problem p = problem();
  const VecX scaled =
      minimize_least_squares([&](const VecX& x) { return linearize(p, x).model; },
                             [&](const VecX& x) { return evaluate_cost(p, x).cost; },
                             p.scaled(true_fabric()), VecX::Zero(2), VecX::Ones(2))
          .x;
  const ProblemLinearization found = linearize(p, scaled);
  const VecX percent = variability_from_derivatives(p, scaled, found.evaluation.error, found.model);
  for (int i = 0; i < 2; ++i) {
    const ParameterInfo& info = p.info(i);
    const VecX step =
        std::log1p(percent[i] / 100) / std::log(info.upper / info.lower) * VecX::Unit(2, i);
    const auto cost = [&](const VecX& x) { return evaluate_cost(p, x).cost; };
    const double rise =
        0.5 * (cost(scaled + step) + cost(scaled - step)) - evaluate_cost(p, scaled).cost;
    // The cost of four frames of a small image is no parabola, so a factor is all to ask.
    EXPECT_GT(rise, 0.01 * found.evaluation.error / 3) << info.name;
    EXPECT_LT(rise, 0.01 * found.evaluation.error * 3) << info.name;
  }
}

TEST_F(LinearizeTest, UnstableMotionCountsLess) {
  LinearizationOptions options;
  options.unstable_motion = 1e-4;
  const ProblemLinearization trusted = linearize(problem(), wrong());
  const ProblemLinearization doubted = linearize(problem(), wrong(), options);
  EXPECT_EQ(trusted.model.cost, doubted.model.cost);
  EXPECT_LT(doubted.model.hessian.norm(), 1e-2 * trusted.model.hessian.norm());
}

TEST_F(LinearizeTest, ADivergedSimulationIsAnInfiniteCost) {
  LinearizationOptions options;
  options.simulator = [](const Scene&, const Fabric&, const std::vector<int>&,
                         const SimulationOptions&, int) {
    TrajectoryWithSensitivities nothing;
    nothing.trajectory.diverged = true;
    return nothing;
  };
  const ProblemLinearization found = linearize(problem(), wrong(), options);
  EXPECT_EQ(found.model.cost, std::numeric_limits<double>::infinity());
  EXPECT_TRUE(found.evaluation.diverged);
  EXPECT_TRUE(found.parts.empty());
}

LeastSquaresFitOptions small_fit() {
  LeastSquaresFitOptions options;
  options.screening_points = 4;
  options.screening_frames = 2;
  options.stages = {{2, 2, 4, 4, 1, 0.05}, {0, 1, 8, 2, 1, 0}};
  return options;
}

// From another mesh: bend comes back to within 40 % as with the annealer, stretch to within 20 %.
TEST_F(LinearizeTest, AFitRecoversTheFabric) {
  std::vector<std::string> phases;
  std::vector<std::string> parts;
  std::vector<std::vector<std::size_t>> of_starts;
  const FitResult result =
      run_least_squares_fit(problem_with_starts(), small_fit(), nullptr, [&](const FitProgress& p) {
        if (phases.empty() || phases.back() != p.step.phase) {
          phases.push_back(p.step.phase);
          parts.push_back(p.part);
          if (p.step.phase == "starts") of_starts.emplace_back();
        }
        if (p.step.phase == "starts") of_starts.back().push_back(p.done);
        return true;
      });
  EXPECT_EQ(phases, (std::vector<std::string>{"screening", "start", "starts", "2 frames", "starts",
                                              "all frames", "starts", "start"}));
  EXPECT_EQ(parts,
            (std::vector<std::string>{"", "", "", "stage 1 of 2", "", "stage 2 of 2", "", ""}));
  // From 0 one by one, and the last again when the search ends.
  ASSERT_EQ(of_starts.size(), 3u);
  for (const std::vector<std::size_t>& done : of_starts) {
    ASSERT_GT(done.size(), 5u);
    for (std::size_t i = 0; i + 1 < done.size(); ++i) EXPECT_EQ(done[i], i);
    EXPECT_EQ(done.back(), done.size() - 2);
  }
  EXPECT_LT(std::abs(std::log(result.fabric.value("bend_stiffness") / 2e-5)), std::log(1.4));
  EXPECT_LT(std::abs(std::log(result.fabric.value("stretch_stiffness") / 100)), std::log(1.2));
  EXPECT_LE(result.final.error, 1.05 * evaluate(problem(), true_fabric()).error);
  EXPECT_EQ(result.final.error, evaluate(problem(), result.fabric).error);
  EXPECT_EQ(result.history.size(), result.evaluations);
  ASSERT_EQ(result.trials.size(), 1u);
  EXPECT_FALSE(result.stopped);
  for (const FitStep& step : result.history) {
    if (step.phase == "all frames") {
      EXPECT_LE(result.final.error, step.error);
    }
  }

  const ProblemLinearization found = linearize(problem(), result.scaled);
  const Uncertainty u = estimate_uncertainty(problem(), result.scaled, found.parts);
  for (const ParameterInterval& p : u.parameters) {
    EXPECT_TRUE(p.determined) << p.name;
    EXPECT_LT(p.half_width, 0.2) << p.name;
  }
}

TEST_F(LinearizeTest, AFitIsTheSameForAnyThreadsAndGoesThroughTheStore) {
  EvaluationStore store(root_ / "evaluations.sqlite");
  LeastSquaresFitOptions options = small_fit();
  options.stages = {{2, 1, 2, 4, 1, 0.05}, {0, 1, 2, 2, 1, 0}};
  options.threads = 1;
  const FitResult one = run_least_squares_fit(problem(), options, &store);
  EXPECT_EQ(one.replayed, 0u);
  EXPECT_GT(store.count(problem()), 0u);
  options.threads = 2;
  const FitResult two = run_least_squares_fit(problem(), options, &store);
  EXPECT_EQ(one.scaled, two.scaled);
  EXPECT_GE(two.replayed, 5u);  // the middle and the screening, at least
}

// Not only when all of a phase are done.
TEST_F(LinearizeTest, TellsOfEvaluationsAsTheyEnd) {
  EvaluationStore store(root_ / "told.sqlite");
  LeastSquaresFitOptions options = small_fit();
  options.stages = {{0, 1, 1, 2, 1, 0}};
  options.threads = 1;
  std::vector<std::size_t> stored, done;
  run_least_squares_fit(problem(), options, &store, [&](const FitProgress& p) {
    if (p.step.phase != "screening") return true;
    EXPECT_EQ(p.total, 5u);
    done.push_back(p.done);
    stored.push_back(store.count(problem()));
    return true;
  });
  EXPECT_EQ(done, (std::vector<std::size_t>{1, 2, 3, 4, 5}));
  // With the middle of the ranges, which is the first.
  EXPECT_EQ(stored, (std::vector<std::size_t>{2, 3, 4, 5, 6}));
}

TEST_F(LinearizeTest, AStopLeavesOutTheRestOfAScreening) {
  LeastSquaresFitOptions options = small_fit();
  options.threads = 1;
  std::size_t told = 0;
  const FitResult result = run_least_squares_fit(problem(), options, nullptr, [&](const auto& p) {
    told += p.step.phase == "screening";
    return told < 2;
  });
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(told, 2u);
  // With the middle, and at the end the best of the two on all frames.
  ASSERT_EQ(result.history.size(), 4u);
  EXPECT_EQ(result.history.back().phase, "all frames");
  EXPECT_EQ(result.final.error, std::min(result.initial.error, result.history.back().error));
}

// Does a fit depend on its start? Only what is asked about may change.
TEST_F(LinearizeTest, TheSeedOfAStartMovesNothingElse) {
  LeastSquaresFitOptions options = small_fit();
  options.stages = {{0, 1, 1, 2, 1, 0}};
  options.start = FitOptions::Start::random;
  const auto screened = [&] {
    std::vector<double> errors;
    for (const FitStep& step : run_least_squares_fit(problem(), options).history)
      if (step.phase == "screening") errors.push_back(step.error);
    return errors;
  };
  const std::vector<double> drawn_alike = screened();
  ASSERT_EQ(drawn_alike.size(), 5u);
  options.start_seed = options.seed;
  EXPECT_EQ(screened(), drawn_alike);
  options.start_seed = 7;
  std::vector<double> other_start = screened();
  ASSERT_EQ(other_start.size(), 5u);
  EXPECT_NE(other_start[0], drawn_alike[0]);
  other_start[0] = drawn_alike[0];
  EXPECT_EQ(other_start, drawn_alike);
}

// Neighbours of where few frames ended are compared on all of them; what is a tenth better is gone
// on from, and nothing else is.
TEST_F(LinearizeTest, ScatteredPointsThatTakeAnotherWayAreGoneOnFrom) {
  LeastSquaresFitOptions options = small_fit();
  options.screening_points = 0;
  options.stages = {{2, 1, 1, 4, 1, 1e3}, {0, 1, 1, 2, 1, 0}};  // the pull leaves it in the middle
  const FitResult alone = run_least_squares_fit(problem(), options);
  options.stages[1].scattered = 16;
  options.stages[1].scatter = 0.3;
  const FitResult scattered = run_least_squares_fit(problem(), options);
  EXPECT_LT(scattered.start.error, 0.9 * alone.start.error);
  EXPECT_LE(scattered.final.error, scattered.start.error);
  EXPECT_GE(scattered.evaluations, alone.evaluations + 16);
  options.stages[1].scatter = 0;  // the same point 16 times is not another way
  EXPECT_EQ(run_least_squares_fit(problem(), options).scaled, alone.scaled);
}

// Without the silhouette, too, there is something to go down by.
TEST_F(LinearizeTest, AStageLeavesTheFoldsOutWhereTheSilhouetteCounts) {
  LeastSquaresFitOptions options = small_fit();
  options.screening_points = 0;
  options.stages = {{0, 1, 2, 2, 1, 0}};
  const auto end = [&](double alpha, double fold_weight) {
    auto trial = std::make_shared<Trial>(*trial_);
    trial->options.alpha = alpha;
    options.stages[0].fold_weight = fold_weight;
    return run_least_squares_fit(Problem({trial}, true_fabric(), problem().free()), options);
  };
  const FitResult with_folds = end(0.1, 1), without = end(0.1, 0);
  EXPECT_NE(without.scaled, with_folds.scaled);
  EXPECT_LT(without.final.silhouette, 0.8 * without.initial.silhouette);
  // Its cost knows no weight: another alpha is the same way down.
  EXPECT_LT((end(0.3, 0).scaled - without.scaled).norm(), 1e-6);
  EXPECT_EQ(end(0, 0).scaled, end(0, 1).scaled);
}

TEST_F(LinearizeTest, HopsGoOnFromTheEndOfTheStages) {
  LeastSquaresFitOptions options = small_fit();
  options.screening_points = 0;
  options.stages = {{0, 1, 1, 2, 1, 0}};
  const FitResult alone = run_least_squares_fit(problem(), options);
  options.hops.rounds = 2;
  options.hops.drawn = 4;
  options.hops.max_iterations = 2;
  options.hops.least_gain = 0;
  options.threads = 1;
  const FitResult result = run_least_squares_fit(problem(), options);
  EXPECT_LT(result.final.error, alone.final.error);
  EXPECT_EQ(result.hop_gain, 1 - result.final.error / alone.final.error);  // of patience rounds
  EXPECT_EQ(result.final.error, evaluate(problem(), result.fabric).error);
  EXPECT_EQ(result.history.back().phase, "hops");
  EXPECT_GE(result.evaluations,
            alone.evaluations + 2 * (4 + 2));  // a trial step a descent at least
  options.threads = 2;
  EXPECT_EQ(run_least_squares_fit(problem(), options).scaled, result.scaled);
  options.hops.least_gain = 1;  // no round gains that
  const auto two_rounds = run_least_squares_fit(problem(), options).evaluations;
  options.hops.rounds = 5;
  const FitResult fruitless = run_least_squares_fit(problem(), options);
  EXPECT_EQ(fruitless.evaluations, two_rounds);
  EXPECT_EQ(fruitless.hop_gain, 0);
  options.hops.patience = 1;
  EXPECT_LT(run_least_squares_fit(problem(), options).evaluations, two_rounds);
  // Where starts have changed, as they do after the first of two stages, the middle of the ranges
  // is looked at again, from those of the estimate.
  options.stages = {{2, 1, 1, 2, 1, 0}, {0, 1, 1, 2, 1, 0}};
  options.hops.rounds = 1;
  const FitResult moved = run_least_squares_fit(problem_with_starts(), options);
  ASSERT_GT(moved.history.size(), 2u);
  EXPECT_EQ(moved.history.rbegin()[1].phase, "hops");
  EXPECT_EQ(moved.history.back().phase, "start");
}

/// One descent, then as many evaluations of annealing.
AutoFitOptions descent_and_annealing(int evaluations) {
  AutoFitOptions options;
  options.least_squares = small_fit();
  options.least_squares.stages = {{0, 1, 2, 3, 1, 0.05}};
  options.least_squares.hops.rounds = 0;
  options.annealing.annealing.max_evaluations = evaluations;
  options.annealing.with_variability = false;
  return options;
}

TEST_F(LinearizeTest, AnnealingGoesOnFromTheEndOfLeastSquares) {
  AutoFitOptions options = descent_and_annealing(20);
  const FitResult descent = run_least_squares_fit(problem(), options.least_squares);
  const FitResult whole = run_auto_fit(problem(), options);
  EXPECT_LE(whole.final.error, descent.final.error);
  EXPECT_EQ(whole.final.error, evaluate(problem(), whole.fabric).error);
  EXPECT_EQ(whole.initial.error, descent.initial.error);
  EXPECT_NEAR(whole.start.error, descent.final.error, 1e-3 * descent.final.error);
  ASSERT_GT(whole.history.size(), descent.history.size() + 20);
  EXPECT_EQ(whole.history[descent.history.size()].phase, "start");
  EXPECT_EQ(whole.history.back().phase, "anneal");
  for (std::size_t i = 0; i < whole.history.size(); ++i)
    EXPECT_EQ(whole.history[i].evaluation, i + 1);

  options.annealing.annealing.max_evaluations = 0;
  EXPECT_EQ(run_auto_fit(problem(), options).scaled, descent.scaled);
}

TEST_F(LinearizeTest, TheSearchForStartsAfterAnnealingIsToldOfAndCanBeStopped) {
  bool annealed = false;
  std::vector<std::size_t> tried;
  const FitResult result = run_auto_fit(problem_with_starts(), descent_and_annealing(2), nullptr,
                                        [&](const FitProgress& p) {
                                          annealed |= p.step.phase == "anneal";
                                          if (annealed && p.step.phase == "starts")
                                            tried.push_back(p.done);
                                          return tried.size() < 3;
                                        });
  EXPECT_EQ(tried, (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(result.final.error, evaluate(problem_of(result.compared.front()), result.fabric).error);
}

TEST_F(LinearizeTest, OfSeveralSearchesTheBestIsKept) {
  AutoFitOptions options;
  options.least_squares = small_fit();
  options.least_squares.stages = {{2, 1, 1, 3, 1, 0.05}};
  options.least_squares.start = FitOptions::Start::random;
  options.least_squares.screening_points = 0;
  options.least_squares.hops.rounds = 0;
  options.searches = 3;
  std::vector<std::string> phases;
  const FitResult best = run_auto_fit(problem(), options, nullptr, [&](const FitProgress& p) {
    phases.push_back(p.step.phase);
    return true;
  });
  ASSERT_EQ(best.searches.size(), 3u);
  EXPECT_TRUE(phases.front().starts_with("search 1 of 3: "));
  EXPECT_TRUE(phases.back().starts_with("search 3 of 3: "));
  double least = kInfinity;
  std::size_t evaluations = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const SearchEnd& end = best.searches[k];
    options.searches = 1;
    options.least_squares.seed = end.seed;
    const FitResult alone = run_auto_fit(problem(), options);
    EXPECT_EQ(end.error, alone.final.error);
    EXPECT_EQ(end.fabric.values, alone.fabric.values);
    EXPECT_EQ(end.evaluations, alone.evaluations);
    least = std::min(least, end.error);
    evaluations += end.evaluations;
  }
  EXPECT_EQ(best.final.error, least);
  EXPECT_EQ(best.final.error, evaluate(problem(), best.fabric).error);
  EXPECT_EQ(best.evaluations, evaluations);
  ASSERT_EQ(best.history.size(), evaluations);
  for (std::size_t i = 0; i < evaluations; ++i) EXPECT_EQ(best.history[i].evaluation, i + 1);
  options.searches = 0;
  EXPECT_THROW(run_auto_fit(problem(), options), Error);

  // Stopped in the second one: the best of both.
  options.searches = 3;
  options.least_squares.seed = 1;
  const FitResult stopped = run_auto_fit(problem(), options, nullptr, [](const FitProgress& p) {
    return !p.step.phase.starts_with("search 2");
  });
  EXPECT_TRUE(stopped.stopped);
  EXPECT_EQ(stopped.searches.size(), 1u) << "one that was stopped ended nowhere";
}

TEST_F(LinearizeTest, AFitStopsWhenToldTo) {
  int seen = 0;
  const FitResult result = run_least_squares_fit(problem(), small_fit(), nullptr,
                                                 [&](const FitProgress&) { return ++seen < 7; });
  EXPECT_TRUE(result.stopped);
  EXPECT_LE(seen, 8);
  EXPECT_EQ(result.final.error, evaluate(problem(), result.fabric).error);
}

TEST_F(LinearizeTest, AFitThatIsStoppedBeforeItsLastDescentStartedAtTheMiddle) {
  const FitResult result =
      run_least_squares_fit(problem(), small_fit(), nullptr,
                            [](const FitProgress& p) { return p.step.phase != "all frames"; });
  EXPECT_TRUE(result.stopped);
  EXPECT_GT(result.start.error, 0);
  EXPECT_EQ(result.start.error, result.initial.error);
  EXPECT_EQ(result.start.error, evaluate(problem(), result.start_fabric).error);
}

TEST_F(LinearizeTest, AFitRejectsBadOptions) {
  for (const auto& spoil : {+[](LeastSquaresFitOptions& o) { o.stages.clear(); },
                            +[](LeastSquaresFitOptions& o) { o.stages[0].survivors = 0; },
                            +[](LeastSquaresFitOptions& o) { o.stages[0].frames = -1; },
                            +[](LeastSquaresFitOptions& o) { o.stages[0].pull = -1; },
                            +[](LeastSquaresFitOptions& o) { o.stages[0].fold_weight = -1; },
                            +[](LeastSquaresFitOptions& o) { o.stages[0].fold_weight = NAN; },
                            +[](LeastSquaresFitOptions& o) { o.stages[1].scattered = -1; },
                            +[](LeastSquaresFitOptions& o) { o.stages[1].scatter = 1.1; },
                            +[](LeastSquaresFitOptions& o) { o.screening_parameters = {"bend"}; },
                            +[](LeastSquaresFitOptions& o) { o.screening_points = -1; },
                            +[](LeastSquaresFitOptions& o) { o.screening_frames = -1; }}) {
    LeastSquaresFitOptions options = small_fit();
    spoil(options);
    EXPECT_THROW(run_least_squares_fit(problem(), options), Error);
  }
  const Problem other({trial_}, true_fabric(), {"bend_stiffness"},
                      [](const Fabric&, int) { return ProblemEvaluation{}; });
  EXPECT_THROW(run_least_squares_fit(other, small_fit()), Error);
}

TEST_F(LinearizeTest, PatchesAddUpToTheirFrame) {
  const ProblemLinearization whole = linearize(problem(), wrong());
  const std::vector<PatchPart> parts = linearize_patches(problem(), wrong());
  ASSERT_EQ(parts.size(), 4u * 16u);
  const std::vector<CostPart> frames = frames_of(parts);
  ASSERT_EQ(frames.size(), whole.parts.size());
  for (std::size_t k = 0; k < frames.size(); ++k) {
    EXPECT_EQ(frames[k].frame, whole.parts[k].frame);
    EXPECT_EQ(frames[k].factor, whole.parts[k].factor);
    EXPECT_LT((frames[k].gradient - whole.parts[k].gradient).norm(),
              1e-9 * whole.parts[k].gradient.norm());
    EXPECT_LT((frames[k].hessian - whole.parts[k].hessian).norm(),
              1e-9 * whole.parts[k].hessian.norm());
  }
  const std::vector<CostPart> patches = patches_of(parts);
  ASSERT_EQ(patches.size(), 16u);
  // The cloth hangs in the picture's middle: no patch alone has it all, several have some.
  int with_cloth = 0;
  for (const CostPart& patch : patches) {
    EXPECT_LT(patch.hessian.norm(), 0.9 * whole.model.hessian.norm());
    with_cloth += patch.hessian.norm() > 0.01 * whole.model.hessian.norm();
  }
  EXPECT_GE(with_cloth, 6);
}

// Past a snap derivatives may overflow: such a frame says nothing, instead of spoiling the others.
TEST_F(LinearizeTest, DerivativesThatAreNotFiniteCountForNothing) {
  LinearizationOptions options;
  options.simulator = [](const Scene& scene, const Fabric& fabric,
                         const std::vector<int>& parameters, const SimulationOptions& how,
                         int threads) {
    TrajectoryWithSensitivities motion =
        simulate_with_sensitivities(scene, fabric, parameters, how, threads);
    motion.sensitivities.x.back().setConstant(std::numeric_limits<double>::infinity());
    return motion;
  };
  const ProblemLinearization found = linearize(problem(), wrong(), options);
  const ProblemLinearization exact = linearize(problem(), wrong());
  EXPECT_EQ(found.parts.back().hessian.norm(), 0);
  EXPECT_EQ(found.parts.front().hessian, exact.parts.front().hessian);
  EXPECT_EQ(found.model.cost, exact.model.cost);
}

LeastSquaresFitOptions fit_from_here() {
  LeastSquaresFitOptions options;
  options.screening_points = 0;
  options.stages = {{0, 1, 8, 3, 1, 0}};
  options.start = FitOptions::Start::initial;
  return options;
}

TEST_F(LinearizeTest, APriorWeighsAsItSaysAgainstTheData) {
  Fabric start = true_fabric();
  start.set("bend_stiffness", 3e-5);
  const auto fit = [&](std::vector<ParameterPrior> priors) {
    return run_least_squares_fit(
        Problem({trial_}, start, {"bend_stiffness"}, {}, std::move(priors)), fit_from_here());
  };
  const FitResult free = fit({}), vague = fit({{"bend_stiffness", 8e-5, 1e5}});
  const FitResult sure = fit({{"bend_stiffness", 8e-5, 1.001}});
  EXPECT_EQ(free.prior_error, 0);
  EXPECT_NEAR(vague.scaled[0], free.scaled[0], 0.005);
  EXPECT_NEAR(sure.fabric.value("bend_stiffness"), 8e-5, 2e-6);
  EXPECT_GT(sure.prior_weight, 0);
  // The error stays that of the data, which the prior has made larger.
  EXPECT_GT(sure.final.error, free.final.error);
  const Problem problem({trial_}, start, {"bend_stiffness"});
  EXPECT_DOUBLE_EQ(sure.final.error, evaluate(problem, sure.fabric).error);
}

// What tells the scatter of the residuals is the picture's parts then.
TEST_F(LinearizeTest, APriorWeighsBesideASingleFrame) {
  Fabric start = true_fabric();
  start.set("bend_stiffness", 3e-5);
  const FitResult sure = run_least_squares_fit(
      Problem({first_}, start, {"bend_stiffness"}, {}, {{"bend_stiffness", 8e-5, 1.001}}),
      fit_from_here());
  EXPECT_NEAR(sure.fabric.value("bend_stiffness"), 8e-5, 2e-6);
  EXPECT_GT(sure.prior_weight, 0);
}

}  // namespace
}  // namespace weft::linearize_trial_test
