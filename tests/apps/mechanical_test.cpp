/// Mechanical captures through the program.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "apps/store.h"
#include "weft/estimate/cantilever.h"
#include "weft/estimate/synthetic.h"
#include "weft/report/result.h"

namespace weft::mechanical_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// A tensile test as a laboratory hands it over: a curve and the size of the specimen.
class Mechanical : public ProgramTest {
 protected:
  static constexpr double kLength = 0.2, kWidth = 0.05, kStiffness = 800;  // m, m, N/m

  void SetUp() override {
    ProgramTest::SetUp();
    write("strip/capture.toml",
          "format = \"weft-capture\"\nversion = 1\nname = \"strip\"\nkind = \"mechanical\"\n"
          "test = \"strip\"\n"
          "specimen = { free_length = 0.2, width = 0.05, areal_density = 0.15 }\n"
          "[curve]\nfile = \"curve.csv\"\ndisplacement = \"extension\"\nforce = \"load\"\n"
          "displacement_unit = \"mm\"\n");
    std::string curve = "extension,load\n";
    for (int k = 0; k <= 4; ++k) {
      const double s = 0.01 * k;
      // A linear law between Green strain and second Piola-Kirchhoff stress, no contraction.
      const double force = kWidth * kStiffness * (s + s * s / 2) * (1 + s);
      curve += fmt::format("{:.4f},{:.6f}\n", 1e3 * kLength * s, force);
    }
    write("strip/curve.csv", curve);
  }
  int rows_of_store(const std::string& out) const {
    return run_sql(folder_ / out / "mechanical_evaluations.sqlite", "SELECT count(*) FROM numbers");
  }
  /// What must be the same for two runs of one fit.
  json without_circumstances(const std::string& out) const {
    json object = json::parse(text_of(folder_ / out / "result.json"));
    for (const char* key : {"wall_s", "created", "command"}) object.erase(key);
    if (object.contains("stages"))
      for (json& stage : object["stages"]) stage.erase("wall_s");
    return object;
  }
  Outcome fit(const std::string& out) const {
    return weft(
        {"fit", path("strip"), "--out", path(out), "--cells", "3", "--parameters", "membrane_uu"});
  }
};

TEST_F(Mechanical, FitsACurveAndShowsIt) {
  const Outcome outcome = fit("out");
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  // The other parameters are at their defaults: A12^2 / A22 = 5 N/m less than membrane_uu resists a
  // free strip, clamped ends a part of it.
  const double found = result["parameters"]["membrane_uu"]["value"];
  EXPECT_NEAR(found, kStiffness + 5, 5);
  EXPECT_LT(result["mechanical"][0]["force_relative"].get<double>(), 1e-3);

  const std::string page = text_of(folder_ / "out/report.html");
  for (const char* text : {"What was measured", "What was found", "How well it matches",
                           "Force of the clips", "Strains that occur", "The fabric's curves"})
    EXPECT_THAT(page, HasSubstr(text));
  EXPECT_THAT(outcome.out, HasSubstr("report.html"));
  EXPECT_NO_THROW(read_result(folder_ / "out/result.json"));

  // What the plots show, to plot again: the clip that is pulled by 0 to 8 mm.
  const json& clips = result["mechanical"][0]["clips"];
  ASSERT_EQ(clips.size(), 2u);
  const json& pulled = clips[clips[0]["way"].back().get<double>() > 0 ? 0 : 1];
  ASSERT_EQ(pulled["way"].size(), 5u);
  EXPECT_NEAR(pulled["way"][4].get<double>(), 0.008, 1e-9);
  const double force = kWidth * kStiffness * (0.04 + 0.0008) * 1.04;
  EXPECT_NEAR(pulled["measured"][4].get<double>(), force, 1e-5);
  EXPECT_NEAR(pulled["computed"][4].get<double>(), force, 2e-3 * force);
  EXPECT_LT(pulled["lower"][4].get<double>(), pulled["upper"][4].get<double>());
  const json& stretch = result["mechanical"][0]["strains"][0];
  EXPECT_EQ(stretch["name"], "weft stretch");
  double sum = 0;
  for (const json& share : stretch["share"]) sum += share.get<double>();
  EXPECT_NEAR(sum, 1, 1e-4);
  const json& response = result["responses"][0];
  EXPECT_EQ(response["name"], "weft stretch");
  EXPECT_FALSE(response.contains("turns"));
  const double s = response["strain"].back();
  EXPECT_NEAR(response["stress"].back().get<double>(), found * (s + s * s / 2) * (1 + s),
              1e-4 * found * s);
}

/// Names of the curves of the fabric.
std::vector<std::string> names_of(const json& responses) {
  std::vector<std::string> names;
  for (const json& response : responses) names.push_back(response["name"]);
  return names;
}

// Neither the warp nor the shear of a strip that is pulled evenly is strained.
TEST_F(Mechanical, ShowsNoCurveOverRounding) {
  const Outcome outcome = weft({"fit", path("strip"), "--out", path("out"), "--cells", "3",
                                "--model", "soft-constraints", "--parameters", "weft_stretch"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  EXPECT_EQ(names_of(result["responses"]), std::vector<std::string>{"weft stretch"});
  EXPECT_EQ(names_of(result["mechanical"][0]["strains"]), std::vector<std::string>{"weft stretch"});
}

TEST_F(Mechanical, WarnsOfWhatTheModelDoesNotExplain) {
  const auto remarks_of = [&](double offset, double of_displacement) {
    std::string curve = "extension,load\n";
    for (int k = 0; k <= 4; ++k)
      curve += fmt::format("{:.6f},{:.6f}\n", of_displacement * 2 * k, offset + 0.4 * k);
    write("strip/curve.csv", curve);
    const Outcome outcome =
        weft({"fit", path("strip"), "--out", path("out"), "--cells", "3", "--model",
              "soft-constraints", "--parameters", "weft_stretch", "--overwrite"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    std::string remarks;
    const json result = json::parse(text_of(folder_ / "out/result.json"));
    for (const json& remark : result["remarks"]) {
      EXPECT_THAT(outcome.out, HasSubstr("warning: " + remark.get<std::string>()));
      remarks += remark.get<std::string>() + "\n";
    }
    return remarks;
  };
  EXPECT_EQ(remarks_of(0, 1), "");
  EXPECT_THAT(remarks_of(0.5, 1),
              AllOf(HasSubstr("strip: the model does not explain it: force "),
                    HasSubstr("strip: at its first frame, without a displacement, the force is "
                              "0.5 N, 24 % of the largest")));
  EXPECT_THAT(remarks_of(0, 1e-3),
              AllOf(HasSubstr("strip: the largest displacement"), HasSubstr("weft_stretch is"),
                    HasSubstr("units of forces")));
}

TEST_F(Mechanical, SearchesWhatActsAtRest) {
  const auto free_of = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words{
        "fit", path("strip"), "--out",         path("out"),       "--cells",
        "2",   "--model",     "baraff-witkin", "--no-mesh-error", "--overwrite"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = weft(words);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    std::vector<std::string> free;
    const json result = json::parse(text_of(folder_ / "out/result.json"));
    for (const auto& [name, parameter] : result["parameters"].items())
      if (parameter["free"].get<bool>()) free.push_back(name);
    return free;
  };
  const auto elastic =
      ::testing::UnorderedElementsAre("stretch_stiffness", "shear_stiffness", "bend_stiffness");
  EXPECT_THAT(free_of({}), elastic);
  EXPECT_THAT(free_of({"--order", "joint"}), elastic);
  EXPECT_THAT(free_of({"--parameters", "drag_linear"}), ::testing::ElementsAre("drag_linear"));
}

// A mistake in what is to replace a fit does not cost the fit.
TEST_F(Mechanical, ARefusedFitLeavesTheEarlierOne) {
  const std::vector<std::string> words{"fit",       path("strip"),   "--out",
                                       path("out"), "--cells",       "2",
                                       "--model",   "baraff-witkin", "--no-mesh-error"};
  ASSERT_EQ(weft(words).status, 0);
  const std::string before = text_of(folder_ / "out/result.json");
  const auto refused = [&](std::vector<std::string> more) {
    std::vector<std::string> other = words;
    other.emplace_back("--overwrite");
    other.insert(other.end(), more.begin(), more.end());
    const Outcome outcome = weft(other);
    EXPECT_EQ(outcome.status, 2);
    return outcome.err;
  };
  EXPECT_THAT(refused({"--parameters", "weft_bnd"}), HasSubstr("weft_bnd"));
  EXPECT_THAT(refused({"--residuals", "points"}), HasSubstr("nothing to compare"));
  EXPECT_THAT(refused({"--points", "3"}), HasSubstr("--points: only with --subdivide"));
  EXPECT_THAT(refused({"--seed", "7"}), HasSubstr("--seed"));
  EXPECT_EQ(text_of(folder_ / "out/result.json"), before);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out/mechanical_evaluations.sqlite"));
}

TEST_F(Mechanical, AnEarlierResultThatCannotBeRemoved) {
  write("out/result.json/inner", "");
  EXPECT_EQ(refusal({"fit", path("strip"), "--out", path("out"), "--overwrite"}),
            path("out/result.json") + ": cannot be removed: Directory not empty");
}

// A range that ends below what the data want: the likelihood rises up to its end, and samples keep
// near it by that slope.
TEST_F(Mechanical, PosteriorAtABound) {
  Fabric known = Fabric::with_defaults("known", "soft-constraints");
  known.set("weft_stretch", 300);
  write("known.toml", fabric_to_toml(known));
  replace("known.toml", "upper = 1000000", "upper = 400");
  ASSERT_EQ(weft({"fit", path("strip"), "--out", path("out"), "--initial", path("known.toml"),
                  "--cells", "3", "--parameters", "weft_stretch", "--no-mesh-error"})
                .status,
            0);
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  const json &stretch = result["parameters"]["weft_stretch"], &certainty = result["certainty"];
  ASSERT_EQ(stretch["at_bound"], "upper");
  const double over = certainty["overdispersion"].get<double>(),
               slope = certainty["slope"][0].get<double>() / over,
               information = certainty["information"][0].get<double>() / over;
  EXPECT_LT(slope, 0);
  // The share of the density within `d` of the end, by sums.
  const auto share = [&](double d) {
    double inside = 0, all = 0;
    for (int i = 0; i < 100000; ++i) {
      const double x = (i + 0.5) / 100000;
      const double density = std::exp(slope * x - 0.5 * information * x * x);
      all += density;
      if (x < d) inside += density;
    }
    return inside / all;
  };
  ASSERT_EQ(weft({"posterior", path("out"), "--steps", "4000"}).status, 0);
  const json posterior = json::parse(text_of(folder_ / "out/posterior.json"));
  const double range = std::log(stretch["upper"].get<double>() / stretch["lower"].get<double>());
  const double low = posterior["parameters"]["weft_stretch"]["quantiles"]["0.05"].get<double>();
  EXPECT_NEAR(share(std::log(stretch["upper"].get<double>() / low) / range), 0.95, 0.02);
}

// On 16 cells a search begins on 8, of a model without an incremental order, too.
TEST_F(Mechanical, AJointFitOfCurvesBeginsOnHalfTheCells) {
  const Outcome outcome =
      weft({"fit", path("strip"), "--out", path("out"), "--cells", "16", "--model", "baraff-witkin",
            "--order", "joint", "--parameters", "stretch_stiffness", "--no-mesh-error"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  EXPECT_THAT(result["stages"][0]["name"].get<std::string>(), HasSubstr("half the cells"));
}

TEST_F(Mechanical, SpringsHaveCurvesOfTheirCells) {
  const Outcome outcome =
      weft({"fit", path("strip"), "--out", path("out"), "--cells", "3", "--model", "springs",
            "--parameters", "weft_stretch", "--no-mesh-error"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  EXPECT_THAT(names_of(result["responses"]), ::testing::Contains("weft stretch"));
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("The bend of springs depends on"));
}

TEST_F(Mechanical, InternalFrictionShowsAsALoop) {
  Fabric fabric = Fabric::with_defaults("rubbing", "stvk-diagonal");
  for (const char* row : {"weft_stretch_friction", "weft_stretch_friction_scale"})
    fabric.include(row);
  fabric.set("weft_stretch_friction", 2);
  fabric.set("weft_stretch_friction_scale", 0.002);
  write_fabric(folder_ / "rubbing.toml", fabric);
  const Outcome outcome =
      weft({"fit", path("strip"), "--out", path("out"), "--cells", "3", "--initial",
            path("rubbing.toml"), "--parameters", "weft_stretch", "--no-mesh-error"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  for (const json& response : result["responses"])
    EXPECT_EQ(response.contains("turns"), response["name"] == "weft stretch") << response["name"];
  const json& loop = result["responses"][0];
  const auto turn = loop["turns"][0].get<std::size_t>();
  EXPECT_EQ(loop["strain"][0], 0);
  // Down from where it was loaded to: twice the amplitude lower at the first strain that is far.
  EXPECT_GT(loop["strain"][turn].get<double>(), loop["strain"][turn + 1].get<double>());
  EXPECT_LT(loop["stress"][loop["turns"][1].get<std::size_t>()].get<double>(), -1);
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("unloading"));
}

// A flat strip says nothing of bends: they are not determined, and stretch is.
TEST_F(Mechanical, WhatAStripDoesNotShowLeavesItsStretchKnown) {
  const Outcome outcome = weft({"fit", path("strip"), "--out", path("out"), "--cells", "3",
                                "--model", "soft-constraints", "--no-mesh-error"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  const json& stretch = result["parameters"]["weft_stretch"];
  EXPECT_TRUE(stretch["determined"]);
  EXPECT_GT(stretch["interval_lower"], 0.95 * stretch["value"].get<double>());
  EXPECT_FALSE(result["parameters"]["weft_bend"]["determined"]);
  const json& certainty = result["certainty"];
  EXPECT_EQ(certainty["condition_not_finite"], "infinity");
  EXPECT_EQ(certainty["clusters"], 5);
  const std::size_t n = certainty["parameters"].size();
  EXPECT_EQ(certainty["covariance"].size(), n * n);
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("id=\"condition\""));
}

// Stages and the assessment ask the same of the store, each with shapes of its own.
TEST_F(Mechanical, OneTestIsFittedInTheIncrementalOrder) {
  const Outcome outcome =
      weft({"fit", path("strip"), "--out", path("out"), "--cells", "3", "--model",
            "soft-constraints", "--order", "incremental", "--isotropic"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  // A linear spring through the curve of the Green strain: 1 + 3/2 (sum s^3) / (sum s^2) as stiff.
  EXPECT_NEAR(result["parameters"]["weft_stretch"]["value"].get<double>(), 1.05 * kStiffness,
              0.01 * kStiffness);
}

// Of a bias extension the pull is measured, across the clips: nothing along them.
TEST_F(Mechanical, ABiasExtensionIsTheShearOfTheIncrementalOrder) {
  std::string toml = text_of(folder_ / "strip/capture.toml");
  toml.replace(toml.find("test = \"strip\""), 14, "test = \"bias-extension\"");
  toml.replace(toml.find("width = 0.05"), 12, "width = 0.1");
  write("bias/capture.toml", toml);
  write("bias/curve.csv", "extension,load\n0,0\n2,0.05\n4,0.1\n6,0.15\n8,0.2\n");
  const Outcome outcome =
      weft({"fit", path("strip"), path("bias"), "--out", path("out"), "--cells", "3", "--model",
            "soft-constraints", "--order", "incremental", "--parameters", "weft_stretch", "shear"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  EXPECT_TRUE(result["parameters"]["shear"]["determined"]) << outcome.out;
  EXPECT_LT(result["mechanical"][1]["force_relative"].get<double>(), 0.2);
}

// Along the threads a strip says nothing of the shear: that is its prior, and is told so.
TEST_F(Mechanical, AStripAloneLeavesTheShearToItsPrior) {
  Fabric known = Fabric::with_defaults("known", "soft-constraints");
  known.set("shear", 50);
  write("known.toml", fabric_to_toml(known));
  replace("known.toml", "\nshear = {", "\nshear = { prior = { median = 20, factor = 2 },");
  const std::vector<std::string> words{"fit",          path("strip"),      "--out",   path("out"),
                                       "--initial",    path("known.toml"), "--cells", "3",
                                       "--parameters", "weft_stretch",     "shear"};
  const Outcome outcome = weft(words);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("of its prior: not determined by the data"));
  EXPECT_THAT(outcome.out, HasSubstr("the priors add"));
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  const json& shear = result["parameters"]["shear"];
  EXPECT_NEAR(shear["value"].get<double>(), 20, 0.02);
  EXPECT_FALSE(shear["determined"]);
  EXPECT_EQ(shear["prior"]["factor"], 2);
  // 1.645 standard deviations of log 2.
  EXPECT_NEAR(shear["interval_upper"].get<double>(), 20 * std::pow(2, 1.645), 0.1);
  EXPECT_NEAR(shear["interval_lower"].get<double>(), 20 / std::pow(2, 1.645), 0.02);
  EXPECT_TRUE(result["parameters"]["weft_stretch"]["determined"]);
  EXPECT_FALSE(result["parameters"]["weft_stretch"].contains("prior"));
  EXPECT_GE(result["prior_error"], 0);
  EXPECT_GE(result["certainty"]["overdispersion"], 1);
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("of its prior"));
  // The run's evaluations are of these priors.
  replace("known.toml", "factor = 2", "factor = 3");
  std::filesystem::remove(folder_ / "out/result.json");
  const Outcome other = weft(words);
  EXPECT_EQ(other.status, 2) << other.out;
}

// What the other parameters could do for a strip is nothing: its profile is a parabola.
TEST_F(Mechanical, ProfileOfAFit) {
  ASSERT_EQ(weft({"fit", path("strip"), "--out", path("out"), "--cells", "3", "--model",
                  "soft-constraints", "--no-mesh-error"})
                .status,
            0);
  const std::vector<std::string> words{
      "profile", path("strip"), "--fabric", path("out/fabric.toml"),
      "--cells", "3",           "--out",    path("profile")};
  const Outcome run = weft(words);
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("weft_stretch"));
  EXPECT_THAT(run.out, Not(HasSubstr("warning")));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "profile/weft_stretch.svg"));
  double value = 0, lower = 0, upper = 0, below = 0, above = 0;
  ASSERT_EQ(std::sscanf(run.out.c_str(),
                        "weft_stretch %lf N/m by derivatives %lf to %lf; by its profile %lf to %lf",
                        &value, &lower, &upper, &below, &above),
            5)
      << run.out;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  const json& stretch = result["parameters"]["weft_stretch"];
  EXPECT_NEAR(lower, stretch["interval_lower"].get<double>(), 0.02 * (value - lower));
  // The rise of a parabola with the data's information, at Student's t of five frames: 2.132.
  const json& certainty = result["certainty"];
  const double range = std::log(stretch["upper"].get<double>() / stretch["lower"].get<double>());
  const double half = 2.132 * range *
                      std::sqrt(certainty["overdispersion"].get<double>() /
                                certainty["information"][0].get<double>());
  EXPECT_NEAR(std::log(value / below), half, 0.05 * half);
  EXPECT_NEAR(std::log(above / value), half, 0.05 * half);
  EXPECT_EQ(weft(words).status, 2);  // there is one already

  const auto refusal = [&](const std::vector<std::string>& more) {
    std::vector<std::string> all = words;
    all.insert(all.end(), more.begin(), more.end());
    const Outcome refused = weft(all);
    EXPECT_EQ(refused.status, 2);
    return refused.err;
  };
  EXPECT_THAT(refusal({"--parameters", "drag_linear"}), HasSubstr("--parameters"));
  EXPECT_THAT(refusal({"--grid", "13"}), HasSubstr("--grid"));
  EXPECT_THAT(refusal({"--balance", "noise"}), HasSubstr("--balance"));
}

// A quadratic about an estimate between data and prior: both widths, whether it is sampled from
// what the fit left or simulated anew.
TEST_F(Mechanical, PosteriorOfAFit) {
  Fabric known = Fabric::with_defaults("known", "soft-constraints");
  write("known.toml", fabric_to_toml(known));
  replace("known.toml", "\nshear = {", "\nshear = { prior = { median = 20, factor = 2 },");
  replace("known.toml", "weft_stretch = {",
          "weft_stretch = { prior = { median = 860, factor = 1.01 },");
  ASSERT_EQ(weft({"fit", path("strip"), "--out", path("out"), "--initial", path("known.toml"),
                  "--cells", "3", "--parameters", "weft_stretch", "shear", "--no-mesh-error"})
                .status,
            0);
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  const auto of_fit = [&](const char* name, const char* key) {
    return result["parameters"][name][key].get<double>();
  };
  const json& certainty = result["certainty"];
  const double range = std::log(of_fit("weft_stretch", "upper") / of_fit("weft_stretch", "lower"));
  const double information = certainty["information"][0].get<double>() /
                             certainty["overdispersion"].get<double>() / (range * range);
  const double deviation = 1 / std::sqrt(information + std::pow(std::log(1.01), -2));  // of log
  for (const bool simulated : {false, true}) {
    std::vector<std::string> words{"posterior", path("out"), "--overwrite"};
    if (simulated) words.insert(words.end(), {"--true-cost", "--steps", "60", "--burn-in", "30"});
    const Outcome run = weft(words);
    ASSERT_EQ(run.status, 0) << run.err;
    EXPECT_EQ(run.out.find("--true-cost simulates") == std::string::npos, simulated);
    const json posterior = json::parse(text_of(folder_ / "out/posterior.json"));
    EXPECT_EQ(posterior["cost"], simulated ? "simulated" : "quadratic");
    const auto quantile = [&](const char* name, const char* p) {
      return posterior["parameters"][name]["quantiles"][p].get<double>();
    };
    const double effective =
        posterior["parameters"]["weft_stretch"]["effective_samples"].get<double>();
    const double error = 3 / std::sqrt(effective);  // of a median or half width, in deviations
    EXPECT_NEAR(std::log(quantile("weft_stretch", "0.5") / of_fit("weft_stretch", "value")), 0,
                (0.1 + error) * deviation);
    EXPECT_NEAR(std::log(quantile("weft_stretch", "0.95") / quantile("weft_stretch", "0.05")),
                2 * 1.645 * deviation, 2 * (0.1 + 2 * error) * deviation);
    EXPECT_NEAR(std::log(quantile("shear", "0.5") / 20), 0, (0.1 + error) * std::log(2));
    EXPECT_NEAR(std::log(quantile("shear", "0.95") / quantile("shear", "0.05")),
                2 * 1.645 * std::log(2), 2 * (0.1 + 2 * error) * std::log(2));
    EXPECT_TRUE(std::filesystem::exists(folder_ / "out/posterior.svg"));
  }
}

TEST_F(Mechanical, AResultThatWasChangedHasNoPosterior) {
  ASSERT_EQ(fit("out").status, 0);
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  const std::string file = path("out/result.json") + ": ", toml = path("out/fabric.toml") + ": ";
  const auto with = [&](const char* pointer, const json& value) {
    json other = result;
    other[json::json_pointer(pointer)] = value;
    write("out/result.json", other.dump());
    return refusal({"posterior", path("out"), "--true-cost", "--steps", "10"});
  };
  EXPECT_EQ(with("/mechanical", 5), file + "mechanical: an array is needed");
  EXPECT_THAT(with("/mechanical/0", json::object()),
              StartsWith(file + "mechanical[0].folder: is missing"));
  EXPECT_EQ(with("/mechanical/0/folder", 5), file + "mechanical[0].folder: a text is needed");
  EXPECT_EQ(with("/settings/cells", 5000000000),
            file + "settings: \"cells\": 5000000000; valid: 2 to 200");
  EXPECT_THAT(with("/certainty/overdispersion", -1),
              StartsWith(file + "certainty.overdispersion: -1"));
  EXPECT_THAT(with("/certainty/information/0", nullptr),
              StartsWith(file + "certainty.information"));
  EXPECT_THAT(with("/model", "springs"),
              StartsWith(toml + "model: \"stvk\", but \"springs\" in result.json"));
  EXPECT_THAT(with("/parameters/membrane_uu/upper", 123456),
              AllOf(StartsWith(toml + "parameters.membrane_uu.upper: "),
                    HasSubstr(", but 123456 in result.json")));
  EXPECT_THAT(with("/parameters/weft_stretch", result["parameters"]["membrane_uu"]),
              StartsWith(toml + "parameters.weft_stretch: is missing"));
  json missing = result;
  missing["certainty"]["information"][0] = nullptr;
  missing["certainty"]["information_not_finite"] = {{"0", "infinity"}};
  write("out/result.json", missing.dump());
  EXPECT_THAT(refusal({"posterior", path("out")}), StartsWith(file + "certainty.information: has"));
  missing = result;
  missing.erase("mechanical");
  write("out/result.json", missing.dump());
  EXPECT_THAT(refusal({"posterior", path("out"), "--true-cost"}),
              StartsWith(file + "mechanical: is missing"));
  missing = result;
  missing["parameters"].erase("membrane_vv");
  write("out/result.json", missing.dump());
  EXPECT_THAT(refusal({"posterior", path("out")}),
              StartsWith(file + "parameters.membrane_vv: is missing"));
  // One more digit than a double has is the same number.
  const json& found = result["parameters"]["membrane_uu"]["value"];
  json same = result;
  same["parameters"]["membrane_uu"]["value"] = found.get<double>() * (1 + 1e-14);
  write("out/result.json", same.dump());
  EXPECT_EQ(weft({"posterior", path("out"), "--steps", "10"}).status, 0);
  Fabric other = read_fabric(folder_ / "out/fabric.toml");
  other.set("membrane_uu", 500);
  write_fabric(folder_ / "out/fabric.toml", other);
  EXPECT_EQ(refusal({"posterior", path("out"), "--overwrite"}),
            fmt::format("{}parameters.membrane_uu: 500, but {} in result.json: not of the same fit",
                        toml, same["parameters"]["membrane_uu"]["value"].get<double>()));
}

TEST_F(Mechanical, IntervalsSayWhatTheMeshDoes) {
  const Outcome with = fit("with");
  ASSERT_EQ(with.status, 0) << with.err;
  const Outcome without = weft({"fit", path("strip"), "--out", path("without"), "--cells", "3",
                                "--parameters", "membrane_uu", "--no-mesh-error"});
  ASSERT_EQ(without.status, 0) << without.err;
  const json wide = json::parse(text_of(folder_ / "with/result.json")),
             narrow = json::parse(text_of(folder_ / "without/result.json"));
  EXPECT_TRUE(narrow["mesh_shift"].empty());
  // Clamped ends of a strip of 12 cells along it: some thousandths.
  const double shift = std::abs(wide["mesh_shift"]["membrane_uu"].get<double>());
  EXPECT_GT(shift, 1e-6);
  EXPECT_LT(shift, 0.01);
  const auto upper = [](const json& result) {
    return result["parameters"]["membrane_uu"]["interval_upper"].get<double>();
  };
  // exp(2 |log(1 + shift)|), to second order.
  EXPECT_NEAR(upper(wide) / upper(narrow), 1 + 2 * shift, 4 * shift * shift + 1e-9);
}

TEST_F(Mechanical, AKilledOrStoppedFitContinues) {
  const std::vector<std::vector<std::string>> orders{
      {"--start", "middle"},
      {"--model", "stvk-diagonal", "--order", "incremental", "--subdivide", "--parameters",
       "weft_stretch"},
      {"--model", "stvk-diagonal", "--order", "joint", "--subdivide", "--isotropic", "--parameters",
       "weft_stretch"},
      {"--model", "stvk-diagonal", "--order", "incremental", "--smooth", "--parameters",
       "weft_stretch"}};
  for (std::size_t i = 0; i < orders.size(); ++i) {
    const testing::ScopedTrace trace(__FILE__, __LINE__, fmt::format("order {}", i));
    const auto words = [&](const std::string& out) {
      std::vector<std::string> words{"fit", path("strip"), "--out", path(out), "--cells", "5"};
      words.insert(words.end(), orders[i].begin(), orders[i].end());
      return words;
    };
    const std::string whole = fmt::format("whole{}", i);
    const Outcome alone = weft(words(whole));
    ASSERT_EQ(alone.status, 0) << alone.err;
    // A strip is fitted exactly: a search that is at its end may ask for a point again.
    EXPECT_THAT(alone.out, ::testing::AnyOf(HasSubstr("(0 replayed)"), HasSubstr("(1 replayed)")));
    for (const int signal : {SIGKILL, SIGINT}) {
      const std::string out = fmt::format("out{}_{}", i, signal);
      ChildProcess child(command(words(out)));
      ASSERT_TRUE(child.wait_for("least squares: 1, ")) << child.err();
      child.send(signal);
      child.wait();
      ASSERT_EQ(child.status(), signal == SIGKILL ? -SIGKILL : 130) << child.err();
      EXPECT_EQ(std::filesystem::exists(folder_ / out / "result.json"), signal == SIGINT);
      EXPECT_GE(rows_of_store(out), 2);
      if (signal == SIGINT) {
        EXPECT_TRUE(without_circumstances(out)["mesh_shift"].is_null());
        EXPECT_THAT(child.out(), HasSubstr("not known: the fit was stopped"));
      }
      const Outcome continued = weft(words(out));
      ASSERT_EQ(continued.status, 0) << continued.err;
      EXPECT_THAT(continued.out, Not(HasSubstr("(0 replayed)")));
      EXPECT_THAT(continued.err, HasSubstr("(replayed)"));
      EXPECT_EQ(without_circumstances(out), without_circumstances(whole));
      EXPECT_EQ(text_of(folder_ / out / "fabric.toml"), text_of(folder_ / whole / "fabric.toml"));
    }
    if (i > 0) {
      const json stages = without_circumstances(whole)["stages"];
      EXPECT_EQ(stages[0]["captures"], json::array({"strip"}));
      EXPECT_THAT(text_of(folder_ / whole / "report.html"), HasSubstr("<h3>Stages"));
    }
    // All of it is there, and is taken.
    const int rows = rows_of_store(whole);
    std::filesystem::remove(folder_ / whole / "result.json");
    ASSERT_EQ(weft(words(whole)).status, 0);
    EXPECT_EQ(rows_of_store(whole), rows);

    if (i > 0) continue;  // the same for all orders
    std::filesystem::remove(folder_ / whole / "result.json");
    std::vector<std::string> other = words(whole);
    other.insert(other.end(), {"--force-noise", "0.01"});
    EXPECT_THAT(refusal(other), HasSubstr("mechanical_evaluations.sqlite: of another run"));
    // As another version of the program leaves it.
    run_sql(folder_ / whole / "mechanical_evaluations.sqlite",
            "UPDATE numbers SET problem = problem || '.1'");
    EXPECT_THAT(refusal(words(whole)), HasSubstr("of another run"));
    other.emplace_back("--overwrite");
    EXPECT_EQ(weft(other).status, 0);
  }
}

TEST_F(Mechanical, EvaluatesWithTheFabricThatItFound) {
  ASSERT_EQ(fit("out").status, 0);
  const Outcome outcome = weft(
      {"evaluate", path("strip"), "--fabric", path("out/fabric.toml"), "--cells", "3", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_LT(json::parse(outcome.out)["force_relative"].get<double>(), 1e-3);
}

// Three small frames of a hanging swatch say little about its stretch; the strip, cut from the same
// fabric, says it to a part in a hundred, and the two together keep that.
TEST_F(Mechanical, FitsTogetherWithAVideo) {
  Fabric truth = Fabric::with_defaults("truth");
  LayoutOptions layout;
  layout.image_width = 160;
  layout.image_height = 120;
  layout.stripe_period = 0.03;
  layout.frame_count = layout.fit_frames = 3;
  SyntheticOptions options;
  options.columns = options.rows = 13;
  options.simulation.steps_per_frame = 4;
  options.with_noise = false;
  make_synthetic_capture(folder_ / "video", make_layout(layout), truth, options);
  const double stiffness = truth.value("stretch_stiffness");
  std::string curve = "extension,load\n";
  for (int k = 0; k <= 4; ++k)
    curve +=
        fmt::format("{:.4f},{:.6f}\n", 1e3 * kLength * 0.01 * k, kWidth * stiffness * 0.01 * k);
  write("strip/curve.csv", curve);
  Fabric start = truth;
  start.set("stretch_stiffness", 3 * stiffness);
  write_fabric(folder_ / "start.toml", start);
  const std::vector<std::string> words{"fit",
                                       path("video"),
                                       path("strip"),
                                       "--out",
                                       path("both"),
                                       "--initial",
                                       path("start.toml"),
                                       "--parameters",
                                       "stretch_stiffness",
                                       "bend_stiffness",
                                       "--grid",
                                       "9",
                                       "--steps-per-frame",
                                       "2",
                                       "--iterations",
                                       "2",
                                       "--cells",
                                       "3"};
  const Outcome outcome = weft(words);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "both/result.json"));
  const json& found = result["parameters"]["stretch_stiffness"];
  EXPECT_NEAR(found["value"].get<double>(), stiffness, 0.02 * stiffness);
  // By the test, whatever the video's variability.
  EXPECT_TRUE(found["determined"].get<bool>()) << found;
  EXPECT_EQ(result["mechanical"][0]["name"], "strip");
  EXPECT_EQ(result["captures"].size(), 1u);
  const std::string page = text_of(folder_ / "both/report.html");
  EXPECT_THAT(page, HasSubstr("id=\"match\""));
  EXPECT_THAT(page, HasSubstr("id=\"tests-match\""));

  // Again, without computing anything of the test.
  const json before = without_circumstances("both");
  const int rows = rows_of_store("both");
  EXPECT_GT(rows, 5);
  std::filesystem::remove(folder_ / "both/result.json");
  const Outcome again = weft(words);
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_THAT(again.err, HasSubstr("(replayed)"));
  EXPECT_EQ(without_circumstances("both"), before);
  EXPECT_EQ(rows_of_store("both"), rows);
  EXPECT_THAT(
      refusal({"fit", path("video"), path("strip"), "--out", path("no"), "--method", "annealing"}),
      HasSubstr("--method"));
}

// A square of 0.14 m in a frame of 0.2 m: F = A G sin(gamma) cos(gamma) / (L sin(half angle)), with
// the half angle at the pulled corner acos((sqrt(2) + d / L) / 2).
TEST_F(Mechanical, FitsAPictureFrame) {
  const double side = 0.14, frame = 0.2, shear = 70;
  write("frame/capture.toml",
        "format = \"weft-capture\"\nversion = 1\nname = \"frame\"\nkind = \"mechanical\"\n"
        "test = \"picture-frame\"\n"
        "specimen = { frame_side = 0.2, side = 0.14, areal_density = 0.15 }\n"
        "[curve]\nfile = \"curve.csv\"\ndisplacement = \"crosshead\"\nforce = \"load\"\n"
        "displacement_unit = \"mm\"\n");
  std::string curve = "crosshead,load\n";
  for (int k = 0; k <= 6; ++k) {
    const double displacement = 0.01 * k;
    const double half = std::acos((std::sqrt(2.0) + displacement / frame) / 2);
    const double force =
        side * side * shear * std::cos(2 * half) * std::sin(2 * half) / (frame * std::sin(half));
    curve += fmt::format("{:g},{:.9f}\n", 1e3 * displacement, force);
  }
  write("frame/curve.csv", curve);
  const Outcome check = weft({"check", path("frame")});
  ASSERT_EQ(check.status, 0) << check.err;
  EXPECT_THAT(check.out, HasSubstr("bars        0.2 m, hinged; shear from 0 to 2"));

  const Outcome outcome = weft({"fit", path("frame"), "--out", path("out"), "--cells", "3",
                                "--parameters", "membrane_shear"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  EXPECT_NEAR(result["parameters"]["membrane_shear"]["value"], shear, 1e-3 * shear);
  EXPECT_LT(result["mechanical"][0]["force_relative"].get<double>(), 1e-4);
  // Cells do not matter.
  EXPECT_NEAR(result["mesh_shift"]["membrane_shear"].get<double>(), 0, 1e-6);
  // Force against the way of the crosshead.
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("Force of the clips"));
}

TEST_F(Mechanical, FitsOverhangsBesideAStrip) {
  write("overhang/capture.toml",
        "format = \"weft-capture\"\nversion = 1\nkind = \"mechanical\"\ntest = \"overhang\"\n"
        "specimen = { width = 0.02, areal_density = 0.2 }\n"
        "[overhang]\nlengths = [43, 44.5, 43.5]\nlength_unit = \"mm\"\n");
  const Outcome checked = weft({"check", path("overhang")});
  EXPECT_EQ(checked.status, 0) << checked.err;
  EXPECT_THAT(checked.out,
              HasSubstr("overhang    3 readings, 0.043 to 0.0445 m, mean 0.04367 m, at "
                        "41.5 degrees below the horizontal; standard deviation of one "
                        "0.00076 m"));
  const Outcome outcome = weft({"fit", path("strip"), path("overhang"), "--out", path("out"),
                                "--cells", "3", "--parameters", "membrane_uu", "bend_uu"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  EXPECT_NEAR(result["parameters"]["membrane_uu"]["value"], kStiffness + 5, 5);
  // The elastica's, of 3 cells across; the default bend_uv is a hundredth of bend_uu.
  const double rigidity = rigidity_of_overhang(0.2 * 9.81, 0.131 / 3);
  EXPECT_NEAR(result["parameters"]["bend_uu"]["value"], rigidity, 0.1 * rigidity);
  const json& overhang = result["mechanical"][1]["overhang"];
  EXPECT_NEAR(overhang["measured"], 0.131 / 3, 1e-9);
  EXPECT_NEAR(overhang["computed"], 0.131 / 3, 1e-6);
  EXPECT_LT(overhang["lower"], overhang["computed"]);
  EXPECT_GT(overhang["upper"], overhang["computed"]);
  EXPECT_EQ(overhang["x"].size(), overhang["z"].size());
  EXPECT_EQ(result["mechanical"][1]["frames"].size(), 3u);
  EXPECT_FALSE(result["mechanical"][0].contains("overhang"));
  const std::string page = text_of(folder_ / "out/report.html");
  for (const char* text : {"Overhangs", "3 readings of an overhang", "inclined plane, 41.5°"})
    EXPECT_THAT(page, HasSubstr(text));

  const Outcome evaluated = weft({"evaluate", path("overhang"), "--fabric", path("out/fabric.toml"),
                                  "--cells", "3", "--json", "--strip", path("strip.svg")});
  ASSERT_EQ(evaluated.status, 0) << evaluated.err;
  EXPECT_NEAR(json::parse(evaluated.out)["overhang"]["difference"].get<double>(), 0, 1e-6);
  EXPECT_THAT(text_of(folder_ / "strip.svg"), HasSubstr("computed strip"));
  EXPECT_THAT(text_of(folder_ / "strip.csv"), HasSubstr("computed strip,"));
  EXPECT_THAT(refusal({"evaluate", path("strip"), "--fabric", path("out/fabric.toml"), "--strip",
                       path("strip.svg")}),
              HasSubstr("--strip: capture \"strip\" is no overhang test"));
  EXPECT_THAT(refusal({"evaluate", path("overhang"), "--fabric", path("out/fabric.toml"), "--strip",
                       path("strip.csv")}),
              HasSubstr("strip.csv: a picture ends in .svg"));
}

TEST_F(Mechanical, RefusesWhatCannotBeMeant) {
  EXPECT_THAT(refusal({"fit", path("strip"), "--out", path("x"), "--grid", "25"}),
              HasSubstr("--grid"));
  EXPECT_THAT(refusal({"fit", path("strip"), "--out", path("x"), "--parameters", "bend"}),
              HasSubstr("--parameters"));
  EXPECT_THAT(refusal({"fit", path("strip"), "--out", path("x"), "--subdivide"}),
              AllOf(HasSubstr("--subdivide"), HasSubstr("\"stvk\"")));
  EXPECT_THAT(refusal({"fit", path("strip"), "--out", path("x"), "--model", "stvk-diagonal",
                       "--subdivide", "--parameters", "bend_twist"}),
              HasSubstr("bend_twist"));
  EXPECT_THAT(refusal({"fit", path("strip"), "--out", path("x"), "--model", "stvk-diagonal",
                       "--subdivide", "--parameters", "stretch_coupling"}),
              HasSubstr("--subdivide: no parameter"));
  EXPECT_THAT(refusal({"fit", path("strip"), "--out", path("x"), "--smooth"}),
              HasSubstr("--smooth: no parameter"));
  EXPECT_THAT(refusal({"fit", path("strip"), "--out", path("x"), "--model", "stvk-diagonal",
                       "--smooth", "--points", "2", "--parameters", "weft_stretch"}),
              HasSubstr("smooth curve: 2, must be in [3, 8]"));
  write("strip/curve.csv", "extension,load\n0,0\n1,two\n");
  EXPECT_THAT(refusal({"check", path("strip")}), HasSubstr("curve.csv:3"));
}

TEST_F(Mechanical, SuggestRanksTheTestThatTells) {
  write_fabric(folder_ / "known.toml", Fabric::with_defaults("known", "stvk"));
  const std::string curve =
      "curve = { displacement = [0, 10], displacement_unit = \"mm\", "
      "readings = 5 }\n";
  write("tests.toml",
        "format = \"weft-experiments\"\nversion = 1\n[[experiment]]\nname = \"warp\"\n"
        "test = \"strip\"\nspecimen = { free_length = 0.2, width = 0.05, grain_angle_deg = 90 }\n" +
            curve + "[[experiment]]\nname = \"weft\"\ncapture = \"strip\"\n");
  const std::vector<std::string> words{
      "suggest",      path("known.toml"), "--candidates", path("tests.toml"), "--cells", "4",
      "--parameters", "membrane_uu",      "--out",        path("next")};
  const Outcome outcome = weft(words);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("1  weft"));
  const json ranked = json::parse(text_of(folder_ / "next/suggestions.json"))["experiments"];
  ASSERT_EQ(ranked.size(), 2u);
  EXPECT_EQ(ranked[0]["name"], "weft");
  EXPECT_EQ(ranked[0]["capture"], path("strip"));
  EXPECT_LT(ranked[0]["remaining"], 0.1);
  EXPECT_EQ(ranked[1]["test"], "strip");
  EXPECT_EQ(ranked[1]["specimen"]["grain_angle_deg"], 90);
  EXPECT_EQ(ranked[1]["curve"]["displacement"], json({0.0, 0.01}));
  EXPECT_GT(ranked[1]["remaining"], 0.9);

  const std::string refused = refusal({"suggest", path("known.toml"), "--frames", "9"});
  EXPECT_THAT(refused, ::testing::StartsWith("--frames: "));
  EXPECT_THAT(refused, HasSubstr("is of model \"stvk\""));
  replace("tests.toml", "readings = 5", "readings = 0");
  EXPECT_THAT(refusal(words), HasSubstr("tests.toml:7: experiment[0].curve.readings"));
  replace("tests.toml", "readings = 0", "reading = 5");
  EXPECT_THAT(refusal(words), HasSubstr("reading"));
  replace("tests.toml", "capture = \"strip\"", "capture = \"stripe\"");
  replace("tests.toml", "reading = 5", "readings = 5");
  EXPECT_THAT(refusal(words), HasSubstr("stripe\" is no folder"));
}

TEST_F(Mechanical, SuggestGoesOnFromAFit) {
  const Outcome fitted = fit("out");
  ASSERT_EQ(fitted.status, 0) << fitted.err;
  const Outcome outcome = weft({"suggest", path("out"), "--cells", "4", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json ranked = json::parse(outcome.out)["experiments"];
  ASSERT_EQ(ranked.size(), 6u);
  const json result =
      json::parse(text_of(folder_ / "out/result.json"))["parameters"]["membrane_uu"];
  const json& stretch = ranked[0]["parameters"]["membrane_uu"];
  const double range = std::log(result["upper"].get<double>() / result["lower"].get<double>());
  const double half =
      0.5 *
      std::log(result["interval_upper"].get<double>() / result["interval_lower"].get<double>()) /
      range;
  EXPECT_NEAR(stretch["half_width_before"].get<double>(), half, 0.01 * half);
  for (const json& experiment : ranked) {
    EXPECT_FALSE(experiment.contains("failure")) << experiment.dump();
    EXPECT_LE(experiment["parameters"]["membrane_uu"]["half_width"], stretch["half_width_before"]);
  }
}

}  // namespace
}  // namespace weft::mechanical_test
