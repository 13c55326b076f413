#include "weft/estimate/suggest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/estimate/synthetic.h"

namespace weft::suggest_test {
namespace {

using ::testing::HasSubstr;
using Axis = CandidateExperiment::Axis;

Capture small_rig() {
  LayoutOptions layout;
  layout.width = layout.height = 0.3;
  layout.image_width = 96;
  layout.image_height = 72;
  layout.stripe_period = 0.03;
  layout.frame_count = layout.fit_frames = 2;
  return make_layout(layout);
}

SuggestOptions small_options() {
  SuggestOptions options;
  options.trial.columns = options.trial.rows = 9;
  options.trial.angle_map.kernel_radius = 3;
  options.trial.angle_map.blur_sigma = 1.5;
  options.trial.simulation.steps_per_frame = 2;
  return options;
}

Fabric fabric() {
  Fabric fabric = Fabric::with_defaults("known");
  fabric.set("bend_stiffness", 5e-5);
  return fabric;
}

const ExpectedInterval& interval(const Suggestion& s, const std::string& name) {
  for (const ExpectedInterval& p : s.parameters)
    if (p.name == name) return p;
  throw Error("no " + name);
}

TEST(Suggest, ClipsAreWhereTheExperimentSays) {
  const Capture rig = small_rig();
  const double turn = 0.25 / 2.0;  // s, a quarter of the second period at 2 Hz, after 0.5 s
  for (const auto& [axis, direction] :
       {std::pair{Axis::across, Vec3(0, 1, 0)}, std::pair{Axis::along, Vec3(1, 0, 0)},
        std::pair{Axis::up, Vec3(0, 0, 1)}}) {
    const Capture made = experiment_capture(rig, {"e", 0.8, axis, 0.03, 2, 40});
    const Vec3 left = made.fixtures[0].motion.position(1),
               right = made.fixtures[1].motion.position(0);
    EXPECT_NEAR((right - left).norm(), 0.8 * 0.3, 1e-12);
    EXPECT_LT((0.5 * (left + right) - Vec3(0, 0, 1)).norm(), 1e-9);  // the layout's middle
    EXPECT_EQ(made.fit_last, 39);
    // The spline through 8 samples a period is within 1 % of the amplitude.
    const Vec3 moved = made.fixtures[1].motion.position(0.5 + turn) - right;
    EXPECT_LT((moved - 0.03 * direction).norm(), 0.0003) << name_of(axis);
    EXPECT_LT(made.fixtures[1].motion.velocity(0).norm(), 0.02);
  }
}

TEST(Suggest, ImpossibleExperimentsAreRefused) {
  const Capture rig = small_rig();
  const auto message = [&](const CandidateExperiment& e, const Capture& like) -> std::string {
    try {
      experiment_capture(like, e);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message({"far", 1, Axis::along, 0.05, 1, 9}, rig), HasSubstr("\"far\""));
  // The moved clip would go through the other one.
  EXPECT_THAT(message({"through", 0.3, Axis::along, 0.1, 1, 9}, rig), HasSubstr("or pass"));
  EXPECT_EQ(message({"near", 0.6, Axis::along, 0.02, 1, 9}, rig), "");
  EXPECT_THAT(message({"e", 1.2, Axis::up, 0.05, 1, 9}, rig), HasSubstr("separation = 1.2"));
  EXPECT_THAT(message({"e", 0.5, Axis::up, NAN, 1, 9}, rig), HasSubstr("amplitude = nan"));
  EXPECT_THAT(message({"e", 0.5, Axis::up, 0.1, 0, 9}, rig), HasSubstr("frequency"));
  EXPECT_THAT(message({"e", 0.5, Axis::up, 0.1, 1, 0}, rig), HasSubstr("frames"));
  Capture one = rig;
  one.fixtures.pop_back();
  EXPECT_THAT(message({"e", 0.5, Axis::up, 0.1, 1, 9}, one), HasSubstr("1 fixtures"));
}

TEST(Suggest, AFamilyHasEachCombinationOnce) {
  CandidateFamily family;
  family.separations = {0.6, 0.8};
  family.amplitudes = {0, 0.02, 0.04};
  family.frequencies = {1, 2, 3};
  family.axes = {Axis::across, Axis::up};
  family.frames = {10};
  const auto candidates = make_candidates(family);
  EXPECT_EQ(candidates.size(), 2u * (1 + 2 * 3 * 2));
  EXPECT_THAT(name_of(candidates[0]), HasSubstr("still"));
}

TEST(Suggest, AFileOfCandidatesIsReadStrictly) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "experiments.toml";
  const std::string head = "format = \"weft-experiments\"\nversion = 1\n";
  const auto read = [&](const std::string& text) {
    std::ofstream(path) << head << text;
    return read_candidates(path);
  };
  const auto message = [&](const std::string& text) -> std::string {
    try {
      read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  const auto found = read(
      "[[experiment]]\nseparation = 0.7\namplitude = 0.05\naxis = \"up\"\nfrequency = 3\n"
      "frames = 12\n[[experiment]]\nname = \"hang\"\nseparation = 0.9\namplitude = 0\n");
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(std::get<CandidateExperiment>(found[0]).axis, Axis::up);
  EXPECT_EQ(std::get<CandidateExperiment>(found[0]).frames, 12);
  EXPECT_EQ(name_of(found[1]), "hang");
  EXPECT_THAT(message(""), HasSubstr("no [[experiment]]"));
  EXPECT_THAT(message("[[experiment]]\nseparation = 2\namplitude = 0\n"),
              ::testing::AllOf(HasSubstr("experiments.toml:4"), HasSubstr("separation")));
  EXPECT_THAT(message("[[experiment]]\nseparation = 0.5\namplitud = 0\n"), HasSubstr("amplitude"));
  EXPECT_THAT(message("[[experiment]]\nseparation = 0.5\namplitude = 0\naxis = \"left\"\n"),
              HasSubstr("axis"));
}

TEST(Suggest, AStillSwatchTellsNothingOfDampingAndDrag) {
  const std::vector<Candidate> candidates{
      CandidateExperiment{"hang", 0.8, Axis::across, 0, 1, 4},
      CandidateExperiment{"wave", 0.8, Axis::across, 0.05, 3, 6}};
  SuggestOptions options = small_options();
  options.targets = {"drag_quadratic"};
  options.noise = 1e-3;  // a short motion: little noise lets it show
  const auto ranked = suggest_experiments(small_rig(), fabric(), candidates, options);
  ASSERT_EQ(ranked.size(), 2u);
  EXPECT_EQ(name_of(ranked[0].experiment), "wave");
  EXPECT_LT(ranked[0].remaining, 0.95);
  for (const char* name : {"drag_linear", "drag_quadratic", "bend_damping"}) {
    const ExpectedInterval& p = interval(ranked[1], name);
    // Of a uniform distribution over the range.
    EXPECT_NEAR(p.before, 1.645 / std::sqrt(12.0), 1e-3) << name;
    EXPECT_NEAR(p.after, p.before, 1e-6 * p.before) << name;
  }
  const ExpectedInterval& bend = interval(ranked[1], "bend_stiffness");
  EXPECT_LT(bend.after, 0.9 * bend.before);
  EXPECT_LT(bend.lower, bend.value);
  EXPECT_GT(bend.upper, bend.value);
}

TEST(Suggest, InformationGrowsWithSamplesAndFallsWithNoise) {
  const std::vector<Candidate> candidates{
      CandidateExperiment{"hang", 0.8, Axis::across, 0, 1, 2},
      CandidateExperiment{"longer", 0.8, Axis::across, 0, 1, 4}};
  SuggestOptions options = small_options();
  options.noise = 1;
  const auto found = suggest_experiments(small_rig(), fabric(), candidates, options);
  // More frames of one shape say nothing more: they differ by what settling leaves.
  EXPECT_LT((found[0].information - found[1].information).norm(),
            1e-3 * found[0].information.norm());
  options.noise = 4;
  const auto noisy = suggest_experiments(small_rig(), fabric(), {candidates[0]}, options);
  const MatX& plain =
      name_of(found[0].experiment) == "hang" ? found[0].information : found[1].information;
  EXPECT_LT((4 * noisy[0].information - plain).norm(), 1e-9 * plain.norm());

  // What is known well already does not shrink.
  options.known = 1e9 * MatX::Identity(9, 9);
  EXPECT_GT(suggest_experiments(small_rig(), fabric(), {candidates[0]}, options)[0].remaining,
            0.99);
  options.known = MatX::Identity(2, 2);
  EXPECT_THROW(suggest_experiments(small_rig(), fabric(), candidates, options), Error);
  options = small_options();
  options.targets = {"bend"};
  EXPECT_THROW(suggest_experiments(small_rig(), fabric(), candidates, options), Error);
}

TEST(Suggest, AStripTellsTheStretchAlongItsPull) {
  Fabric known = Fabric::with_defaults("known", "stvk");
  SuggestOptions options = small_options();
  options.mechanical.cells = 4;
  options.targets = {"membrane_uu"};
  const std::vector<CandidateTest> tests = default_tests();
  const auto ranked = suggest_experiments(
      small_rig(), known,
      {CandidateExperiment{"hang", 0.8, Axis::across, 0, 1, 2}, tests[1], tests[0]}, options);
  ASSERT_EQ(ranked.size(), 3u);
  EXPECT_EQ(name_of(ranked[0].experiment), "strip along the weft");
  EXPECT_LT(ranked[0].remaining, 0.1);
  EXPECT_EQ(name_of(ranked[1].experiment), "strip along the warp");
  EXPECT_GT(ranked[1].remaining, 0.9);
  EXPECT_THAT(ranked[2].failure, HasSubstr("is of model \"stvk\""));
  EXPECT_EQ(ranked[2].remaining, 1);

  known.set("membrane_uv", 1e-4);
  const auto alone = suggest_experiments(small_rig(), known, {tests[0]}, options);
  const Eigen::Index i = known.value_index("membrane_uu");
  const double deviation = 1 / std::sqrt(12 + alone[0].information(i, i));
  EXPECT_NEAR(interval(alone[0], "membrane_uu").after, 1.645 * deviation, 1e-3 * deviation);
}

TEST(Suggest, CandidatesAreWhatTheModelCanSimulate) {
  const auto videos = default_candidates(Fabric::with_defaults("f"));
  EXPECT_TRUE(std::holds_alternative<CandidateExperiment>(videos.front()));
  for (const char* model : {"stvk", "stvk-diagonal", "soft-constraints", "springs"}) {
    const auto tests = default_candidates(Fabric::with_defaults("f", model));
    ASSERT_EQ(tests.size(), 6u) << model;
    for (const Candidate& test : tests) EXPECT_TRUE(std::holds_alternative<CandidateTest>(test));
  }
}

}  // namespace
}  // namespace weft::suggest_test
