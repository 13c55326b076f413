/// The computed rig and fits of curves through the program.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "weft/fabric/fabric.h"

namespace weft {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class Rig : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    Fabric fabric = Fabric::with_defaults("tricot", "stvk-diagonal");
    fabric.areal_density = 0.2;
    fabric.set_curve("weft_stretch", {Vec2(0, 0.3), Vec2(200, 400)});
    write_fabric(folder_ / "tricot.toml", fabric);
  }
  Outcome synthesize(const std::vector<std::string>& tests) const {
    std::vector<std::string> words{"synthesize", "--rig",   "--fabric", path("tricot.toml"),
                                   "--out",      path("r"), "--steps",  "3",
                                   "--cells",    "3",       "--tests"};
    words.insert(words.end(), tests.begin(), tests.end());
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
  EXPECT_EQ(result["stages"][0]["name"], "weft_stretch");
  const Fabric found = read_fabric(folder_ / "out/fabric.toml");
  EXPECT_EQ(found.value_count("weft_stretch"), 2);
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
}

}  // namespace
}  // namespace weft
