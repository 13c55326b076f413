/// `weft fit` as a process: signals, continuing, threads, ranges.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "apps/program.h"
#include "weft/estimate/synthetic.h"
#include "weft/report/result.h"

namespace weft::fit_test {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// One row of evaluations.sqlite.
struct Row {
  std::string phase;
  json parameters;
  bool diverged = false;
};

std::vector<Row> rows_of(const std::filesystem::path& store) {
  sqlite3* database = nullptr;
  EXPECT_EQ(sqlite3_open_v2(store.c_str(), &database, SQLITE_OPEN_READWRITE, nullptr), SQLITE_OK);
  std::vector<Row> rows;
  const auto add = [](void* to, int, char** cells, char**) {
    static_cast<std::vector<Row>*>(to)->push_back(
        {cells[0], json::parse(cells[1]), cells[2] == std::string("1")});
    return 0;
  };
  EXPECT_EQ(sqlite3_exec(database, "SELECT phase, parameters, diverged FROM evaluation ORDER BY id",
                         add, &rows, nullptr),
            SQLITE_OK);
  sqlite3_close(database);
  return rows;
}

/// A capture of three small frames for each test.
class Fit : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    LayoutOptions layout;
    layout.image_width = 160;
    layout.image_height = 120;
    layout.stripe_period = 0.03;
    layout.frame_count = layout.fit_frames = 3;
    layout.wave_frequency = 3;
    SyntheticOptions options;
    options.columns = options.rows = 13;
    options.simulation.steps_per_frame = 4;
    options.with_noise = false;
    make_synthetic_capture(folder_ / "c", make_layout(layout), truth(), options);
  }
  static Fabric truth() { return Fabric::with_defaults("truth"); }
  /// The same, with the model's ranges as its own, to be changed.
  static Fabric truth_with_ranges() {
    Fabric fabric = truth();
    fabric.lower = fabric.upper = fabric.values;
    for (int i = 0; i < fabric.values.size(); ++i) {
      fabric.lower[i] = truth().info(i).lower;
      fabric.upper[i] = truth().info(i).upper;
    }
    return fabric;
  }

  /// On a coarse mesh and in long steps.
  std::vector<std::string> quick_fit(const std::string& out,
                                     const std::vector<std::string>& more) const {
    std::vector<std::string> words{"fit", path("c"),           "--out", path(out), "--grid",
                                   "9",   "--steps-per-frame", "2"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::vector<std::string> fit(const std::string& out, const std::vector<std::string>& more,
                               const std::string& coarse = "bend_stiffness") const {
    std::vector<std::string> annealing{"--method", "annealing",       "--coarse",
                                       coarse,     "--coarse-levels", "2"};
    annealing.insert(annealing.end(), more.begin(), more.end());
    return quick_fit(out, annealing);
  }
  json result(const std::string& out) const {
    return json::parse(text_of(folder_ / out / "result.json"));
  }
  /// What must be the same for two runs of one search.
  static json without_circumstances(json object) {
    for (const char* key : {"wall_s", "created", "command", "threads"}) object.erase(key);
    return object;
  }
};

TEST_F(Fit, StopsOnCtrlCAndContinues) {
  // Far more than there is time for: only the signal ends the search.
  const auto words = fit("out", {"--iterations", "1000000", "--no-variability"});
  ChildProcess child(command(words));
  ASSERT_TRUE(child.wait_for("anneal: 1/")) << child.err();
  child.send(SIGINT);
  child.wait();
  EXPECT_EQ(child.status(), 130) << child.err();
  const json stopped = result("out");
  EXPECT_EQ(stopped["stopped"], true);
  EXPECT_LE(stopped["error"], stopped["error_initial"]);
  EXPECT_THAT(stopped["warnings"].dump(), HasSubstr("was stopped after"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/report.html"));
  EXPECT_EQ(read_fabric(folder_ / "out/fabric.toml").value("bend_stiffness"),
            stopped["parameters"]["bend_stiffness"]["value"]);
  const std::size_t made = rows_of(folder_ / "out/evaluations.sqlite").size();
  EXPECT_EQ(stopped["evaluations"], made);

  ChildProcess again(command(words));
  ASSERT_TRUE(again.wait_for("anneal: 1/")) << again.err();
  again.send(SIGINT);
  again.wait();
  EXPECT_EQ(again.status(), 130) << again.err();
  EXPECT_THAT(again.err(), HasSubstr("(replayed)"));
  EXPECT_GE(rows_of(folder_ / "out/evaluations.sqlite").size(), made);
}

TEST_F(Fit, OtherCommandsSayThatTheyWereStopped) {
  write_fabric(folder_ / "truth.toml", truth());
  // Far more than there is time for.
  ChildProcess child(command({"landscape", path("c"), "--grid", "13", "--count", "300", "--fabric",
                              path("truth.toml"), "--out", path("l.svg")}));
  ASSERT_TRUE(child.wait_for("landscape: 1/")) << child.err();
  child.send(SIGINT);
  child.wait();
  EXPECT_EQ(child.status(), 130) << child.err();
  EXPECT_THAT(child.out(), HasSubstr("stopped before the end: " + path("l.svg") + " has gaps"));
}

TEST_F(Fit, RenderingAgainRemovesFramesOfALongerMotion) {
  write_fabric(folder_ / "truth.toml", truth());
  for (const std::string name : {"frame_0002.png", "frame_0003.png", "frame_0000.png", "own.png"})
    write("r/" + name, "old");
  const Outcome run = weft({"render", path("c"), "--fabric", path("truth.toml"), "--grid", "13",
                            "--out", path("r"), "--overwrite"});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(text_of(folder_ / "r/frame_0002.png"), "old");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "r/frame_0003.png"));
  EXPECT_EQ(text_of(folder_ / "r/own.png"), "old");
}

TEST_F(Fit, ProfileOfAParameterAboutAFabric) {
  write_fabric(folder_ / "truth.toml", truth());
  const Outcome run = weft({"profile", path("c"), "--fabric", path("truth.toml"), "--grid", "13",
                            "--parameters", "bend_stiffness", "--out", path("profile")});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("by its profile"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "profile/bend_stiffness.svg"));
  std::istringstream csv(text_of(folder_ / "profile/profile.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_THAT(line, HasSubstr("profile_of,rise,stretch_stiffness"));
  // Rows by rising bend, that of the fabric among them. It is not where a search on this mesh would
  // end, which the command has to say.
  std::vector<double> rises;
  while (std::getline(csv, line)) {
    ASSERT_TRUE(line.starts_with("bend_stiffness,")) << line;
    rises.push_back(std::stod(line.substr(line.find(',') + 1)));
  }
  ASSERT_GE(rises.size(), 3);
  EXPECT_EQ(std::ranges::count(rises, 0), 1);
  const double least = *std::ranges::min_element(rises);
  EXPECT_EQ(run.out.find("warning") != std::string::npos, least < -0.5);
  EXPECT_GT(std::max(rises.front(), rises.back()), least);

  const Outcome unknown =
      weft({"profile", path("c"), "--fabric", path("truth.toml"), "--parameters", "bent"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("--parameters"));
}

TEST_F(Fit, CompareShowsTheFramesOfWhatItSumsUp) {
  write_fabric(folder_ / "truth.toml", truth());
  const Outcome run = weft({"compare", path("c"), "--fabrics", path("truth.toml"), "satin", "--out",
                            path("compared"), "--keep", path("kept.toml"), "--grid", "13"});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(read_fabric(folder_ / "kept.toml").name, truth().name);
  // A row a frame and fabric: name, time, error.
  std::istringstream csv(text_of(folder_ / "compared/capture_1.csv"));
  std::string line;
  std::getline(csv, line);
  double sum = 0;
  int frames = 0;
  while (std::getline(csv, line)) {
    if (!line.starts_with(truth().name + ",")) continue;
    sum += std::stod(line.substr(line.rfind(',') + 1));
    ++frames;
  }
  ASSERT_GT(frames, 1);
  std::istringstream table(run.out.substr(run.out.find("\n" + truth().name + " ") + 1));
  std::string name;
  double printed = 0;
  table >> name >> printed;
  EXPECT_NEAR(sum / frames, printed, 1e-4 * printed);  // five digits
}

TEST_F(Fit, CompareNamesItsPlotsByPosition) {
  // A name is text: it may be that of another capture, and lead out of the folder.
  const std::string toml = text_of(folder_ / "c/capture.toml");
  const std::size_t name = toml.find("name = "), end = toml.find('\n', name);
  write("c/capture.toml", std::string(toml).replace(name, end - name, "name = \"../escaped\""));
  std::filesystem::copy(folder_ / "c", folder_ / "d", std::filesystem::copy_options::recursive);
  const auto compare = [&](const std::vector<std::string>& captures,
                           const std::vector<std::string>& more) {
    std::vector<std::string> words{"compare"};
    words.insert(words.end(), captures.begin(), captures.end());
    words.insert(words.end(), {"--fabrics", "satin", "--grid", "7", "--steps-per-frame", "1",
                               "--out", path("compared")});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  const Outcome both = weft(compare({path("c"), path("d")}, {}));
  ASSERT_EQ(both.status, 0) << both.err;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "escaped.svg"));
  for (const char* plot : {"capture_1.svg", "capture_1.csv", "capture_2.svg", "capture_2.csv"})
    EXPECT_GT(text_of(folder_ / "compared" / plot).size(), 0u) << plot;
  EXPECT_THAT(refusal(compare({path("c")}, {})), HasSubstr("holds capture_1.svg of another run"));
  const Outcome again = weft(compare({path("c")}, {"--overwrite"}));
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "compared/capture_1.svg"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "compared/capture_2.svg")) << "of another run";
}

TEST_F(Fit, TakesInOptionalTerms) {
  const Outcome unknown =
      weft({"fit", path("c"), "--out", path("out"), "--include", "drag_sideways"});
  EXPECT_EQ(unknown.status, 2);
  EXPECT_THAT(unknown.err, HasSubstr("--include: parameter \"drag_sideways\""));
  const Outcome run =
      weft(quick_fit("out", {"--iterations", "4", "--no-variability", "--no-mesh-error",
                             "--include", "drag_normal_linear"}));
  ASSERT_EQ(run.status, 0) << run.err;
  const json found = result("out");
  ASSERT_EQ(found["parameters"].size(), 10u);
  EXPECT_TRUE(found["parameters"]["drag_normal_linear"]["free"]);
  const Fabric fabric = read_fabric(folder_ / "out/fabric.toml");
  EXPECT_EQ(fabric.value("drag_normal_linear"),
            found["parameters"]["drag_normal_linear"]["value"].get<double>());
}

TEST_F(Fit, LeastSquaresIsTheDefaultAndEveryEstimateHasItsInterval) {
  const Outcome run = weft(quick_fit("out", {"--iterations", "10", "--no-variability"}));
  ASSERT_EQ(run.status, 0) << run.err;
  const json found = result("out");
  EXPECT_EQ(found["settings"]["method"], "auto");
  EXPECT_THAT(found["method"].dump(), HasSubstr("least squares"));
  EXPECT_LE(found["error"], found["error_initial"]);
  for (const auto& [name, p] : found["parameters"].items()) {
    ASSERT_TRUE(p.contains("interval_upper")) << name;
    EXPECT_LE(p["interval_lower"], p["value"]) << name;
    const bool above = p["interval_upper"].is_number();
    if (above) {
      EXPECT_GE(p["interval_upper"], p["value"]) << name;
    } else {
      EXPECT_EQ(p["interval_upper_not_finite"], "infinity") << name;
    }
    // One end at most is left of what is not determined, and that is inside of the range.
    if (p["determined"]) {
      EXPECT_TRUE(above) << name;
    } else if (above) {
      EXPECT_EQ(p["interval_lower"], 0) << name;
      EXPECT_LT(p["interval_upper"], p["upper"]) << name;
    } else if (p["interval_lower"] != 0) {
      EXPECT_GT(p["interval_lower"], p["lower"]) << name;
    }
  }
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("90 % interval"));
  const json& certainty = found["certainty"];
  EXPECT_EQ(certainty["parameters"].size(), 9u);
  EXPECT_EQ(certainty["correlation"].size(), 81u);
  EXPECT_GT(certainty["noise"], 0);
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("Correlation of the parameters"));

  // Without the evaluation on halved cells: the same values, none surer than with it.
  const auto result_of = [&](const std::string& out, const std::vector<std::string>& more) {
    const Outcome outcome = weft(quick_fit(out, more));
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return result(out);
  };
  const auto narrower_by_noise = [](const json& by_both, const json& by_noise) {
    EXPECT_EQ(by_both["settings"]["intervals"], "noise and mesh");
    EXPECT_EQ(by_noise["settings"]["intervals"], "noise");
    int narrower = 0;
    for (const auto& [name, p] : by_both["parameters"].items()) {
      const json& q = by_noise["parameters"][name];
      EXPECT_EQ(q["value"], p["value"]) << name;
      const json &upper = p["interval_upper"], &upper_by_noise = q["interval_upper"];
      if (upper.is_number()) {
        EXPECT_LE(upper_by_noise, upper) << name;
      }
      if (upper_by_noise.is_number() && (!upper.is_number() || upper_by_noise < upper)) ++narrower;
    }
    return narrower;
  };
  const std::vector<std::string> by_noise{"--iterations", "10", "--no-variability",
                                          "--no-mesh-error"};
  narrower_by_noise(found, result_of("alone", by_noise));
  // Nine parameters in three frames may all be undetermined; two are not.
  const std::vector<std::string> two{"--iterations",      "10",
                                     "--no-variability",  "--parameters",
                                     "stretch_stiffness", "bend_stiffness"};
  std::vector<std::string> two_by_noise = two;
  two_by_noise.emplace_back("--no-mesh-error");
  EXPECT_GT(narrower_by_noise(result_of("two", two), result_of("two_alone", two_by_noise)), 0);

  // From the surface where the fit had its motion start, the error is the fit's but for the digits
  // of the OBJ, which are nine.
  const std::vector<std::string> again{
      "evaluate",          path("c"), "--fabric", path("out/fabric.toml"), "--grid", "9",
      "--steps-per-frame", "2",       "--json"};
  const auto from = [&](const std::string& start) {
    std::vector<std::string> words = again;
    words.insert(words.end(), {"--start-surface", start});
    return weft(words);
  };
  const Outcome evaluation = from(path("out/start_1.obj"));
  ASSERT_EQ(evaluation.status, 0) << evaluation.err;
  const double error = json::parse(evaluation.out)["fit"]["error_per_mask_pixel"];
  EXPECT_NEAR(error, found["error"], 1e-6 * error);
  const Outcome nowhere = from(path("none.obj"));
  EXPECT_EQ(nowhere.status, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("none.obj"));

  // What follows from a fit's folder.
  const Outcome posterior = weft({"posterior", path("out"), "--steps", "50", "--burn-in", "20"});
  ASSERT_EQ(posterior.status, 0) << posterior.err;
  const json quantiles = json::parse(text_of(folder_ / "out/posterior.json"));
  EXPECT_EQ(quantiles["samples"], 36 * 50);
  for (const auto& [name, p] : quantiles["parameters"].items()) {
    EXPECT_LE(p["quantiles"]["0.05"], p["quantiles"]["0.95"]) << name;
    EXPECT_GE(p["quantiles"]["0.05"], found["parameters"][name]["lower"]) << name;
  }
  EXPECT_THAT(text_of(folder_ / "out/posterior.csv"), StartsWith("stretch_stiffness,"));
  EXPECT_THAT(text_of(folder_ / "out/posterior.svg"), HasSubstr("Posterior of"));
  EXPECT_EQ(weft({"posterior", path("out")}).status, 2) << "an earlier result was replaced";
  const auto simulated = [&](const std::string& grid) {
    return weft({"posterior", path("out"), "--out", path("simulated"), "--overwrite", "--true-cost",
                 "--steps", "10", "--burn-in", "0", "--grid", grid, "--steps-per-frame", "2"});
  };
  const Outcome sampled = simulated("9");
  EXPECT_EQ(sampled.status, 0) << sampled.err;
  const Outcome elsewhere = simulated("11");
  EXPECT_EQ(elsewhere.status, 2);
  EXPECT_THAT(elsewhere.err, HasSubstr("give those of the fit"));
  const Outcome suggest = weft({"suggest",
                                path("out"),
                                "--like",
                                path("c"),
                                "--grid",
                                "9",
                                "--separations",
                                "0.8",
                                "--amplitudes",
                                "0",
                                "0.05",
                                "--frequencies",
                                "3",
                                "--frames",
                                "3",
                                "--parameters",
                                "bend_stiffness",
                                "--json",
                                "--out",
                                path("next")});
  ASSERT_EQ(suggest.status, 0) << suggest.err;
  const json ranked = json::parse(suggest.out);
  ASSERT_EQ(ranked["experiments"].size(), 2u);
  EXPECT_LE(ranked["experiments"][0]["remaining"], ranked["experiments"][1]["remaining"]);
  EXPECT_EQ(ranked, json::parse(text_of(folder_ / "next/suggestions.json")));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "next/suggestions.svg"));

  const Outcome mixed = weft({"fit", path("c"), "--out", path("other"), "--coarse", "none"});
  EXPECT_EQ(mixed.status, 2);
  EXPECT_THAT(mixed.err, HasSubstr("--coarse: only with --method annealing"));
}

TEST_F(Fit, AKilledRunContinuesWithoutRepeatingAnEvaluation) {
  const auto words = fit("out", {"--iterations", "60", "--no-variability"});
  {
    ChildProcess child(command(words));
    ASSERT_TRUE(child.wait_for("anneal: 1/")) << child.err();
    child.send(SIGKILL);
    child.wait();
    ASSERT_EQ(child.status(), -SIGKILL) << "the fit ended before it could be killed";
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/result.json"));
  const std::size_t made = rows_of(folder_ / "out/evaluations.sqlite").size();
  EXPECT_GT(made, 2u);
  const Outcome resumed = weft(words);
  ASSERT_EQ(resumed.status, 0) << resumed.err;
  EXPECT_THAT(resumed.out, HasSubstr(fmt::format("({} replayed", made)));
  const json continued = result("out");
  EXPECT_EQ(continued["stopped"], false);
  // No two rows are of the same parameters, so as many rows as evaluations means none was repeated.
  EXPECT_EQ(continued["evaluations"], rows_of(folder_ / "out/evaluations.sqlite").size());

  // The same as of a run that was left alone, and on another number of threads.
  for (const std::string threads : {"1", "2"}) {
    auto whole = fit("whole" + threads, {"--iterations", "60", "--no-variability"});
    whole.insert(whole.end(), {"--threads", threads});
    const Outcome outcome = weft(whole);
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(without_circumstances(result("whole" + threads)), without_circumstances(continued));
  }
}

// The same of the default method, killed within its descents.
TEST_F(Fit, AKilledDescentContinues) {
  const auto words = [&](const std::string& out, const std::string& threads) {
    return quick_fit(out, {"--parameters", "bend_stiffness", "stretch_stiffness", "--hops", "1",
                           "--no-mesh-error", "--threads", threads});
  };
  {
    ChildProcess child(command(words("out", "2")));
    ASSERT_TRUE(child.wait_for("hops, round 1 of at most 1: ")) << child.err();
    child.send(SIGKILL);
    child.wait();
    ASSERT_EQ(child.status(), -SIGKILL) << "the fit ended before it could be killed";
  }
  const std::size_t made = rows_of(folder_ / "out/evaluations.sqlite").size();
  const Outcome resumed = weft(words("out", "2"));
  ASSERT_EQ(resumed.status, 0) << resumed.err;
  EXPECT_THAT(resumed.out, HasSubstr("replayed"));
  EXPECT_GE(rows_of(folder_ / "out/evaluations.sqlite").size(), made);
  ASSERT_EQ(weft(words("whole", "1")).status, 0);
  EXPECT_EQ(without_circumstances(result("out")), without_circumstances(result("whole")));
}

TEST_F(Fit, ExtendsAnEarlierResult) {
  const auto words = [&](const std::string& out, const std::string& hops) {
    return quick_fit(out, {"--parameters", "bend_stiffness", "stretch_stiffness", "--hops", hops,
                           "--no-variability", "--no-mesh-error"});
  };
  auto extend = words("out", "1");
  extend.emplace_back("--extend");
  EXPECT_EQ(refusal(extend),
            "--extend: " + path("out") + " holds no evaluations.sqlite of an earlier run");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  ASSERT_EQ(weft(words("out", "0")).status, 0);
  const std::size_t made = rows_of(folder_ / "out/evaluations.sqlite").size();

  // What it wrote is all that its numbers come from.
  const Outcome evaluated =
      weft({"evaluate", path("c"), "--grid", "9", "--steps-per-frame", "2", "--fabric",
            path("out/fabric.toml"), "--start-surface", path("out/start_1.obj"), "--json"});
  ASSERT_EQ(evaluated.status, 0) << evaluated.err;
  // Means are summed in another order.
  EXPECT_DOUBLE_EQ(json::parse(evaluated.out)["fit"]["error"].get<double>(),
                   result("out")["captures"][0]["fit"]["error"].get<double>());

  auto both = extend;
  both.emplace_back("--overwrite");
  EXPECT_EQ(refusal(both), "--overwrite and --extend exclude each other");
  auto other = extend;
  other.insert(other.end(), {"--alpha", "0.2"});
  EXPECT_THAT(refusal(other), HasSubstr("evaluations.sqlite of another run"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/result.json"));
  const Outcome extended = weft(extend);
  ASSERT_EQ(extended.status, 0) << extended.err;
  EXPECT_THAT(extended.err, HasSubstr("(replayed)"));
  EXPECT_GT(rows_of(folder_ / "out/evaluations.sqlite").size(), made);
  ASSERT_EQ(weft(words("whole", "1")).status, 0);
  EXPECT_EQ(without_circumstances(result("out")), without_circumstances(result("whole")));
  // Once more the same: each evaluation is replayed, those of the descents, too.
  const Outcome again = weft(extend);
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr(fmt::format("; {0} evaluations ({0} replayed",
                                               result("out")["evaluations"].get<int>())));
  EXPECT_EQ(without_circumstances(result("out")), without_circumstances(result("whole")));
}

TEST_F(Fit, TheVariabilityDoesNotDependOnTheThreads) {
  json results[2];
  for (int i = 0; i < 2; ++i) {
    const std::string out = "out" + std::to_string(i);
    const Outcome outcome =
        weft(fit(out, {"--iterations", "6", "--seed", "7", "--parameters", "bend_stiffness",
                       "stretch_stiffness", "--threads", std::to_string(i + 1)}));
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    results[i] = without_circumstances(result(out));
  }
  EXPECT_EQ(results[0]["seed"], 7);
  EXPECT_FALSE(results[0]["perturbations"].empty());
  EXPECT_EQ(results[0], results[1]);
}

TEST_F(Fit, RefusesAFolderWithTheEvaluationsOfAnotherRun) {
  const auto words = fit("out", {"--iterations", "1", "--no-variability"});
  ASSERT_EQ(weft(words).status, 0);
  EXPECT_THAT(refusal(words),
              AllOf(StartsWith(path("out") + ": holds result.json"), HasSubstr("--overwrite")));
  // As a killed run leaves it.
  std::filesystem::remove(folder_ / "out/result.json");
  auto other = words;
  other.insert(other.end(), {"--alpha", "0.2"});
  EXPECT_THAT(refusal(other), AllOf(StartsWith(path("out") + ": holds evaluations.sqlite"),
                                    HasSubstr("another run"), HasSubstr("--overwrite")));
  const std::size_t made = rows_of(folder_ / "out/evaluations.sqlite").size();
  other.emplace_back("--overwrite");
  const Outcome outcome = weft(other);
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(rows_of(folder_ / "out/evaluations.sqlite").size(), made) << "old rows were kept";
}

TEST_F(Fit, GoesOnPastSimulationsThatDivergeAndCountsThem) {
  // No equilibrium is found of cloth that is as stiff as the upper half of this range.
  Fabric fabric = truth_with_ranges();
  fabric.upper[parameter_index(fabric.model, "stretch_stiffness")] = 1e12;
  write_fabric(folder_ / "f.toml", fabric);
  const Outcome outcome = weft(
      fit("out",
          {"--iterations", "4", "--initial", path("f.toml"), "--parameters", "stretch_stiffness"},
          "stretch_stiffness"));
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json found = result("out");
  std::size_t diverged = 0;
  for (const Row& row : rows_of(folder_ / "out/evaluations.sqlite")) diverged += row.diverged;
  EXPECT_GE(diverged, 1u);  // the coarse search's upper value
  EXPECT_EQ(found["diverged"], diverged);
  EXPECT_TRUE(found["error"].is_number());
  EXPECT_LT(found["parameters"]["stretch_stiffness"]["value"], 1e9);
  EXPECT_THAT(outcome.out, HasSubstr(fmt::format("{} diverged)", diverged)));
  EXPECT_THAT(found["warnings"].dump(), HasSubstr("simulations diverged"));
}

TEST_F(Fit, SearchesAndReportsTheRangesOfTheFabric) {
  Fabric fabric = truth_with_ranges();
  // Narrower than the model's table (1e-7 to 1e-2), wider than it (up to 5000), and a held one.
  const double lower = 4e-6, upper = 4e-4;
  const int bend = parameter_index(fabric.model, "bend_stiffness");
  const int stretch = parameter_index(fabric.model, "stretch_stiffness");
  const int shear = parameter_index(fabric.model, "shear_stiffness");
  fabric.lower[bend] = lower;
  fabric.upper[bend] = upper;
  fabric.upper[stretch] = 20000;
  fabric.lower[shear] = 40;
  write_fabric(folder_ / "f.toml", fabric);
  const Outcome outcome = weft(fit("out", {"--iterations", "25", "--initial", path("f.toml"),
                                           "--parameters", "bend_stiffness", "stretch_stiffness"}));
  ASSERT_EQ(outcome.status, 0) << outcome.err;

  std::vector<double> coarse;
  for (const Row& row : rows_of(folder_ / "out/evaluations.sqlite")) {
    const double value = row.parameters["bend_stiffness"];
    EXPECT_GE(value, lower) << row.phase;
    EXPECT_LE(value, upper) << row.phase;
    EXPECT_EQ(row.parameters["shear_stiffness"], fabric.value("shear_stiffness"));
    if (row.phase == "coarse") coarse.push_back(value);
  }
  // Centres of two equal cells of the logarithmic range.
  std::sort(coarse.begin(), coarse.end());
  ASSERT_EQ(coarse.size(), 2u);
  EXPECT_NEAR(coarse[0], lower * std::pow(upper / lower, 0.25), 1e-9 * upper);
  EXPECT_NEAR(coarse[1], lower * std::pow(upper / lower, 0.75), 1e-9 * upper);

  const json parameters = result("out")["parameters"];
  EXPECT_EQ(parameters["bend_stiffness"]["lower"], lower);
  EXPECT_EQ(parameters["bend_stiffness"]["upper"], upper);
  EXPECT_EQ(parameters["stretch_stiffness"]["upper"], 20000);
  EXPECT_EQ(parameters["shear_stiffness"]["lower"], 40);
  EXPECT_EQ(parameters["shear_stiffness"]["free"], false);
  const Fabric found = read_fabric(folder_ / "out/fabric.toml");
  EXPECT_EQ(found.lower, fabric.lower);
  EXPECT_EQ(found.upper, fabric.upper);
  // The ends of the drawn ranges.
  EXPECT_THAT(text_of(folder_ / "out/report.html"),
              HasSubstr("<span>4×10⁻⁶</span><span>4×10⁻⁴</span>"));
}

/// A range whose lower end is at the truth: the search ends there.
TEST_F(Fit, SaysWhichValuesLieAtABoundWithoutVariability) {
  for (const double distance : {0.0, 0.008, 0.02}) {
    Fabric fabric = truth_with_ranges();
    const int bend = parameter_index(fabric.model, "bend_stiffness");
    const int shear = parameter_index(fabric.model, "shear_stiffness");
    // The start, at the truth, is that part of the (logarithmic) range above its lower end.
    const double value = truth().value("bend_stiffness");
    fabric.upper[bend] = 1e-2;
    fabric.lower[bend] =
        std::pow(value / std::pow(fabric.upper[bend], distance), 1 / (1 - distance));
    fabric.lower[shear] = fabric.values[shear];  // held there: not the search's doing
    write_fabric(folder_ / "f.toml", fabric);
    // Two evaluations: the middle of the range, and the start, which is better.
    const Outcome outcome =
        weft(fit("out",
                 {"--iterations", "1", "--initial", path("f.toml"), "--start", "initial",
                  "--parameters", "bend_stiffness", "--no-variability", "--overwrite"},
                 "none"));
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const json found = result("out");
    EXPECT_EQ(found["evaluations"], 2);
    const json& row = found["parameters"]["bend_stiffness"];
    ASSERT_NEAR(row["value"], value, 1e-9 * value);
    EXPECT_TRUE(row["variability"].is_null());
    EXPECT_TRUE(found["parameters"]["shear_stiffness"]["at_bound"].is_null());
    const std::string report = text_of(folder_ / "out/report.html");
    const bool at_bound = distance < 0.01;
    EXPECT_EQ(row["at_bound"], at_bound ? json("lower") : json(nullptr)) << distance;
    EXPECT_EQ(outcome.out.find("at the lower end of its range") != std::string::npos, at_bound);
    EXPECT_EQ(report.find("at lower end") != std::string::npos, at_bound);
    EXPECT_EQ(found["warnings"].dump().find("ended at the lower end") != std::string::npos,
              at_bound);
  }
}

}  // namespace
}  // namespace weft::fit_test
