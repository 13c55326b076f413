#include "apps/program.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "weft/fabric/fabric.h"

namespace weft::program_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Program : public ProgramTest {};

TEST_F(Program, EachCommandHasHelpWithAnExample) {
  const Outcome help = weft({"--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_EQ(help.err, "");
  for (const std::string command :
       {"check", "surface", "register", "fit", "simulate", "render", "evaluate", "compare",
        "landscape", "variability", "posterior", "suggest", "matrix", "synthesize", "fabrics",
        "export", "cantilever", "cusick"}) {
    EXPECT_THAT(help.out, HasSubstr("\n  " + command + " ")) << command;
    const Outcome outcome = weft({command, "--help"});
    EXPECT_EQ(outcome.status, 0) << command;
    EXPECT_EQ(outcome.err, "") << command;
    EXPECT_THAT(outcome.out, HasSubstr("Example")) << command;
    EXPECT_THAT(outcome.out, HasSubstr("\n  weft " + command + " ")) << command;
  }
  EXPECT_EQ(weft({"--version"}).status, 0);
}

TEST_F(Program, ListsFabricsAsJson) {
  const Outcome outcome = weft({"fabrics", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const nlohmann::json all = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(all.size(), fabric_presets().size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Fabric& preset = fabric_presets()[i];
    EXPECT_EQ(all[i]["name"], preset.name);
    ASSERT_EQ(all[i]["parameters"].size(), 9u);
    EXPECT_EQ(all[i]["parameters"]["bend_stiffness"]["value"], preset.value("bend_stiffness"));
    EXPECT_EQ(all[i]["parameters"]["bend_stiffness"]["unit"], "N m");
    EXPECT_EQ(all[i]["parameters"]["bend_stiffness"]["lower"], 1e-7);
    EXPECT_EQ(all[i]["parameters"]["bend_stiffness"]["upper"], 1e-2);
  }
  EXPECT_EQ(weft({"fabrics"}).status, 0);
}

TEST_F(Program, WritesAScaledFabricThatItReadsBack) {
  const Outcome written = weft({"fabrics", "satin", "--scale", "bend_stiffness=3",
                                "stretch_damping=0.5", "--out", path("f.toml"), "--json"});
  ASSERT_EQ(written.status, 0) << written.err;
  const Fabric satin = find_fabric("satin");
  const Fabric scaled = read_fabric(path("f.toml"));
  EXPECT_EQ(scaled.value("bend_stiffness"), 3 * satin.value("bend_stiffness"));
  EXPECT_EQ(scaled.value("stretch_damping"), 0.5 * satin.value("stretch_damping"));
  EXPECT_EQ(scaled.value("shear_stiffness"), satin.value("shear_stiffness"));
  EXPECT_THAT(scaled.provenance, HasSubstr("bend_stiffness times 3"));
  const Outcome read = weft({"fabrics", path("f.toml"), "--json"});
  ASSERT_EQ(read.status, 0) << read.err;
  EXPECT_EQ(read.out, written.out);
}

TEST_F(Program, ExportsAFabric) {
  const std::vector<std::string> words{"export", "satin", "--to", "blender", "--spacing", "0.01"};
  EXPECT_THAT(refusal(words), HasSubstr("--areal-density"));
  auto complete = words;
  complete.insert(complete.end(), {"--areal-density", "0.2", "--out", path("satin.py"), "--json"});
  const Outcome outcome = weft(complete);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const nlohmann::json said = nlohmann::json::parse(outcome.out);
  EXPECT_GT(said["settings"]["tension_stiffness"].get<double>(), 0);
  EXPECT_FALSE(said["lost"].empty());
  EXPECT_THAT(text_of(path("satin.py")), HasSubstr("import bpy"));
  auto elsewhere = complete;
  elsewhere[3] = "houdini";
  EXPECT_THAT(refusal(elsewhere), HasSubstr("--to"));
}

TEST_F(Program, ExportsAModel) {
  const std::vector<std::string> words{"export", "satin",           "--to", "mujoco", "--spacing",
                                       "0.02",   "--areal-density", "0.2"};
  EXPECT_THAT(refusal(words), HasSubstr("--cells"));
  auto complete = words;
  complete.insert(complete.end(),
                  {"--cells", "4", "3", "--hold", "edge", "--out", path("satin.xml"), "--json"});
  const Outcome outcome = weft(complete);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const nlohmann::json said = nlohmann::json::parse(outcome.out);
  EXPECT_GT(said["settings"]["timestep"].get<double>(), 0);
  EXPECT_FALSE(said["lost"].empty());
  EXPECT_THAT(text_of(path("satin.xml")),
              HasSubstr("<body name=\"cloth_4_0\" pos=\"0.08 0 0\" mocap"));
  auto with_rate = complete;
  with_rate.insert(with_rate.end(), {"--frame-rate", "30"});
  EXPECT_THAT(refusal(with_rate), HasSubstr("--frame-rate"));
  auto elsewhere = complete;
  elsewhere[3] = "blender";
  EXPECT_THAT(refusal(elsewhere), HasSubstr("--cells: is for mujoco"));
}

TEST_F(Program, ExportsAMaterial) {
  const std::vector<std::string> words{"export", "satin",           "--to",
                                       "arcsim", "--areal-density", "0.2"};
  auto complete = words;
  complete.insert(complete.end(), {"--out", path("satin.json"), "--json"});
  const Outcome outcome = weft(complete);
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_GT(nlohmann::json::parse(outcome.out)["settings"]["wind_density"].get<double>(), 0);
  const Outcome read = weft({"export", path("satin.json"), "--to", "arcsim"});
  EXPECT_EQ(read.status, 0) << read.err;
  auto of_a_grid = words;
  of_a_grid.insert(of_a_grid.end(), {"--mesh", "alternating"});
  EXPECT_THAT(weft(of_a_grid).out, HasSubstr("a grid along the threads whose diagonals alternate"));
  EXPECT_THAT(refusal({"export", "satin", "--to", "blender", "--areal-density", "0.2", "--spacing",
                       "0.01", "--mesh", "any"}),
              HasSubstr("--mesh: is for arcsim"));
  auto with_spacing = words;
  with_spacing.insert(with_spacing.end(), {"--spacing", "0.01"});
  EXPECT_THAT(refusal(with_spacing), HasSubstr("--spacing: is for blender and mujoco"));
  EXPECT_THAT(
      refusal({"export", "satin", "--to", "mujoco", "--areal-density", "0.2", "--cells", "4", "3"}),
      HasSubstr("--spacing: needed"));
}

TEST_F(Program, SynthesizesACaptureShorterThanItsUsualFitFrames) {
  const Outcome made = weft({"synthesize", "--fabric", "satin", "--out", path("c"), "--frames", "2",
                             "--grid", "9", "--steps-per-frame", "2"});
  ASSERT_EQ(made.status, 0) << made.err;
  const Outcome checked = weft({"check", path("c")});
  EXPECT_EQ(checked.status, 0) << checked.err;
  EXPECT_THAT(checked.out,
              AllOf(HasSubstr("2 frames at 30 1/s, fit frames 0 to 1"), Not(HasSubstr("hem"))));
  replace("c/capture.toml", "hem_width = 0 ", "hem_width = 0.01 ");
  EXPECT_THAT(weft({"check", path("c")}).out, HasSubstr("hem         0.01 m\n"));
}

}  // namespace
}  // namespace weft::program_test
