/// The computed rig and fits of curves through the program.
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "weft/fabric/fabric.h"

namespace weft::rig_test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

class Rig : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    Fabric fabric = Fabric::with_defaults("tricot", "stvk-diagonal");
    fabric.areal_density = 0.2;
    fabric.set_curve("weft_stretch", {Vec2(0, 0.3), Vec2(200, 400)});
    write_fabric(folder_ / "tricot.toml", fabric);
  }
  Outcome synthesize(const std::vector<std::string>& tests,
                     const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{"synthesize", "--rig",   "--fabric", path("tricot.toml"),
                                   "--out",      path("r"), "--steps",  "3",
                                   "--cells",    "3",       "--tests"};
    words.insert(words.end(), tests.begin(), tests.end());
    words.insert(words.end(), more.begin(), more.end());
    return weft(words);
  }
};

TEST_F(Rig, WhatItMakesIsFittedByCurves) {
  const Outcome made = synthesize({"stretch_weft", "bend_weft"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("stretch_weft: 7 frames of tricot"));
  EXPECT_EQ(weft({"check", path("r/bend_weft")}).status, 0);

  const Outcome fit =
      weft({"fit", path("r/stretch_weft"), path("r/bend_weft"), "--out", path("out"), "--model",
            "stvk-diagonal", "--order", "incremental", "--subdivide", "--points", "2", "--cells",
            "3", "--parameters", "weft_stretch", "shear", "weft_bend"});
  ASSERT_EQ(fit.status, 0) << fit.err;
  EXPECT_THAT(fit.out, HasSubstr("no capture isolates them: shear"));
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  const json curve = result["curves"]["weft_stretch"];
  ASSERT_EQ(curve["values"].size(), 2u);
  EXPECT_EQ(curve["strain"].size(), curve["upper"].size());
  EXPECT_NEAR(curve["values"][1].get<double>(), 400, 20);
  EXPECT_EQ(result["stages"][0]["name"], "weft_bend");  // roughly, before what it folds
  EXPECT_EQ(result["stages"][0]["captures"], json({"tricot_bend_weft"}));
  EXPECT_EQ(result["stages"][1]["name"], "weft_stretch");
  EXPECT_EQ(result["stages"][1]["captures"], json({"tricot_stretch_weft"}));
  const Fabric found = read_fabric(folder_ / "out/fabric.toml");
  EXPECT_EQ(found.value_count("weft_stretch"), 2);
}

TEST_F(Rig, KnownForcesAreFittedByPoses) {
  const Outcome made = synthesize({"stretch_weft"}, {"--known-forces"});
  ASSERT_EQ(made.status, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("stretch_weft: 6 frames of tricot"));
  const Outcome check = weft({"check", path("r/stretch_weft")});
  ASSERT_EQ(check.status, 0) << check.err;
  EXPECT_THAT(check.out, HasSubstr("not held, 2 g, a cord to a pulley of up to"));

  const Outcome fit = weft({"fit", path("r/stretch_weft"), "--out", path("out"), "--model",
                            "stvk-diagonal", "--order", "incremental", "--subdivide", "--points",
                            "2", "--cells", "3", "--parameters", "weft_stretch"});
  ASSERT_EQ(fit.status, 0) << fit.err;
  EXPECT_THAT(fit.out, HasSubstr("stretch_weft: "));
  const json result = json::parse(text_of(folder_ / "out/result.json"));
  const json curve = result["curves"]["weft_stretch"];
  const double knot = curve["knots"][1].get<double>(), expected = 200 + 200 * knot / 0.3;
  EXPECT_NEAR(curve["values"][1].get<double>(), expected, 0.03 * expected);
  const json test = result["mechanical"][0];
  EXPECT_EQ(test["loaded_clips"][0]["name"], "right");
  EXPECT_EQ(test["loaded_clips"][0]["force"].size(), 6u);
  EXPECT_THAT(text_of(folder_ / "out/report.html"),
              HasSubstr("Way of the clips under known forces"));

  const Outcome evaluated = weft({"evaluate", path("r/stretch_weft"), "--fabric",
                                  path("out/fabric.toml"), "--cells", "3", "--json"});
  ASSERT_EQ(evaluated.status, 0) << evaluated.err;
  const json pose = json::parse(evaluated.out)["pose"];
  // Noise of 0.0125 mm a coordinate.
  EXPECT_LT(pose["position_rms"].get<double>(), 3 * std::sqrt(3.0) * 12.5e-6);
  EXPECT_GT(pose["rotation_rms"].get<double>(), 0);

  write("next.toml",
        "format = \"weft-experiments\"\nversion = 1\n[[experiment]]\nname = \"pull\"\n"
        "capture = \"r/stretch_weft\"\n");
  const Outcome next =
      weft({"suggest", path("out/fabric.toml"), "--candidates", path("next.toml"), "--cells", "3",
            "--parameters", "weft_stretch_1", "--out", path("next")});
  ASSERT_EQ(next.status, 0) << next.err;
  const json ranked = json::parse(text_of(folder_ / "next/suggestions.json"))["experiments"];
  EXPECT_LT(ranked[0]["remaining"], 0.9);
}

TEST_F(Rig, RefusesOptionsOfTheOtherKind) {
  EXPECT_THAT(refusal({"synthesize", "--rig", "--fabric", path("tricot.toml"), "--out", path("x"),
                       "--frames", "3"}),
              HasSubstr("--frames"));
  EXPECT_THAT(refusal({"synthesize", "--fabric", "satin", "--out", path("x"), "--loops", "2"}),
              HasSubstr("--loops"));
  ASSERT_EQ(synthesize({"bend_weft"}).status, 0);
  EXPECT_THAT(refusal({"fit", path("r/bend_weft"), "--out", path("x"), "--model", "springs",
                       "--subdivide", "--linear"}),
              HasSubstr("exclude"));
  EXPECT_THAT(refusal({"fit", path("r/bend_weft"), "--out", path("x"), "--model", "springs",
                       "--subdivide", "--smooth"}),
              HasSubstr("exclude"));
}

}  // namespace
}  // namespace weft::rig_test
