#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/estimate/choose_start.h"
#include "weft/estimate/cross.h"
#include "weft/estimate/evaluate_capture.h"
#include "weft/estimate/fit.h"
#include "weft/estimate/least_squares_fit.h"
#include "weft/estimate/problem.h"
#include "weft/estimate/stored_search.h"
#include "weft/estimate/synthetic.h"
#include "weft/mesh/mesh_io.h"
#include "weft/registration/stripe_surface.h"

namespace weft::trial_test {
namespace {

/// A small swatch, a small image, a few frames: 17 x 17 vertices as truth, 13 x 13 to fit.
LayoutOptions small_layout() {
  LayoutOptions layout;
  layout.width = layout.height = 0.3;
  layout.image_width = 160;
  layout.image_height = 120;
  layout.stripe_period = 0.022;
  layout.frame_count = 5;
  layout.fit_frames = 3;
  layout.wave_frequency = 3;
  return layout;
}

TrialOptions small_trial() {
  TrialOptions options;
  options.columns = options.rows = 13;
  options.angle_map.kernel_radius = 4;
  options.angle_map.blur_sigma = 2;
  options.simulation.steps_per_frame = 2;
  return options;
}

Fabric test_fabric() {
  Fabric fabric = Fabric::with_defaults("test");
  fabric.set("bend_stiffness", 2e-5);
  fabric.set("stretch_stiffness", 100);
  fabric.set("shear_stiffness", 60);
  return fabric;
}

/// Made once for all tests of this program.
class TrialTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<test::TemporaryFolder>();
    root_ = folder_->path();
    SyntheticOptions options;
    options.columns = options.rows = 17;
    options.simulation.steps_per_frame = 4;
    capture_ = std::make_unique<Capture>(make_synthetic_capture(
        root_ / "swatch", make_layout(small_layout()), test_fabric(), options));
    trial_ = prepare_trial(*capture_, 0, 4, small_trial());
    first_ = prepare_trial(*capture_, 0, 0, small_trial());
  }
  static void TearDownTestSuite() {
    trial_.reset();
    first_.reset();
    capture_.reset();
    folder_.reset();
  }

  static inline std::unique_ptr<test::TemporaryFolder> folder_;
  static inline std::filesystem::path root_;
  static inline std::unique_ptr<Capture> capture_;
  static inline std::shared_ptr<const Trial> trial_;  ///< all frames
  static inline std::shared_ptr<const Trial> first_;  ///< the first frame alone
};

void expect_same_error(const TrialEvaluation& a, const TrialEvaluation& b) {
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    EXPECT_EQ(a.frames[i].fold, b.frames[i].fold);
    EXPECT_EQ(a.frames[i].silhouette, b.frames[i].silhouette);
  }
  EXPECT_EQ(a.error, b.error);
}

TEST_F(TrialTest, SyntheticCaptureReadsBackAsItWasLaidOut) {
  const LayoutOptions layout = small_layout();
  EXPECT_EQ(capture_->frame_count, 5);
  EXPECT_EQ(capture_->fit_last, 2);
  EXPECT_EQ(capture_->rig.width, 160);
  ASSERT_EQ(capture_->fixtures.size(), 2u);
  const double separation =
      (capture_->fixtures[1].motion.position(0) - capture_->fixtures[0].motion.position(0)).norm();
  EXPECT_NEAR(separation, 0.75 * layout.width, 1e-6);
  ASSERT_TRUE(capture_->truth);
  const TruthSurface truth = read_truth(*capture_);
  EXPECT_EQ(truth.mesh.vertex_count(), 289);
  EXPECT_EQ(truth.frames.size(), 5u);
  // The right corner moves away from rest with no velocity.
  const Motion& right = capture_->fixtures[1].motion;
  EXPECT_LT((right.position(1e-3) - right.position(0)).norm(), 1e-4);
  EXPECT_GT((right.position(4 / 30.0) - right.position(0)).norm(), 5e-3);
}

TEST_F(TrialTest, HasFeaturesOfEachFrame) {
  ASSERT_EQ(trial_->frame_count(), 5);
  EXPECT_EQ(trial_->start_name, "measured surface") << trial_->start_note;
  EXPECT_EQ(trial_->scene.start.cols(), 169);
  EXPECT_TRUE(trial_->scene.start.allFinite());
  for (const FrameFeatures& f : trial_->features) {
    EXPECT_GT((f.silhouette != 0).count(), 2000);
    EXPECT_GT((f.fold_mask != 0).count(), 50);
    EXPECT_TRUE((f.fold_mask <= f.angles.valid).all());
    EXPECT_GT(f.phase.size(), 300u);
  }
}

TEST_F(TrialTest, EvaluationAveragesEquationEightOverItsFrames) {
  Trajectory trajectory;
  const TrialEvaluation e = evaluate(*trial_, test_fabric(), 0, &trajectory);
  ASSERT_FALSE(e.diverged) << e.divergence;
  ASSERT_EQ(e.frames.size(), 5u);
  EXPECT_EQ(trajectory.frames.size(), 5u);
  double total = 0, masked = 0;
  for (const FrameError& frame : e.frames) {
    total += frame.fold + 0.1 * frame.silhouette;
    masked += frame.mask_pixels;
  }
  EXPECT_NEAR(e.error, total / 5, 1e-9 * total);
  EXPECT_NEAR(e.error_per_mask_pixel, total / masked, 1e-9);
}

TEST_F(TrialTest, EvaluationIsPureAndTheSameForAnyThreads) {
  const TrialEvaluation one = evaluate(*trial_, test_fabric(), 0, nullptr, 1);
  expect_same_error(one, evaluate(*trial_, test_fabric(), 0, nullptr, 3));
  expect_same_error(one, evaluate(*trial_, test_fabric(), 0, nullptr, 1));
}

TEST_F(TrialTest, FirstFramesAreThoseOfTheWholeEvaluation) {
  const TrialEvaluation all = evaluate(*trial_, test_fabric());
  const TrialEvaluation two = evaluate(*trial_, test_fabric(), 2);
  ASSERT_EQ(two.frames.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(two.frames[i].fold, all.frames[i].fold);
}

TEST_F(TrialTest, LaterFramesAreSimulatedFromTheHangOfFrameZero) {
  const auto later = prepare_trial(*capture_, 2, 4, small_trial());
  EXPECT_EQ(later->frame_count(), 3);
  EXPECT_EQ(later->first_frame, 2);
  EXPECT_EQ(later->scene.start, trial_->scene.start);
  const TrialEvaluation all = evaluate(*trial_, test_fabric());
  const TrialEvaluation part = evaluate(*later, test_fabric());
  ASSERT_EQ(part.frames.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(part.frames[i].fold, all.frames[i + 2].fold);
}

TEST_F(TrialTest, TheTrueFabricFitsBetterThanOthers) {
  const double right = evaluate(*trial_, test_fabric()).error;
  Fabric stiff = test_fabric(), soft = test_fabric();
  stiff.set("bend_stiffness", 8e-4);
  soft.set("stretch_stiffness", 12);
  EXPECT_LT(right, 0.7 * evaluate(*trial_, stiff).error);
  EXPECT_LT(right, 0.7 * evaluate(*trial_, soft).error);
}

// Without contrast between the stripes nothing can be triangulated.
TEST_F(TrialTest, WithoutStripesAGenericStartIsChosenAndNamed) {
  Trajectory trajectory;
  evaluate(*first_, test_fabric(), 1, &trajectory);
  Rig rig = capture_->rig;
  rig.pattern.black_level = 1;
  Renderer renderer(rig, first_->scene.mesh);
  LayoutOptions layout = small_layout();
  layout.frame_count = layout.fit_frames = 1;
  CaptureFiles files;
  files.frames = {renderer.render(trajectory.frames[0]).intensity};
  files.as_images = true;
  write_capture(root_ / "unstriped", make_layout(layout), files);
  const Capture capture = read_capture(root_ / "unstriped");
  TrialOptions trial_options = small_trial();
  trial_options.columns = trial_options.rows = 9;
  const auto trial = prepare_trial(capture, 0, 0, trial_options);
  EXPECT_FALSE(trial->start_note.empty());
  std::vector<std::string> names;
  for (const StartShape& start : generic_starts(trial->scene)) names.push_back(start.name);
  const auto chosen = std::find(names.begin(), names.end(), trial->start_name);
  ASSERT_NE(chosen, names.end()) << trial->start_name;
  const auto index = static_cast<std::size_t>(chosen - names.begin());
  EXPECT_EQ(trial->scene.start, generic_starts(trial->scene)[index].x);
  // No other start looks more like the frame.
  const double error = evaluate(*trial, Fabric::with_defaults("default")).error;
  for (const StartShape& start : generic_starts(trial->scene)) {
    Trial other = *trial;
    other.scene.start = start.x;
    EXPECT_LE(error, evaluate(other, Fabric::with_defaults("default")).error) << start.name;
  }
}

TEST_F(TrialTest, StartsFromTheSurfaceThatTheCaptureStates) {
  Capture capture = *capture_;
  const TruthSurface truth = read_truth(capture);
  capture.start_surface = root_ / "start.obj";
  write_obj(*capture.start_surface, truth.mesh, truth.frames[0]);
  const auto cache = root_ / "start-cache";
  const auto trial = prepare_trial(capture, 0, 0, small_trial(), 1, cache);
  EXPECT_EQ(trial->start_name, "measured surface");
  EXPECT_LT(distance_to_truth(trial->scene.mesh, trial->scene.start, truth, 0).mean, 5e-4);
  // Another surface under the same name is another trial.
  const Vec3 away(0, 0.01, 0);
  write_obj(*capture.start_surface, truth.mesh, truth.frames[0].colwise() + away);
  const auto moved = prepare_trial(capture, 0, 0, small_trial(), 1, cache);
  EXPECT_LT((moved->scene.start - (trial->scene.start.colwise() + away)).cwiseAbs().maxCoeff(),
            1e-6);
}

/// It begins with the generic start that settles furthest from what the frames show; the measured
/// one is among the others.
std::shared_ptr<const Trial> with_the_worst_start(const Trial& trial) {
  auto spoilt = std::make_shared<Trial>(trial);
  spoilt->other_starts = {trial.scene.start};
  double worst = 0;
  for (const StartShape& start : generic_starts(trial.scene)) {
    Trial other = trial;
    other.scene.start = start.x;
    const double error = evaluate(other, test_fabric(), 3).error;
    if (!(error > worst) || !std::isfinite(error)) continue;
    worst = error;
    spoilt->scene.start = start.x;
  }
  return spoilt;
}

TEST_F(TrialTest, TakesTheStartThatSuitsTheFabric) {
  const auto given = with_the_worst_start(*trial_);
  const double measured = evaluate(*trial_, test_fabric(), 3).error;
  ASSERT_GT(evaluate(*given, test_fabric(), 3).error, 1.5 * measured);
  const auto chosen = with_start_for(given, test_fabric());
  EXPECT_LT(evaluate(*chosen, test_fabric(), 3).error, 1.1 * measured);
  // Nothing is lost, and nothing else is left to choose.
  EXPECT_EQ(chosen->other_starts.back(), given->scene.start);
  EXPECT_EQ(with_start_for(chosen, test_fabric()), chosen);
  EXPECT_EQ(with_start_for(given, test_fabric(), 0, 1)->scene.start, chosen->scene.start);
  EXPECT_EQ(with_start_of(*chosen, given)->scene.start, chosen->scene.start);
}

TEST_F(TrialTest, AStartThatHasSettledIsCheaperAndLeadsToTheSameShape) {
  const std::shared_ptr<const Trial> given = with_the_worst_start(*trial_);
  const auto settled = with_settled_starts({given}, test_fabric()).front();
  Trajectory from_given, from_settled, stiffer_from_given, stiffer_from_settled;
  evaluate(*given, test_fabric(), 1, &from_given);
  evaluate(*settled, test_fabric(), 1, &from_settled);
  // Two of Newton's last steps apart at most: their forces are below 1e-7 N.
  EXPECT_LT((from_settled.frames[0] - from_given.frames[0]).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_EQ(settled->scene.start, from_given.frames[0]);
  Fabric stiffer = test_fabric();
  stiffer.set("bend_stiffness", 2.2e-5);
  evaluate(*given, stiffer, 1, &stiffer_from_given);
  evaluate(*settled, stiffer, 1, &stiffer_from_settled);
  EXPECT_LT(2 * stiffer_from_settled.factorizations, stiffer_from_given.factorizations);
  // One that the capture states is no choice of ours.
  auto stated = std::make_shared<Trial>(*given);
  stated->other_starts.clear();
  EXPECT_EQ(with_settled_starts({stated}, test_fabric()).front(), stated);
}

LeastSquaresFitOptions from_the_initial_fabric(const std::vector<FitStage>& stages) {
  LeastSquaresFitOptions options;
  options.start = FitOptions::Start::initial;
  options.screening_points = 0;
  options.stages = stages;
  return options;
}

TEST_F(TrialTest, AFitFindsFabricAndStartTogether) {
  const auto given = with_the_worst_start(*trial_);
  const Problem problem({given}, test_fabric(), {"bend_stiffness"});
  const LeastSquaresFitOptions options = from_the_initial_fabric({{0, 1, 1, 3, 1, 0.05}});
  const FitResult found = run_least_squares_fit(problem, options);
  ASSERT_EQ(found.compared.size(), 1u);
  EXPECT_NE(found.compared.front()->scene.start, given->scene.start);
  EXPECT_LT(found.final.error, 1.1 * evaluate(*trial_, test_fabric()).error_per_mask_pixel);
  // What it says, it says of that start.
  const Problem compared = problem.with_trials(found.compared);
  EXPECT_EQ(found.final.error, evaluate(compared, found.fabric).error);
  const Fabric middle = problem.fabric(VecX::Constant(1, 0.5));
  EXPECT_EQ(found.initial.error, evaluate(compared, middle).error);
  EXPECT_EQ(found.history.size(), found.evaluations);
}

TEST_F(TrialTest, AFitFromItsStoreIsTheSameAndAsksForNothing) {
  const auto given = with_the_worst_start(*trial_);
  const Problem problem({given}, test_fabric(), {"bend_stiffness"});
  LeastSquaresFitOptions options =
      from_the_initial_fabric({{2, 1, 1, 3, 1, 0.05}, {0, 1, 1, 3, 1, 0.05}});
  options.hops.rounds = 1;
  const test::TemporaryFolder folder;
  EvaluationStore store(folder.path() / "evaluations.sqlite");
  const FitResult first = run_least_squares_fit(problem, options, &store);
  ASSERT_NE(first.compared.front()->scene.start, given->scene.start);
  std::size_t told = 0;
  const FitResult again =
      run_least_squares_fit(problem, options, &store, [&](const FitProgress& progress) {
        if (progress.step.phase != "starts") {
          EXPECT_GT(progress.replayed, told);
        }
        EXPECT_EQ(progress.part == "round 1 of at most 1", progress.step.phase == "hops");
        told = progress.replayed;
        return true;
      });
  EXPECT_EQ(again.replayed, again.evaluations);
  EXPECT_EQ(told, again.replayed);
  EXPECT_EQ(again.evaluations, first.evaluations);
  EXPECT_EQ(again.scaled, first.scaled);
  EXPECT_EQ(again.final.error, first.final.error);
  EXPECT_EQ(again.compared.front()->scene.start, first.compared.front()->scene.start);
  EXPECT_EQ(again.compared.front()->other_starts, first.compared.front()->other_starts);

  // Another loss, or another choice of starts, is another question.
  const VecX middle = VecX::Constant(1, 0.5);
  LinearizationOptions linearization;
  EXPECT_FALSE(evaluate_cost_stored(problem, middle, linearization, &store).replayed);
  EXPECT_TRUE(evaluate_cost_stored(problem, middle, linearization, &store).replayed);
  linearization.residual.fold_scale = 0.5;
  const StoredCost other = evaluate_cost_stored(problem, middle, linearization, &store);
  EXPECT_FALSE(other.replayed);
  EXPECT_EQ(other.cost, evaluate_cost(problem, middle, linearization).cost);
  // Derivatives are by parts of the ranges.
  Fabric narrow = test_fabric();
  narrow.lower = narrow.upper = narrow.values;
  for (int i = 0; i < narrow.values.size(); ++i) {
    narrow.lower[i] = test_fabric().info(i).lower;
    narrow.upper[i] = test_fabric().info(i).upper;
  }
  narrow.upper[narrow.value_index("bend_stiffness")] /= 2;
  const Problem in_narrow({given}, narrow, {"bend_stiffness"});
  const VecX least = VecX::Zero(1);  // the same value in both
  ASSERT_EQ(in_narrow.fabric(least).values, problem.fabric(least).values);
  linearize_stored(problem, least, linearization, &store);
  EXPECT_TRUE(linearize_stored(problem, least, linearization, &store).replayed);
  EXPECT_FALSE(linearize_stored(in_narrow, least, linearization, &store).replayed);
  const auto suited = with_starts_for_stored(problem, test_fabric(), 0, 0, &store);
  ASSERT_NE(suited.front(), given);
  EXPECT_EQ(with_starts_for_stored(problem, test_fabric(), 0, 0, &store).front()->scene.start,
            suited.front()->scene.start);
  auto stated = std::make_shared<Trial>(*given);
  stated->other_starts.clear();
  const Problem without_choice({stated}, test_fabric(), {"bend_stiffness"});
  EXPECT_EQ(with_starts_for_stored(without_choice, test_fabric(), 0, 0, &store).front(), stated);
}

TEST_F(TrialTest, ASearchForStartsThatIsStoppedLeavesThemAndIsNotStored) {
  const auto given = with_the_worst_start(*trial_);
  const Problem problem({given}, test_fabric(), {"bend_stiffness"});
  const test::TemporaryFolder folder;
  EvaluationStore store(folder.path() / "evaluations.sqlite");
  int told = 0;
  const StartObserver stop = [&told] { return ++told < 2; };
  EXPECT_EQ(with_starts_for_stored(problem, test_fabric(), 0, 0, &store, stop).front(), given);
  EXPECT_EQ(told, 2);
  EXPECT_NE(with_starts_for_stored(problem, test_fabric(), 0, 0, &store).front(), given);
}

TEST_F(TrialTest, AStartThatTheCaptureStatesStays) {
  Trial stated = *trial_;
  stated.other_starts.clear();
  const auto given = std::make_shared<const Trial>(stated);
  EXPECT_EQ(with_start_for(given, test_fabric()), given);
}

TEST_F(TrialTest, CacheGivesTheSameTrial) {
  const auto cache = root_ / "cache";
  const auto fresh = prepare_trial(*capture_, 0, 4, small_trial(), 0, cache);
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(cache)) files.push_back(entry);
  ASSERT_EQ(files.size(), 1u);
  const auto written = std::filesystem::last_write_time(files[0]);
  const auto cached = prepare_trial(*capture_, 0, 4, small_trial(), 0, cache);
  EXPECT_EQ(std::filesystem::last_write_time(files[0]), written);
  EXPECT_EQ(cached->start_name, trial_->start_name);
  EXPECT_EQ(cached->other_starts, trial_->other_starts);
  const auto fingerprint = [](const std::shared_ptr<const Trial>& trial) {
    return Problem({trial}, Fabric::with_defaults("x"), {"bend_stiffness"}).fingerprint();
  };
  EXPECT_EQ(fingerprint(fresh), fingerprint(trial_));
  EXPECT_EQ(fingerprint(cached), fingerprint(trial_));
  const auto same = [](const PhaseSample& a, const PhaseSample& b) {
    return a.column == b.column && a.y == b.y && a.phase == b.phase;
  };
  for (std::size_t k = 0; k < cached->features.size(); ++k)
    EXPECT_TRUE(std::ranges::equal(cached->features[k].phase, trial_->features[k].phase, same));
}

TEST_F(TrialTest, CacheMakesDamagedFilesAgainAndKeepsOptionsApart) {
  const auto cache = root_ / "cache-damaged";
  prepare_trial(*capture_, 0, 1, small_trial(), 0, cache);
  const std::filesystem::path file = *std::filesystem::directory_iterator(cache);
  const auto size = std::filesystem::file_size(file);
  {
    std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
    stream.seekp(static_cast<std::streamoff>(size / 2));
    stream.put('\x55').put('\x2a').put('\x55');
  }
  const auto again = prepare_trial(*capture_, 0, 1, small_trial(), 0, cache);
  for (int i = 0; i < 2; ++i) {
    const auto k = static_cast<std::size_t>(i);
    EXPECT_TRUE((again->features[k].angles.angle == trial_->features[k].angles.angle).all());
  }
  std::filesystem::resize_file(file, size / 3);
  EXPECT_EQ(prepare_trial(*capture_, 0, 1, small_trial(), 0, cache)->frame_count(), 2);
  EXPECT_EQ(std::filesystem::file_size(file), size);

  TrialOptions other = small_trial();
  other.angle_map.mask_threshold *= 2;
  prepare_trial(*capture_, 0, 1, other, 0, cache);
  prepare_trial(*capture_, 0, 0, small_trial(), 0, cache);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(cache), {}), 3);
}

TEST_F(TrialTest, RejectsBadArguments) {
  EXPECT_THROW(prepare_trial(*capture_, 0, 5, small_trial()), Error);
  EXPECT_THROW(prepare_trial(*capture_, -1, 2, small_trial()), Error);
  EXPECT_THROW(prepare_trial(*capture_, 2, 1, small_trial()), Error);
  TrialOptions options = small_trial();
  options.columns = 1;
  EXPECT_THROW(prepare_trial(*capture_, 0, 1, options), Error);
  options = small_trial();
  options.alpha = -1;
  EXPECT_THROW(prepare_trial(*capture_, 0, 1, options), Error);
  std::ofstream(root_ / "a file") << "x";
  EXPECT_THROW(prepare_trial(*capture_, 0, 0, small_trial(), 0, root_ / "a file" / "cache"), Error);
}

TEST_F(TrialTest, ADivergedSimulationIsAnInfiniteErrorAndNoException) {
  auto broken = std::make_shared<Trial>(*trial_);
  // Explicit integration within ten evaluations of the forces cannot reach the second frame.
  broken->options.simulation.integrator = Integrator::runge_kutta;
  broken->options.simulation.max_force_evaluations = 10;
  const TrialEvaluation e = evaluate(*broken, test_fabric());
  EXPECT_TRUE(e.diverged);
  EXPECT_FALSE(e.divergence.empty());
  EXPECT_EQ(e.error, std::numeric_limits<double>::infinity());
  EXPECT_LT(e.frames.size(), 5u);
  const CaptureEvaluation c = evaluate_capture(*broken, test_fabric(), TruthDistance::included);
  EXPECT_TRUE(c.diverged);
  EXPECT_EQ(c.fit.error, std::numeric_limits<double>::infinity());
}

TEST_F(TrialTest, SeveralTrialsWeighTheSame) {
  const Problem problem({trial_, first_}, test_fabric(), {"bend_stiffness"});
  const TrialEvaluation a = evaluate(*trial_, test_fabric());
  const TrialEvaluation b = evaluate(*first_, test_fabric());
  const ProblemEvaluation both = evaluate(problem, test_fabric());
  EXPECT_DOUBLE_EQ(both.error, 0.5 * a.error_per_mask_pixel + 0.5 * b.error_per_mask_pixel);
  EXPECT_DOUBLE_EQ(both.error_per_frame, 0.5 * a.error + 0.5 * b.error);
}

TEST_F(TrialTest, CaptureEvaluationSplitsFitAndValidation) {
  const CaptureEvaluation e = evaluate_capture(*trial_, test_fabric(), TruthDistance::left_out);
  ASSERT_EQ(e.frames.size(), 5u);
  ASSERT_TRUE(e.validation);
  EXPECT_EQ(e.fit.last, 2);
  EXPECT_EQ(e.validation->first, 3);
  EXPECT_NEAR(e.fit.error, (e.frames[0].total + e.frames[1].total + e.frames[2].total) / 3, 1e-9);
  EXPECT_NEAR(e.validation->fold, (e.frames[3].error.fold + e.frames[4].error.fold) / 2, 1e-9);
  EXPECT_FALSE(e.fit.distance);
  EXPECT_FALSE(e.frames[0].distance);
  Trial fit_only = *trial_;
  fit_only.features.resize(3);
  EXPECT_FALSE(evaluate_capture(fit_only, test_fabric(), TruthDistance::left_out).validation);
  EXPECT_THROW(evaluate_capture(*first_, test_fabric(), TruthDistance::left_out), Error);
}

TEST_F(TrialTest, DistanceToTheTruthIsMeasuredOnlyWhenAskedFor) {
  const CaptureEvaluation e = evaluate_capture(*trial_, test_fabric(), TruthDistance::included);
  ASSERT_TRUE(e.fit.distance && e.validation->distance);
  const SurfaceDistance& fit = *e.fit.distance;
  EXPECT_GT(fit.mean, 0);
  EXPECT_LE(fit.mean, fit.rms);
  EXPECT_LE(fit.rms, fit.max);
  // The same fabric on a coarser mesh: within a few percent of the swatch's 0.3 m.
  EXPECT_LT(fit.mean, 0.015);
  double mean = 0;
  for (int i = 0; i < 3; ++i) mean += e.frames[static_cast<std::size_t>(i)].distance->mean / 3;
  EXPECT_NEAR(fit.mean, mean, 1e-12);
}

TEST_F(TrialTest, FittingWorksWithoutTheTruthFiles) {
  const auto copy = root_ / "without-truth";
  std::filesystem::copy(root_ / "swatch", copy, std::filesystem::copy_options::recursive);
  Capture capture = read_capture(copy);
  ASSERT_TRUE(capture.truth);
  std::filesystem::remove(capture.truth->points);
  std::filesystem::remove(capture.truth->rest_mesh);
  const auto trial = prepare_trial(capture, 0, 2, small_trial());
  const Problem problem({trial}, test_fabric(), {"bend_stiffness", "stretch_stiffness"});
  FitOptions options;
  options.coarse_levels = 2;
  options.annealing.max_evaluations = 4;
  options.with_variability = false;
  EXPECT_NO_THROW(run_fit(problem, options));
}

TEST_F(TrialTest, AFitRecoversBendFromAnotherMesh) {
  Fabric wrong = test_fabric();
  wrong.set("bend_stiffness", 3 * 2e-5);
  const Problem problem({trial_}, wrong, {"bend_stiffness"});
  FitOptions options;
  options.coarse_parameters.clear();
  options.start = FitOptions::Start::initial;
  options.annealing.max_evaluations = 25;
  options.with_variability = false;
  const FitResult result = run_fit(problem, options);
  EXPECT_LT(result.final.error, result.start.error);
  // From 200 % off to within 40 %: 8 quads a side, 160 x 120 px.
  EXPECT_LT(std::abs(std::log(result.fabric.value("bend_stiffness") / 2e-5)), std::log(1.4));
  ASSERT_EQ(result.trials.size(), 1u);
  EXPECT_EQ(result.trials[0].frames.size(), 5u);
}

TEST_F(TrialTest, CrossEvaluationIsTheErrorOfEachPair) {
  Fabric stiff = test_fabric();
  stiff.set("bend_stiffness", 8e-4);
  const CrossEvaluation cross = cross_evaluate({test_fabric(), stiff}, {trial_, first_}, 2);
  ASSERT_EQ(cross.error.rows(), 2);
  ASSERT_EQ(cross.error.cols(), 2);
  EXPECT_EQ(cross.error(1, 0), evaluate(*trial_, stiff).error);
  EXPECT_EQ(cross.error(0, 1), evaluate(*first_, test_fabric()).error);
  EXPECT_LT(cross.error(0, 0), cross.error(1, 0));
  ASSERT_EQ(cross.evaluations.size(), 4u);
  EXPECT_EQ(cross.evaluations[2].error, cross.error(1, 0));
}

TEST_F(TrialTest, OfTwoFitsTheOneWithTheSmallerSumIsKept) {
  FitOptions options;
  options.coarse_parameters = {"bend_stiffness"};
  options.annealing.max_evaluations = 5;
  options.with_variability = false;
  const TrialSelection s =
      fit_and_select({first_, trial_}, test_fabric(), {"bend_stiffness"}, options);
  ASSERT_EQ(s.fits.size(), 2u);
  ASSERT_EQ(s.sum.size(), 2);
  EXPECT_NEAR(s.sum[0], s.cross.error(0, 0) + s.cross.error(0, 1), 1e-12);
  EXPECT_EQ(s.selected, s.sum[1] < s.sum[0] ? 1 : 0);
}

}  // namespace
}  // namespace weft::trial_test
