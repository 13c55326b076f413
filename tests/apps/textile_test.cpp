#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "weft/estimate/cantilever.h"
#include "weft/fabric/fabric.h"
#include "weft/fabric/prior.h"
#include "weft/vision/video.h"

namespace weft::textile_test {
namespace {

using ::testing::HasSubstr;

class Textile : public ProgramTest {
 protected:
  static nlohmann::json json_of(std::vector<std::string> arguments) {
    arguments.emplace_back("--json");
    const Outcome outcome = weft(arguments);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out);
  }
};

// 0.2 kg/m^2 weigh 1.96133 N/m^2; c = 0.05 m, G = w c^3 = 2.4517e-4 N m.
TEST_F(Textile, OverhangGivesTheRigidityAndAFabric) {
  const auto result = json_of({"cantilever", "--overhang", "0.1", "--areal-density", "0.2"});
  EXPECT_NEAR(result["standard_rigidity"], 2.45166e-4, 1e-8);
  EXPECT_NEAR(result["rigidity"], 2.45166e-4, 1e-3 * 2.45166e-4);
  const Outcome written = weft({"cantilever", "--overhang", "0.1", "--areal-density", "0.2",
                                "--fabric", "satin", "--out", path("f.toml")});
  ASSERT_EQ(written.status, 0) << written.err;
  EXPECT_THAT(written.out, HasSubstr("ASTM D1388"));
  const Fabric fabric = read_fabric(path("f.toml"));
  EXPECT_EQ(fabric.value("bend_stiffness"), result["rigidity"]);
  EXPECT_THAT(fabric.provenance, HasSubstr("cantilever"));
}

// 1 mm of 0.1 m is 3 % of the rigidity.
TEST_F(Textile, OverhangGivesAPrior) {
  const std::vector<std::string> words{"cantilever",      "--overhang", "0.1",
                                       "--areal-density", "0.2",        "--fabric",
                                       "satin",           "--prior",    path("p.toml")};
  const auto result = json_of(words);
  const std::vector<ParameterPrior> priors = read_priors(path("p.toml"));
  ASSERT_EQ(priors.size(), 1u);
  EXPECT_EQ(priors[0].parameter, "bend_stiffness");
  EXPECT_EQ(priors[0].median, result["rigidity"]);
  EXPECT_NEAR(std::log(priors[0].factor), 0.03, 1e-12);
  EXPECT_EQ(result["priors"]["bend_stiffness"]["factor"], priors[0].factor);
  EXPECT_THAT(weft(words).out, HasSubstr("bend_stiffness     prior = { median = "));
  EXPECT_THAT(refusal({"cantilever", "--overhang", "0.1", "--areal-density", "0.2", "--prior",
                       path("p.toml")}),
              HasSubstr("--fabric"));
  EXPECT_THAT(refusal({"cantilever", "--overhang", "0.1", "--areal-density", "0.2", "--deviation",
                       "0.002"}),
              HasSubstr("--deviation: means nothing without --prior"));
}

TEST_F(Textile, ProfileGivesMomentsAndTheLaw) {
  const double density = 0.5, rigidity = 1e-3;
  const ElasticaProfile bent = heavy_elastica(rigidity, density * kStandardGravity, 0.15);
  std::string text = "x,y\n";
  for (Eigen::Index i = 0; i < bent.at.cols(); i += 4)
    text += std::to_string(bent.at(0, i)) + "," + std::to_string(bent.at(1, i)) + "\n";
  write("profile.csv", text);
  const auto result = json_of(
      {"cantilever", path("profile.csv"), "--areal-density", "0.5", "--curve", path("curve.csv")});
  EXPECT_NEAR(result["root_moment"], bent.moment[0], 1e-3 * bent.moment[0]);
  EXPECT_NEAR(result["constant"]["rigidity"], rigidity, 1e-2 * rigidity);
  EXPECT_THAT(text_of(folder_ / "curve.csv"), HasSubstr("arc,x,y,moment,curvature"));
}

TEST_F(Textile, ProfileOfFewPointsNeedsNoWindow) {
  const ElasticaProfile bent = heavy_elastica(1e-3, 0.5 * kStandardGravity, 0.15);
  std::string text = "x,y\n";
  for (Eigen::Index i = 0; i < bent.at.cols(); i += 20)
    text += std::to_string(bent.at(0, i)) + "," + std::to_string(bent.at(1, i)) + "\n";
  write("few.csv", text);
  EXPECT_NEAR(json_of({"cantilever", path("few.csv"), "--areal-density", "0.5"})["length"], 0.15,
              1e-4);
  EXPECT_THAT(refusal({"cantilever", path("few.csv"), "--areal-density", "0.5", "--curve",
                       path("curve.csv"), "--window", "0.01"}),
              AllOf(HasSubstr("few.csv: --window 0.01: "), HasSubstr("8 are needed")));
}

TEST_F(Textile, RefusesAProfileTheWrongWayUp) {
  const ElasticaProfile bent = heavy_elastica(1e-3, 0.5 * kStandardGravity, 0.15);
  std::string text = "x,y\n";
  for (Eigen::Index i = 0; i < bent.at.cols(); i += 4)
    text += std::to_string(bent.at(0, i)) + "," + std::to_string(-bent.at(1, i)) + "\n";
  write("down.csv", text);
  EXPECT_THAT(refusal({"cantilever", path("down.csv"), "--areal-density", "0.5"}),
              AllOf(HasSubstr("down.csv: "), HasSubstr("y is up")));
}

TEST_F(Textile, PhotographGivesTheProfile) {
  // A bright band, 6 px wide, along the elastica; 0.5 mm a pixel, from the left border.
  const ElasticaProfile bent = heavy_elastica(1e-3, 0.5 * kStandardGravity, 0.15);
  Image image = Image::Constant(300, 330, 0.02f);
  for (int i = 0; i < image.rows(); ++i)
    for (int j = 0; j < image.cols(); ++j) {
      const Vec2 p = 5e-4 * Vec2(j + 0.5, 40 - (i + 0.5));
      const double distance = (bent.at.colwise() - p).colwise().norm().minCoeff();
      if (distance < 1.5e-3) image(i, j) = 0.9f;
    }
  write_png(folder_ / "photo.png", image);
  const auto result =
      json_of({"cantilever", path("photo.png"), "--pixel", "5e-4", "--areal-density", "0.5"});
  // The ends are known to some pixels of 300: 2 % of the length, 4 % of the moment.
  EXPECT_NEAR(result["root_moment"], bent.moment[0], 0.04 * bent.moment[0]);
  EXPECT_THAT(refusal({"cantilever", path("photo.png"), "--areal-density", "0.5"}),
              HasSubstr("--pixel"));
}

TEST_F(Textile, DrapeOfAFabricAndOfItsShadow) {
  write("kes.toml",
        "format = \"weft-kes\"\nversion = 1\nW = 15\n[weft]\nEMT = 5\nG = 0.6\nB = 0.1\n"
        "[warp]\nEMT = 4\nG = 0.6\nB = 0.1\n");
  const auto result = json_of({"cusick", path("kes.toml"), "--starts", "2", "--rings", "4",
                               "--sectors", "36", "--out", path("drape.obj")});
  ASSERT_EQ(result["drapes"].size(), 2u);
  EXPECT_GT(result["drape_coefficient"], 0.2);
  EXPECT_LT(result["drape_coefficient"], 0.95);
  EXPECT_THAT(text_of(folder_ / "drape.obj"), HasSubstr("vt "));

  Image shadow = Image::Constant(200, 200, 1.0f);
  for (int i = 0; i < 200; ++i)
    for (int j = 0; j < 200; ++j)
      if (Vec2(j - 99.5, i - 99.5).norm() < 60) shadow(i, j) = 0;
  write_png(folder_ / "shadow.png", shadow);
  const auto measured = json_of({"cusick", "--shadow", path("shadow.png"), "--pixel", "0.002"});
  // (0.12^2 - 0.09^2) / (0.15^2 - 0.09^2), of a circle of 60 px.
  EXPECT_NEAR(measured["drape_coefficient"], 0.4375, 0.01);
  EXPECT_EQ(measured["lobes"], 0);
  for (const std::string pixel : {"0.01", "1e-6"})
    EXPECT_THAT(refusal({"cusick", "--shadow", path("shadow.png"), "--pixel", pixel}),
                AllOf(HasSubstr("shadow.png: drape: a shadow of "), HasSubstr("must be in [0, 1]"),
                      HasSubstr("are --pixel, --radius and --support right?")));
}

// The coefficient gives the bend back on the same mesh from the same starts, but for the folds that
// come and go: a mean of two drapes is the same for several bends that are some per cent apart.
TEST_F(Textile, DrapeCoefficientGivesTheBend) {
  Fabric fabric = Fabric::with_defaults("cloth", "baraff-witkin");
  fabric.areal_density = 0.15;
  fabric.set("bend_stiffness", 3e-5);
  write_fabric(folder_ / "true.toml", fabric);
  fabric.set("bend_stiffness", 6e-5);
  write_fabric(folder_ / "start.toml", fabric);
  const std::vector<std::string> coarse{"--starts", "2", "--rings", "4", "--sectors", "36"};
  const auto with = [&](std::vector<std::string> words) {
    words.insert(words.end(), coarse.begin(), coarse.end());
    return words;
  };
  const double measured = json_of(with({"cusick", path("true.toml")}))["drape_coefficient"];
  const auto result = json_of(
      with({"cusick", path("start.toml"), "--fit", std::to_string(measured), "--fit-deviation",
            "0.01", "--out", path("found.toml"), "--prior", path("known.toml")}));
  EXPECT_NEAR(result["factor"], 0.5, 0.05);
  EXPECT_LT(result["factor_lower"], 0.5);
  EXPECT_GT(result["factor_upper"], 0.5);
  EXPECT_NEAR(result["drape_coefficient"], measured, 0.003);
  const Fabric found = read_fabric(path("found.toml"));
  EXPECT_NEAR(found.value("bend_stiffness"), 6e-5 * result["factor"].get<double>(), 1e-12);
  EXPECT_EQ(found.value("stretch_stiffness"), fabric.value("stretch_stiffness"));
  EXPECT_THAT(found.provenance, HasSubstr("drape coefficient"));

  // 90 % of the prior are the interval: 2 x 1.645 deviations.
  const std::vector<ParameterPrior> priors = read_priors(path("known.toml"));
  ASSERT_EQ(priors.size(), 1u);
  const double lower = result["factor_lower"], upper = result["factor_upper"];
  EXPECT_NEAR(priors[0].median, 6e-5 * std::sqrt(lower * upper), 1e-12);
  EXPECT_NEAR(std::log(priors[0].factor), std::log(upper / lower) / (2 * 1.6448536), 1e-6);
  EXPECT_EQ(result["priors"]["bend_stiffness"]["median"], priors[0].median);

  const std::string start = path("start.toml");
  EXPECT_THAT(refusal({"cusick", start, "--fit", "1.2"}), HasSubstr("--fit"));
  EXPECT_THAT(refusal({"cusick", start, "--fit-deviation", "0.1"}), HasSubstr("without --fit"));
  EXPECT_THAT(refusal({"cusick", start, "--prior", path("p.toml")}), HasSubstr("without --fit"));
  EXPECT_THAT(refusal({"cusick", start, "--fit", "0.5", "--starts", "1"}), HasSubstr("--starts"));
  EXPECT_THAT(refusal({"cusick", start, "--fit", "0.5", "--out", path("x.obj")}),
              HasSubstr(".toml"));
  EXPECT_THAT(refusal({"cusick", "--shadow", path("x.png"), "--fit", "0.5"}),
              HasSubstr("--fit: means nothing for a picture"));
  EXPECT_THAT(refusal(with({"cusick", start, "--fit", "0.9999"})),
              HasSubstr("--fit: 0.9999 is out of range; must be at most 0.99"));
}

TEST_F(Textile, RefusesWhatDoesNotGoTogether) {
  EXPECT_THAT(refusal({"cantilever", "--areal-density", "0.2"}), HasSubstr("--overhang"));
  EXPECT_THAT(refusal({"cantilever", "--overhang", "0.1"}), HasSubstr("--areal-density"));
  EXPECT_THAT(refusal({"cantilever", "--overhang", "-1", "--areal-density", "0.2"}),
              HasSubstr("--overhang"));
  EXPECT_THAT(refusal({"cantilever", "--overhang", "0.1", "--areal-density", "0.2", "--out",
                       path("x.toml")}),
              HasSubstr("--fabric"));
  for (const char* option : {"--pixel", "--window"})
    EXPECT_THAT(
        refusal({"cantilever", "--overhang", "0.1", "--areal-density", "0.2", option, "0.01"}),
        HasSubstr(option + std::string(": means nothing for an overhang")));
  EXPECT_THAT(
      refusal({"cantilever", "--overhang", "0.1", "--areal-density", "0.2", "--clamp", "1", "2"}),
      HasSubstr("--clamp: means nothing for an overhang"));
  EXPECT_THAT(refusal({"cantilever", "p.csv", "--areal-density", "0.2", "--pixel", "0.001"}),
              HasSubstr("--pixel: means nothing for a CSV"));
  EXPECT_THAT(refusal({"cantilever", "p.csv", "--areal-density", "0.2", "--angle", "30"}),
              HasSubstr("--angle: means nothing for a profile"));
  EXPECT_THAT(refusal({"cantilever", "p.csv", "--areal-density", "0.2", "--window", "0.01"}),
              HasSubstr("--window: only with --curve"));
  EXPECT_EQ(
      refusal({"cantilever", "--overhang", "0.1", "--areal-density", "0.2", "--direction", "warp"}),
      "--direction: only with --fabric");
  EXPECT_THAT(refusal({"cusick"}), HasSubstr("--shadow"));
  EXPECT_THAT(refusal({"cusick", "satin", "--areal-density", "0.1", "--sectors", "25"}),
              HasSubstr("--sectors: 25 is odd"));
  write_fabric(folder_ / "springs.toml", Fabric::with_defaults("springs", "springs"));
  EXPECT_THAT(refusal({"cusick", path("springs.toml"), "--areal-density", "0.1"}),
              HasSubstr("springs"));
  EXPECT_THAT(refusal({"cusick", "--shadow", path("none.png"), "--pixel", "0.001"}),
              HasSubstr("none.png"));
  const std::vector<std::pair<std::string, std::string>> of_fabrics{
      {"--areal-density", "0.2"}, {"--starts", "4"},   {"--seed", "4"},
      {"--rings", "4"},           {"--sectors", "36"}, {"--threads", "1"}};
  for (const auto& [option, value] : of_fabrics)
    EXPECT_EQ(refusal({"cusick", "--shadow", "s.png", "--pixel", "0.001", option, value}),
              option + ": means nothing for a picture");
  EXPECT_EQ(refusal({"cusick", "satin", "--areal-density", "0.1", "--pixel", "0.001"}),
            "--pixel: only with --shadow");
}

// A file that is written must not be one that is read, or that is written before.
TEST_F(Textile, KeepsFilesThatAnOutputWouldReplace) {
  write("profile.csv", "x,y\n0,0\n");
  ASSERT_EQ(weft({"fabrics", "satin", "--out", path("base.toml")}).status, 0);
  const std::string base = text_of(folder_ / "base.toml");
  std::filesystem::create_symlink(folder_ / "base.toml", folder_ / "link.toml");
  const auto refused = [&](std::vector<std::string> words, const std::string& reason) {
    words.insert(words.end(), {"--areal-density", "0.2"});
    EXPECT_EQ(refusal(words), reason);
  };
  refused({"cantilever", path("profile.csv"), "--curve", path("x/../profile.csv")},
          "--curve: " + path("x/../profile.csv") +
              " is the profile, which it would replace; name another file");
  refused({"cantilever", path("profile.csv"), "--fabric", "satin", "--curve", path("a.out"),
           "--out", path("a.out")},
          "--out: " + path("a.out") + " is the file of --curve, too; each needs its own");
  // Neither is there yet: one is from the working folder, the other is not.
  refused({"cantilever", "--overhang", "0.1", "--fabric", "satin", "--out", "both.toml", "--prior",
           (std::filesystem::current_path() / "both.toml").string()},
          "--prior: " + (std::filesystem::current_path() / "both.toml").string() +
              " is the file of --out, too; each needs its own");
  refused(
      {"cantilever", "--overhang", "0.1", "--fabric", path("base.toml"), "--out",
       path("link.toml")},
      "--out: " + path("link.toml") + " is --fabric, which it would replace; name another file");
  refused({"cusick", path("base.toml"), "--fit", "0.5", "--prior", path("base.toml")},
          "--prior: " + path("base.toml") +
              " is the fabric that is read, which it would replace; name another file");
  refused({"cusick", "satin", "--fit", "0.5", "--prior", path("b.toml"), "--out", path("b.toml")},
          "--prior: " + path("b.toml") + " is the file of --out, too; each needs its own");
  EXPECT_EQ(refusal({"fabrics", path("base.toml"), "--scale", "bend_stiffness=2", "--out",
                     path("base.toml")}),
            "--out: " + path("base.toml") +
                " is the fabric that is read, which it would replace; name another file");
  EXPECT_EQ(text_of(folder_ / "profile.csv"), "x,y\n0,0\n");
  EXPECT_EQ(text_of(folder_ / "base.toml"), base);
}

}  // namespace
}  // namespace weft::textile_test
