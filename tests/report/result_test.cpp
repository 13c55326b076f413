#include "weft/report/result.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "common/temporary_folder.h"
#include "report/sample_report.h"
#include "weft/base/error.h"

namespace weft::result_test {
namespace {

using nlohmann::json;
using test::infinity;
using test::sample_report;
using ::testing::HasSubstr;

std::string error_of(const std::string& text) {
  try {
    result_from_json(text, "result.json");
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

/// The sample's file with one change.
std::string changed(const std::function<void(json&)>& change) {
  json parsed = json::parse(result_to_json(sample_report()));
  change(parsed);
  return parsed.dump();
}

TEST(Result, SearchesComeBack) {
  const json file = json::parse(result_to_json(sample_report()));
  ASSERT_EQ(file["searches"].size(), 2u);
  EXPECT_EQ(file["searches"][0]["seed"], 18446744073709551615u);
  EXPECT_EQ(file["searches"][0]["kept"], true);
  EXPECT_EQ(file["searches"][1]["error_not_finite"], "infinity");
  EXPECT_EQ(file["searches"][1]["values"]["drag_linear"], 0.5);
  const Report back = result_from_json(result_to_json(sample_report()), "result.json");
  ASSERT_EQ(back.searches.size(), 2u);
  EXPECT_EQ(back.searches[1].seed, 7u);
  EXPECT_EQ(back.searches[1].error, infinity);
  EXPECT_EQ(back.searches[1].evaluations, 15u);
  EXPECT_FALSE(back.searches[1].kept);
  EXPECT_EQ(back.searches[1].values, (std::vector<double>{1e-7, 0, 0.5, 1e-7}));
  EXPECT_THAT(error_of(changed([](json& j) { j["searches"][1]["values"].erase("drag_linear"); })),
              HasSubstr("drag_linear"));
  // One search has none to compare with.
  EXPECT_TRUE(result_from_json(changed([](json& j) { j.erase("searches"); }), "result.json")
                  .searches.empty());
}

TEST(Result, CertaintyComesBackWithWhatIsNotFinite) {
  Report report = sample_report();
  report.certainty->condition = infinity;
  report.certainty->overdispersion = 1.5;
  const json file = json::parse(result_to_json(report));
  const json& certainty = file["certainty"];
  EXPECT_EQ(certainty["condition"], nullptr);
  EXPECT_EQ(certainty["condition_not_finite"], "infinity");
  EXPECT_EQ(certainty["correlation"][2], -0.5);
  EXPECT_EQ(certainty["correlation"][1], nullptr);
  EXPECT_EQ(certainty["correlation_not_finite"]["1"], "nan");
  EXPECT_EQ(file["parameters"]["drag_linear"]["at_bound"], "upper");
  EXPECT_THAT(file["warnings"].dump(), HasSubstr("The condition number of the problem is ∞"));

  const Report back = result_from_json(file.dump(), "result.json");
  ASSERT_TRUE(back.certainty);
  EXPECT_EQ(back.certainty->condition, infinity);
  EXPECT_EQ(back.certainty->noise, 1.25);
  EXPECT_EQ(back.certainty->dispersion, 1e-4);
  EXPECT_EQ(back.certainty->overdispersion, 1.5);
  EXPECT_EQ(back.certainty->frames_per_cluster, 5);
  EXPECT_EQ(back.parameters[0].prior_median, 2e-5);
  EXPECT_EQ(back.parameters[0].prior_factor, 3);
  EXPECT_EQ(back.certainty->parameters, sample_report().certainty->parameters);
  EXPECT_EQ(back.certainty->information, sample_report().certainty->information);
  EXPECT_TRUE(std::isnan(back.certainty->correlation(0, 1)));
  EXPECT_EQ(back.certainty->correlation(0, 2), -0.5);

  EXPECT_THAT(error_of(changed([](json& j) { j["certainty"]["information"].erase(0); })),
              HasSubstr("certainty.information: has 8 numbers instead of 3 x 3"));
  // Files of before have none.
  EXPECT_FALSE(result_from_json(changed([](json& j) { j.erase("certainty"); }), "r").certainty);
}

TEST(Result, SaysWhatWasFoundAndHowItWasMade) {
  const json file = json::parse(result_to_json(sample_report()));
  EXPECT_EQ(file["format"], "weft-result");
  EXPECT_EQ(file["version"], 1);
  EXPECT_EQ(file["error"], 0.0123456789012345678);
  EXPECT_EQ(file["evaluations"], 40);
  EXPECT_EQ(file["diverged"], 3);
  EXPECT_EQ(file["wall_s"], 12.5);
  EXPECT_EQ(file["method"], "coarse search, then annealing");
  EXPECT_EQ(file["seed"], 18446744073709551615u);
  EXPECT_EQ(file["program_version"], "1.2.3");
  EXPECT_EQ(file["command"], "weft fit sample --out out");
  EXPECT_EQ(file["settings"]["columns"], 25);
  EXPECT_EQ(file["settings"]["cached"], true);
  const json& bend = file["parameters"]["bend_stiffness"];
  EXPECT_EQ(bend["value"], 3.2e-5);
  EXPECT_EQ(bend["unit"], "N m");
  EXPECT_EQ(bend["lower"], 1e-7);
  EXPECT_EQ(bend["upper"], 1e-2);
  EXPECT_EQ(bend["initial"], 1e-5);
  EXPECT_EQ(bend["variability"], 2.5);
  EXPECT_EQ(bend["determined"], true);
  EXPECT_TRUE(bend["at_bound"].is_null());
  EXPECT_EQ(file["parameters"]["drag_linear"]["at_bound"], "upper");
  EXPECT_EQ(file["captures"][0]["fit"]["frames"], 2);
  EXPECT_DOUBLE_EQ(file["captures"][0]["fit"]["distance_mean"], 0.0015);
  EXPECT_DOUBLE_EQ(file["captures"][0]["validation"]["fold"], 35);
}

TEST(Result, NumbersThatAreNotFiniteAreNullWithAWordBeside) {
  const json file = json::parse(result_to_json(sample_report()));
  EXPECT_TRUE(file["error_initial"].is_null());
  EXPECT_EQ(file["error_initial_not_finite"], "infinity");
  EXPECT_FALSE(file.contains("error_not_finite"));
  EXPECT_TRUE(file["parameters"]["bend_damping"]["variability"].is_null());
  EXPECT_EQ(file["parameters"]["bend_damping"]["variability_not_finite"], "infinity");
  // Absent is null alone.
  EXPECT_TRUE(file["parameters"]["shear_stiffness"]["variability"].is_null());
  EXPECT_FALSE(file["parameters"]["shear_stiffness"].contains("variability_not_finite"));
  EXPECT_EQ(file["history"]["error"][0], 5);
  EXPECT_TRUE(file["history"]["error"][1].is_null());
  EXPECT_EQ(file["history"]["error_not_finite"],
            json::parse(R"({"1": "infinity", "4": "infinity"})"));
  EXPECT_EQ(file["surfaces"][0]["y"]["estimate_not_finite"], "nan");
}

TEST(Result, ReadsBackWhatItWrote) {
  const Report report = sample_report();
  const std::string text = result_to_json(report);
  const Report back = result_from_json(text, "result.json");
  // The writer covers every field, so that equal texts mean equal reports; spot checks of what the
  // writer might lose.
  EXPECT_EQ(result_to_json(back), text);
  EXPECT_EQ(back.seed, report.seed);
  EXPECT_EQ(back.error_initial, infinity);
  ASSERT_EQ(back.parameters.size(), 4u);
  EXPECT_EQ(back.parameters[0].name, "bend_stiffness");
  EXPECT_EQ(back.parameters[1].variability_percent, infinity);
  EXPECT_EQ(back.parameters[2].scale, ReportParameter::Scale::shifted_logarithmic);
  EXPECT_EQ(back.parameters[2].at_bound, ReportParameter::Bound::upper);
  EXPECT_FALSE(back.parameters[3].variability_percent.has_value());
  EXPECT_FALSE(back.parameters[3].free);
  ASSERT_EQ(back.settings.size(), report.settings.size());
  EXPECT_EQ(back.settings, report.settings);
  ASSERT_EQ(back.captures.size(), 1u);
  EXPECT_EQ(back.captures[0].rows, 21);
  ASSERT_EQ(back.captures[0].frames.size(), 4u);
  EXPECT_EQ(back.captures[0].frames[3].distance->max, report.captures[0].frames[3].distance->max);
  ASSERT_EQ(back.history.size(), 7u);
  EXPECT_EQ(back.history[4].error, infinity);
  EXPECT_EQ(back.history[4].phase, "anneal");
  EXPECT_EQ(back.perturbations[0].quadratic[2], 4);
  EXPECT_EQ(back.surfaces[0].error(1, 1), infinity);
  EXPECT_EQ(back.surfaces[0].error(1, 2), 6);
  EXPECT_TRUE(std::isnan(back.surfaces[0].y_estimate));
  EXPECT_FALSE(back.surfaces[0].y_logarithmic);
  EXPECT_EQ(back.matrix->error(1, 2), infinity);
  EXPECT_EQ(back.remarks, report.remarks);
}

TEST(Result, AnEmptyReportReadsBack) {
  const std::string text = result_to_json({});
  EXPECT_EQ(result_to_json(result_from_json(text, "result.json")), text);
  EXPECT_FALSE(result_from_json(text, "result.json").matrix.has_value());
}

TEST(Result, FramesOfADivergedSimulationReadBack) {
  Report report = sample_report();
  report.captures[0].frames[1].error = infinity;
  report.captures[0].frames[1].distance->mean = std::nan("");
  const Report back = result_from_json(result_to_json(report), "result.json");
  EXPECT_EQ(back.captures[0].frames[1].error, infinity);
  EXPECT_TRUE(std::isnan(back.captures[0].frames[1].distance->mean));
}

TEST(Result, BytesThatAreNoUtf8AreReplaced) {
  Report report = sample_report();
  report.captures[0].name = "caf\xE9";
  EXPECT_EQ(result_from_json(result_to_json(report), "result.json").captures[0].name, "caf\uFFFD");
}

TEST(Result, UnknownKeysArePassedOver) {
  const std::string text = changed([](json& file) {
    file["later"] = 1;
    file["parameters"]["bend_stiffness"]["interval90"] = {1, 2};
  });
  EXPECT_EQ(error_of(text), "");
}

TEST(Result, BadFilesAreRejectedByName) {
  EXPECT_EQ(error_of("{\n\"a\": }"), "result.json:2: is not JSON");
  EXPECT_THAT(error_of("[]"), HasSubstr("an object is needed"));
  EXPECT_THAT(error_of("{}"), HasSubstr("format"));
  EXPECT_THAT(error_of(changed([](json& f) { f["version"] = 2; })),
              HasSubstr("version: 1 is needed"));
  EXPECT_THAT(error_of(changed([](json& f) { f.erase("seed"); })), HasSubstr("seed: is missing"));
  EXPECT_THAT(error_of(changed([](json& f) { f["method"] = 3; })),
              HasSubstr("method: has a wrong type"));
  EXPECT_THAT(error_of(changed([](json& f) { f["error"] = "1"; })),
              HasSubstr("error: a number is needed"));
  EXPECT_THAT(error_of(changed([](json& f) { f["error"] = nullptr; })),
              HasSubstr("\"error_not_finite\" does not say why"));
  EXPECT_THAT(
      error_of(changed([](json& f) { f["parameters"]["bend_stiffness"]["at_bound"] = "left"; })),
      HasSubstr("parameters.bend_stiffness.at_bound"));
  EXPECT_THAT(error_of(changed([](json& f) { f["parameters"]["bend_stiffness"]["scale"] = "?"; })),
              HasSubstr("parameters.bend_stiffness.scale"));
  EXPECT_THAT(error_of(changed([](json& f) { f["captures"][0]["frames"][2].erase("fold"); })),
              HasSubstr("captures[0].frames[2].fold: is missing"));
  EXPECT_THAT(error_of(changed([](json& f) { f["history"]["best"].erase(0); })),
              HasSubstr("history"));
  EXPECT_THAT(error_of(changed([](json& f) { f["history"].erase("error_not_finite"); })),
              HasSubstr("history.error: element 1 is null"));
  EXPECT_THAT(error_of(changed([](json& f) { f["surfaces"][0]["error"].erase(5); })),
              HasSubstr("surfaces[0].error: has 5 numbers instead of 2 x 3"));
  EXPECT_THAT(error_of(changed([](json& f) { f["captures"][0]["fit_frames"] = {1}; })),
              HasSubstr("captures[0].fit_frames: two integers"));
}

TEST(Result, NumbersThatNoFitFindsAreRefused) {
  const auto with = [](const char* where, const json& value) {
    return error_of(changed([&](json& f) { f[json::json_pointer(where)] = value; }));
  };
  EXPECT_EQ(
      with("/evaluations", -3),
      "result.json: evaluations: an integer from 0 to 18446744073709551615 is needed, not -3");
  EXPECT_THAT(with("/threads", 5000000000),
              HasSubstr("threads: an integer from -2147483648 to 2147483647 is needed, not 5000"));
  EXPECT_THAT(with("/threads", 2.5), HasSubstr("threads: an integer"));
  EXPECT_THAT(with("/seed", true), HasSubstr("seed: an integer"));
  EXPECT_THAT(with("/captures/0/fit_frames", {0, 5000000000}),
              HasSubstr("captures[0].fit_frames: an integer"));
  EXPECT_THAT(with("/history/evaluation/2", -1), HasSubstr("history.evaluation: an integer"));
  EXPECT_THAT(with("/settings/columns", 18446744073709551615u),
              HasSubstr("settings.columns: an integer"));
  EXPECT_EQ(with("/certainty/overdispersion", -1),
            "result.json: certainty.overdispersion: -1; at least 1 is needed");
  EXPECT_THAT(with("/certainty/overdispersion", 0.99), HasSubstr("at least 1"));
  EXPECT_EQ(with("/certainty/overdispersion", 1), "");
  EXPECT_THAT(with("/certainty/frames_per_cluster", 0), HasSubstr("frames_per_cluster: 0; at"));
  EXPECT_EQ(with("/certainty/information/8", -10000),
            "result.json: certainty.information: element 8 is -10000; on the diagonal at least 0 "
            "is needed");
  EXPECT_THAT(with("/certainty/covariance/0", -4e-4),
              HasSubstr("covariance: element 0 is -0.0004"));
  EXPECT_EQ(with("/certainty/information/4", -1e-12), "") << "rounding is no error";
}

TEST(Result, ANumberThatNoDoubleHoldsIsRefusedByLine) {
  std::string text = result_to_json(sample_report());
  const std::string wall = "\"wall_s\": 12.5";
  const std::size_t at = text.find(wall);
  ASSERT_NE(at, std::string::npos);
  const auto line = 1 + std::count(text.begin(), text.begin() + std::ptrdiff_t(at), '\n');
  text.replace(at, wall.size(), "\"wall_s\": 1e999");
  EXPECT_EQ(error_of(text),
            "result.json:" + std::to_string(line) + ": 1e999 is too large for a number");
}

TEST(Result, FilesAreWrittenAndRead) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "result.json";
  write_result(path, sample_report());
  EXPECT_EQ(result_to_json(read_result(path)), result_to_json(sample_report()));
  std::filesystem::remove(path);
  EXPECT_THROW(read_result(path), Error);
  EXPECT_THROW(write_result(path / "no" / "result.json", sample_report()), Error);
}

}  // namespace
}  // namespace weft::result_test
