#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/program.h"
#include "weft/base/random.h"
#include "weft/mesh/mesh_io.h"
#include "weft/vision/video.h"

namespace weft::register_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class Register : public ProgramTest {
 protected:
  /// Points of a hanging sheet of 0.2 x 0.2 m that is bent about an upright axis, moved `along` x,
  /// with grid lines of pitch 0.02 m.
  static std::string points(double along, int count) {
    Rng rng(2);
    std::string text = "x,y,z,r,g,b\n";
    for (int k = 0; k < count; ++k) {
      const double u = rng.uniform(0, 0.2), v = rng.uniform(0, 0.2), angle = (u - 0.1) / 0.1;
      const auto line = [](double t) { return std::abs(t / 0.02 - std::round(t / 0.02)) < 0.06; };
      const int grey = line(u) || line(v) ? 40 : 200;
      text += fmt::format("{},{},{},{},{},{}\n", along + 0.1 * std::sin(angle),
                          0.1 * std::cos(angle), -v, grey, grey, grey);
    }
    return text;
  }
  /// Largest distance of the vertices to where they belong.
  static double error_of(const ObjMesh& mesh, double along) {
    double worst = 0;
    for (Eigen::Index k = 0; k < mesh.positions.cols(); ++k) {
      const double angle = ((*mesh.texture)(0, k) - 0.1) / 0.1;
      const Vec3 truth(along + 0.1 * std::sin(angle), 0.1 * std::cos(angle),
                       -(*mesh.texture)(1, k));
      worst = std::max(worst, (mesh.positions.col(k) - truth).norm());
    }
    return worst;
  }
};

TEST_F(Register, WritesTheGridWithWhatItIsWorth) {
  write("scan.csv", points(0, 6000));
  const Outcome outcome = weft({"register", path("scan.csv"), "--swatch", "0.2x0.2", "--grid", "13",
                                "--out", path("out"), "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const ObjMesh mesh = read_obj(path("out/registered.obj"));
  ASSERT_EQ(mesh.positions.cols(), 169);
  ASSERT_TRUE(mesh.texture);
  EXPECT_LT(error_of(mesh, 0), 0.0015);
  const nlohmann::json result = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(result["frames"].size(), 1u);
  EXPECT_LT(result["frames"][0]["residual_median"], 1e-4);
  EXPECT_EQ(result["frames"][0]["unsupported_vertices"], 0);
  EXPECT_THAT(text_of(path("out/vertices.csv")),
              HasSubstr("frame,vertex,u_m,v_m,x_m,y_m,z_m,supported,distance_m,weight\n0,0,0,0,"));
  for (const char* name : {"out/residuals.svg", "out/distance.svg", "out/registration.json"}) {
    EXPECT_NE(text_of(path(name)), "") << name;
  }
  EXPECT_THAT(refusal({"register", path("scan.csv"), "--swatch", "0.2x0.2", "--out", path("out")}),
              HasSubstr("--overwrite"));
}

TEST_F(Register, BeginsAlsoFromClothThatHangs) {
  write("scan.csv", points(0, 6000));
  const double end = 0.1 * std::sin(1), depth = 0.1 * std::cos(1);
  write("held.csv",
        fmt::format("u_m,v_m,x_m,y_m,z_m\n0,0,{},{},0\n0.2,0,{},{},0\n", -end, depth, end, depth));
  const Outcome outcome =
      weft({"register", path("scan.csv"), "--swatch", "0.2x0.2", "--grid", "13", "--out",
            path("out"), "--held", path("held.csv"), "--u-axis", "-1,0,0", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  // The axis is wrong: the flat starts mirror the sheet, those that hang do not.
  EXPECT_LT(error_of(read_obj(path("out/registered.obj")), 0), 0.0015);
  const nlohmann::json result = nlohmann::json::parse(outcome.out);
  EXPECT_LT(result["frames"][0]["landmark_rms"].get<double>(), 1e-3);
  EXPECT_THAT(refusal({"register", path("scan.csv"), "--swatch", "0.2x0.2", "--out", path("x"),
                       "--gravity", "0,0,1"}),
              HasSubstr("--gravity: only with --held"));
}

TEST_F(Register, FollowsASequenceAndAStampedGrid) {
  write("scans/0.csv", points(0, 12000));
  write("scans/1.csv", points(0.01, 12000));
  const Outcome outcome = weft({"register", path("scans"), "--swatch", "0.2x0.2", "--grid", "13",
                                "--out", path("out"), "--stamp", "0.02", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const nlohmann::json result = nlohmann::json::parse(outcome.out);
  // 9 x 9 crossings are inside of the swatch.
  EXPECT_GE(result["frames"][1]["stamp_crossings"], 70);
  const PointCache cache = read_pc2(path("out/registered.pc2"));
  ASSERT_EQ(cache.frames.size(), 2u);
  ObjMesh mesh = read_obj(path("out/registered.obj"));
  EXPECT_LT(error_of(mesh, 0), 0.0015);
  mesh.positions = cache.frames[1];
  EXPECT_LT(error_of(mesh, 0.01), 0.0015);
}

TEST_F(Register, RefusesASheetThatItDoesNotFind) {
  // In mm, without --unit; all on one line; landmarks in mm.
  Rng rng(1);
  std::string mm, line;
  for (int k = 0; k < 2000; ++k) {
    mm += fmt::format("{} 0 {}\n", rng.uniform(0, 200), rng.uniform(-200, 0));
    line += fmt::format("{} 0 0\n", rng.uniform(0, 0.2));
  }
  write("mm.xyz", mm);
  write("line.xyz", line);
  write("scan.csv", points(0, 6000));
  write("marks.csv", "u_m,v_m,x_m,y_m,z_m\n0,0,-84,54,0\n0.2,0,84,54,0\n0,0.2,-84,54,-200\n");
  const auto refused = [&](const std::string& scan, std::vector<std::string> more) {
    std::vector<std::string> words{"register", path(scan), "--swatch", "0.2x0.2",
                                   "--grid",   "9",        "--out",    path("out")};
    words.insert(words.end(), more.begin(), more.end());
    return refusal(words);
  };
  EXPECT_THAT(refused("mm.xyz", {}), AllOf(HasSubstr("mm.xyz: it is 19"), HasSubstr("--unit")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  EXPECT_THAT(refused("line.xyz", {}), HasSubstr("line.xyz: the swatch was not found"));
  EXPECT_THAT(refused("scan.csv", {"--landmarks", path("marks.csv")}),
              AllOf(HasSubstr("scan.csv: the swatch was not found"), HasSubstr("marks.csv in m")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/registration.json"));
}

TEST_F(Register, WarnsOfAGridThatHangsInTheAir) {
  write("part.csv", points(0, 6000));
  const Outcome outcome = weft({"register", path("part.csv"), "--swatch", "0.4x0.2", "--grid", "13",
                                "--out", path("out"), "--overwrite", "--json"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("warning: frame 0: "));
  EXPECT_THAT(outcome.err, HasSubstr("vertices are without points of the scan"));
}

TEST_F(Register, OverwritingRemovesWhatAnotherRunLeft) {
  write("scan.csv", points(0, 6000));
  write("out/registered.pc2", "old");
  write("out/registration.json", "old");
  write("out/notes.txt", "mine");
  const Outcome outcome = weft({"register", path("scan.csv"), "--swatch", "0.2x0.2", "--grid", "9",
                                "--out", path("out"), "--overwrite"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/registered.pc2"));
  EXPECT_NE(text_of(folder_ / "out/registration.json"), "old");
  EXPECT_EQ(text_of(folder_ / "out/notes.txt"), "mine");
}

TEST_F(Register, RefusesOptionsThatMeanNothing) {
  write("scan.csv", points(0, 200));
  write("marks.csv", "u_m,v_m,x_m,y_m,z_m\n0,0,0,0,0\n0.2,0,1,0,0\n0,0.2,0,0,1\n");
  write_obj(folder_ / "small.obj", make_swatch(0.1, 0.1, 3, 3), Points::Zero(3, 9), "");
  const auto refused = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"register",  path("scan.csv"), "--out",
                                   path("out"), "--swatch",       "0.2x0.2"};
    words.insert(words.end(), more.begin(), more.end());
    return refusal(words);
  };
  EXPECT_EQ(refused({"--stamp-origin", "0,0"}), "--stamp-origin: only with --stamp");
  EXPECT_THAT(refused({"--print"}), HasSubstr("--print: only with a sequence"));
  EXPECT_THAT(refused({"--u-axis", "1,0,0", "--landmarks", path("marks.csv")}),
              HasSubstr("not with three landmarks"));
  EXPECT_THAT(refused({"--u-axis", "0,0,1"}), HasSubstr("is along --v-axis 0,0,-1"));
  EXPECT_EQ(refused({"--start", path("small.obj"), "--v-axis", "0,1,0"}),
            "--v-axis: not with --start");
  EXPECT_THAT(refused({"--start", path("small.obj")}),
              HasSubstr("small.obj: vt: (u, v) from (0, 0) to (0.1, 0.1); the swatch is"));
}

TEST_F(Register, RefusesWhatItCannotUse) {
  write("scan.csv", points(0, 200));
  const auto refused = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"register", path("scan.csv"), "--out", path("out")};
    words.insert(words.end(), more.begin(), more.end());
    return refusal(words);
  };
  EXPECT_THAT(refused({"--swatch", "0.2"}), HasSubstr("--swatch"));
  EXPECT_THAT(refused({"--swatch", "0.2x20"}), HasSubstr("0.001 to 10 m"));
  EXPECT_THAT(refused({"--swatch", "0.2x0.2", "--u-axis", "0,0,0"}), HasSubstr("--u-axis"));
  EXPECT_THAT(refused({"--swatch", "0.2x0.2", "--reach", "-1"}), HasSubstr("--reach"));
  EXPECT_THAT(refused({"--swatch", "0.2x0.2", "--start", path("none.obj")}), HasSubstr("none.obj"));
  EXPECT_THAT(refused({"--swatch", "0.2x0.2", "--pictures", "p%d.png"}), HasSubstr("--camera"));
  write("marks.csv", "u_m,v_m,x_m,y_m\n0,0,0,0\n");
  EXPECT_THAT(refused({"--swatch", "0.2x0.2", "--landmarks", path("marks.csv")}), HasSubstr("z_m"));
  const std::string header = "u_m,v_m,x_m,y_m,z_m\n";
  write("marks.csv", header + "0,0,0,0,0\n5,0,0,0,0\n");
  for (const char* option : {"--landmarks", "--held"})
    EXPECT_EQ(refused({"--swatch", "0.2x0.2", option, path("marks.csv")}),
              path("marks.csv") + ":3: u_m: 5 is off the swatch; must be in [0, 0.2]");
  write("marks.csv", header + "0,0,0,0,0\n");
  EXPECT_EQ(refused({"--swatch", "0.2x0.2", "--held", path("marks.csv"), "--gravity", "0,0,0"}),
            "--gravity 0,0,0: must not be 0,0,0: the cloth of --held hangs");
}

TEST_F(Register, SaysWhichScanItCannotUse) {
  const auto refused = [&](const std::string& scan, const std::vector<std::string>& more) {
    std::filesystem::remove_all(folder_ / "out");
    std::vector<std::string> words{"register",  path(scan), "--out",
                                   path("out"), "--swatch", "0.2x0.2"};
    words.insert(words.end(), more.begin(), more.end());
    return refusal(words);
  };
  write("few.xyz", "0 0 0\n0.2 0 0\n");
  EXPECT_THAT(refused("few.xyz", {}),
              AllOf(StartsWith(path("few.xyz") + ": "), HasSubstr("of the scan lie on a surface")));
  write("s/0.csv", points(0, 200));
  write("s/1.csv", "x,y,z\n0,0,0\n0.2,0,0\n0.2,0,-0.2\n");
  EXPECT_EQ(refused("s", {"--stamp", "0.02"}),
            "--stamp: " + path("s") + ": frame 1 has no colours");
  EXPECT_EQ(refused("s", {"--print"}),
            "--print: " + path("s") + ": frame 1 has no colours; give --pictures and --camera");
}

TEST_F(Register, ACameraIsTwelveNumbers) {
  write("scan.csv", "frame,x,y,z\n0,0,0,0\n0,0.2,0,0\n0,0,0,-0.2\n1,0,0,0\n1,0.2,0,0\n");
  for (const char* name : {"p0.png", "p1.png"})
    write_png(folder_ / name, Image::Constant(32, 32, 0.5f));
  const auto refused = [&](const std::string& camera) {
    if (!camera.empty()) write("camera.txt", camera);
    return refusal({"register", path("scan.csv"), "--out", path("out"), "--swatch", "0.2x0.2",
                    "--overwrite", "--pictures", path("p%d.png"), "--camera", path("camera.txt")});
  };
  EXPECT_EQ(refused(""), path("camera.txt") + ": cannot be read");
  const std::string three = "100 0 16 0\n0 100 16 0\n0 0 1 1\n";
  EXPECT_THAT(refused("100 0 16 0\n0 100 16 0\n"), HasSubstr("camera.txt: expected 12 numbers"));
  EXPECT_THAT(refused(three + "0 0 0 1\n"),
              AllOf(HasSubstr("camera.txt: expected 12 numbers and no more"),
                    HasSubstr("\"0\" follows them")));
}

}  // namespace
}  // namespace weft::register_test
