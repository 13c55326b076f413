#include "weft/capture/mechanical_capture.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdio>
#include <numbers>
#include <sstream>

#include "capture/temporary_capture.h"

namespace weft::mechanical_capture_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

const std::filesystem::path kData = std::filesystem::path(WEFT_SOURCE_DIR) / "data/mechanical";

/// Starts as a copy of a bundled mechanical capture.
class ReadMechanical : public TemporaryCapture {
 protected:
  void SetUp() override { copy("blend_strip_45"); }
  void copy(const std::string& name) const {
    for (const char* file : {"capture.toml", "clips.csv", "rest.obj", "points.pc2"})
      write(file, text_of(kData / name / file));
  }
  std::string refusal() const {
    return message_of([this] { read_geometry(read_mechanical_capture(folder_)); });
  }
  std::string refusal_with(const std::string& file, const std::string& before,
                           const std::string& after) const {
    const std::string original = text_of(folder_ / file);
    replace(file, before, after);
    std::string result = refusal();
    write(file, original);
    return result;
  }
};

TEST_F(ReadMechanical, ReadsAStrip) {
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  EXPECT_EQ(capture.name, "blend_strip_45");
  EXPECT_EQ(capture.width, 0.15);
  EXPECT_EQ(capture.height, 0.025);
  EXPECT_EQ(capture.areal_density, 0.25);
  EXPECT_NEAR(capture.grain_angle, std::numbers::pi / 4, 1e-15);
  EXPECT_EQ(capture.gravity, Vec3::Zero());
  EXPECT_EQ(capture.frame_count, 12);
  ASSERT_EQ(capture.fixtures.size(), 2u);
  const MechanicalFixture& right = capture.fixtures[1];
  EXPECT_EQ(right.name, "right");
  EXPECT_EQ(right.frames[11].region.lower, Vec2(0.145, 0));
  EXPECT_NEAR((right.frames[11].position - Vec3(0.1503, 0.0125, 0)).norm(), 0, 1e-12);
  ASSERT_EQ(right.forces.cols(), 12);
  EXPECT_GT(right.forces(0, 11), 0.18);
  EXPECT_TRUE(capture.truth.has_value());
  EXPECT_EQ(read_geometry(capture).frames.size(), 12u);
}

TEST_F(ReadMechanical, RegionsMayChangeFromFrameToFrame) {
  copy("knit_bend_u");
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  EXPECT_NEAR(capture.fixtures[0].frames.front().region.upper.x(), 0.08, 1e-12);
  EXPECT_LT(capture.fixtures[0].frames.back().region.upper.x(), 0.02);
}

// Shape and clips were written for different purposes: what a clip holds must be where its pose
// says.
TEST_F(ReadMechanical, MeasuredPointsInAClipAreWhereItHasThem) {
  for (const char* name : {"blend_strip_45", "knit_bend_u"}) {
    copy(name);
    const MechanicalCapture capture = read_mechanical_capture(folder_);
    const MeasuredGeometry geometry = read_geometry(capture);
    for (int frame = 0; frame < capture.frame_count; ++frame) {
      int held = 0;
      for (const Clip& clip : capture.clips(frame)) {
        for (Eigen::Index i = 0; i < geometry.mesh.material.cols(); ++i) {
          const Vec2 uv = geometry.mesh.material.col(i);
          if (!clip.region.contains(uv)) continue;
          ++held;
          const Vec3 x = geometry.frames[static_cast<std::size_t>(frame)].col(i);
          // 32-bit floats, and the nine digits of the table.
          EXPECT_LT((clip.place(uv) - x).norm(), 1e-7);
        }
      }
      EXPECT_GT(held, 4);
    }
  }
}

/// A strip whose right clip hangs in two cords.
class ReadLoaded : public ReadMechanical {
 protected:
  void SetUp() override {
    ReadMechanical::SetUp();
    const std::string forces = "force_columns = [\"right_fx\", \"right_fy\", \"right_fz\"]";
    replace("capture.toml", forces,
            "mass = 0.02\n[[fixture.cord]]\nat = [0, 0.01, 0]\n" + forces +
                "\n[[fixture.cord]]\nat = [0, -0.01, 0]\npulley = [0.5, 0, 0]\n"
                "tension = \"right_fx\"");
  }
};

TEST_F(ReadLoaded, ClipsWithCordsAreNotHeld) {
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  EXPECT_TRUE(capture.has_loaded());
  EXPECT_FALSE(capture.fixtures[0].loaded());
  ASSERT_FALSE(capture.loads(11)[0]);
  const std::optional<ClipLoad> load = capture.loads(11)[1];
  ASSERT_TRUE(load);
  EXPECT_EQ(load->mass, 0.02);
  ASSERT_EQ(load->cords.size(), 2u);
  EXPECT_EQ(load->cords[0].at, Vec3(0, 0.01, 0));
  EXPECT_GT(load->cords[0].force.x(), 0.18);
  EXPECT_FALSE(load->cords[0].pulley);
  EXPECT_EQ(load->cords[1].pulley, Vec3(0.5, 0, 0));
  EXPECT_EQ(load->cords[1].tension, load->cords[0].force.x());
  EXPECT_EQ(capture.fixtures[1].forces.cols(), 0);
  // Without a stated noise of the clips, that of points; turns over half of the longer side.
  const Clip& clip = capture.fixtures[1].frames[0];
  EXPECT_NEAR(capture.pose_deviations(clip, 1e-4)[1], 1e-4 / 0.0125, 1e-15);
}

TEST_F(ReadLoaded, RefusesLoadsThatCannotBe) {
  const auto with = [&](const std::string& before, const std::string& after) {
    return refusal_with("capture.toml", before, after);
  };
  EXPECT_THAT(with("mass = 0.02", "mass = -1"), HasSubstr("fixture[1].mass: -1 is out of range"));
  EXPECT_THAT(with("mass = 0.02", "force_columns = [\"right_fx\", \"right_fy\", \"right_fz\"]"),
              HasSubstr("fixture[1].force_columns: not valid for a clip with cords or a mass"));
  EXPECT_THAT(with("mass = 0.02",
                   "region_columns = [\"right_fx\", \"right_fy\", \"right_fz\", \"right_px\"]"),
              HasSubstr("holds one region"));
  EXPECT_THAT(with("tension = \"right_fx\"", ""), HasSubstr("tension"));
  EXPECT_THAT(with("tension = \"right_fx\"", "tension = \"right_f\""),
              HasSubstr("clips.csv has no column \"right_f\""));
  EXPECT_THAT(with("tension = \"right_fx\"", "tension = \"left_fx\""),
              HasSubstr("must be 0 or more: a cord only pulls"));
  EXPECT_THAT(with("pulley = [0.5, 0, 0]\ntension = \"right_fx\"", ""),
              HasSubstr("either pulley, with tension, or force_columns is needed"));
  // Where the cord is tied at frame 0: the clip's centre, and 0.01 m along v.
  EXPECT_THAT(with("pulley = [0.5, 0, 0]", "pulley = [0.1475, 0.0025, 0]"),
              HasSubstr("m from where the cord is tied at frame 0, must be above 0.001 m"));
  EXPECT_THAT(with("at = [0, 0.01, 0]", "at = [0, 11, 0]"), HasSubstr("fixture[1].cord[0].at"));
  const std::string left = "force_columns = [\"left_fx\", \"left_fy\", \"left_fz\"]";
  EXPECT_THAT(with(left, "mass = 1"), HasSubstr("at least one must be held"));
  EXPECT_THAT(with(left, "mass = 0"), HasSubstr("fixture[0].mass: 0, must be above 0"));
}

TEST_F(ReadMechanical, NamesFileLineAndKey) {
  EXPECT_THAT(refusal_with("capture.toml", "width = 0.15", "width = 0"),
              StartsWith("capture.toml:8: swatch.width: 0 is out of range"));
  EXPECT_THAT(refusal_with("capture.toml", "grain_angle_deg", "grain_angle"),
              HasSubstr("swatch.grain_angle: unknown key; did you mean \"grain_angle_deg\"?"));
  EXPECT_THAT(refusal_with("capture.toml", "kind = \"bar\"", "kind = \"point\""),
              HasSubstr("fixture[0].kind: \"point\" is not valid; must be \"bar\""));
  EXPECT_THAT(refusal_with("capture.toml", "[0.005, 0.025]]", "[0.005, 0.03]]"),
              HasSubstr("reaches off the swatch"));
  EXPECT_THAT(refusal_with("capture.toml", "[[0, 0], [0.005", "[[0.006, 0], [0.005"),
              HasSubstr("below and left of"));
  EXPECT_THAT(refusal_with("capture.toml", "[[0.145, 0]", "[[0.004, 0]"), HasSubstr("overlap"));
  EXPECT_THAT(refusal_with("capture.toml", "\"left_px\"", "\"left_x\""),
              HasSubstr("clips.csv has no column \"left_x\""));
  EXPECT_THAT(refusal_with("capture.toml", "\"left_py\"", "\"left_px\""),
              HasSubstr("fixture[0].columns: \"left_px\" is named twice"));
  EXPECT_THAT(refusal_with("capture.toml", "count = 12", "count = 13"),
              HasSubstr("clips.csv: 12 rows; the capture has 13 frames"));
  EXPECT_THAT(refusal_with("capture.toml", "points.pc2", "point.pc2"), HasSubstr("no such file"));
  EXPECT_THAT(refusal_with("clips.csv", ",1,0,0,0,", ",0.9,0,0,0,"),
              StartsWith("clips.csv:2: left_qw: quaternion of length 0.9"));
  EXPECT_THAT(refusal_with("clips.csv", "0.147535", "147.535"), HasSubstr("m apart at frame 0"));
  const std::string kind = "kind = \"mechanical\"\n";
  EXPECT_THAT(refusal_with("capture.toml", kind, kind + "clip_noise = 0.02\n"),
              HasSubstr("capture.toml:4: clip_noise: 0.02 is out of range; must be in [0, 0.01]"));
}

TEST_F(ReadMechanical, MeasuredPointsAreOnTheSwatch) {
  const std::string mesh = text_of(folder_ / "rest.obj");
  // In mm, and 5 m off along u.
  for (const auto& [scale, shift] : {std::pair{1000.0, 0.0}, {1.0, 5.0}}) {
    std::istringstream lines(mesh);
    std::string line, changed;
    while (std::getline(lines, line)) {
      double u = 0, v = 0;
      if (std::sscanf(line.c_str(), "vt %lf %lf", &u, &v) == 2)
        line = "vt " + std::to_string(scale * u + shift) + " " + std::to_string(scale * v);
      changed += line + "\n";
    }
    write("rest.obj", changed);
    EXPECT_THAT(refusal(), AllOf(StartsWith("rest.obj: vt: (u, v) from ("),
                                 HasSubstr("the swatch is 0.15 x 0.025 m")));
  }
}

TEST_F(ReadMechanical, TwoClipsAreNotInOnePlace) {
  const std::string right =
      "[\"right_px\", \"right_py\", \"right_pz\", \"right_qw\", \"right_qx\", \"right_qy\", "
      "\"right_qz\"]";
  std::string left = right;
  for (std::size_t at = left.find("right"); at != std::string::npos; at = left.find("right"))
    left.replace(at, 5, "left");
  EXPECT_EQ(refusal_with("capture.toml", right, left),
            "capture.toml:32: fixture[1].columns: \"left\" and \"right\" have the same columns of "
            "clips.csv");
  // Other columns, the same values at frame 1.
  EXPECT_EQ(
      refusal_with("clips.csv", ",0.14757,0.0125,", ",0.00243,0.0125,"),
      "capture.toml:31: fixture[1].motion: \"left\" and \"right\" are in one place at frame 1");
  // Near is a matter of the test.
  EXPECT_EQ(refusal_with("clips.csv", ",0.14757,0.0125,", ",0.00244,0.0125,"), "no error");
}

TEST_F(ReadMechanical, ClipsAreExactUnlessTheirNoiseIsStated) {
  EXPECT_EQ(read_mechanical_capture(folder_).clip_noise, 0);
  const std::string kind = "kind = \"mechanical\"\n";
  replace("capture.toml", kind, kind + "clip_noise = 1.5e-5\n");
  EXPECT_EQ(read_mechanical_capture(folder_).clip_noise, 1.5e-5);
}

TEST_F(ReadMechanical, EachReaderSaysWhatTheOtherKindNeeds) {
  EXPECT_EQ(capture_kind(folder_), CaptureKind::mechanical);
  EXPECT_EQ(capture_kind(bundled_capture()), CaptureKind::video);
  EXPECT_THAT(message(), HasSubstr("kind: a mechanical capture; this command needs a video"));
  EXPECT_THAT(message_of([] { read_mechanical_capture(bundled_capture()); }),
              HasSubstr("kind: a video; a mechanical capture"));
}

class StandardTest : public ReadMechanical {
 protected:
  void SetUp() override {
    write("capture.toml",
          "format = \"weft-capture\"\nversion = 1\nkind = \"mechanical\"\ntest = \"strip\"\n"
          "[specimen]\nfree_length = 0.2\nwidth = 0.05\nareal_density = 0.15\n"
          "grain_angle_deg = 30\n[curve]\nfile = \"curve.csv\"\ndisplacement = \"s\"\n"
          "force = \"F\"\ndisplacement_unit = \"mm\"\nforce_unit = \"cN\"\n");
    write("curve.csv", "s,F\n0,0\n1,20\n2.5,55\n");
  }
};

TEST_F(StandardTest, IsAStripBetweenTwoJaws) {
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  EXPECT_EQ(capture.frame_count, 3);
  EXPECT_NEAR(capture.grain_angle, std::numbers::pi / 6, 1e-15);
  EXPECT_EQ(capture.gravity, Vec3::Zero());
  EXPECT_EQ(capture.height, 0.05);
  ASSERT_EQ(capture.fixtures.size(), 2u);
  const auto& fixed = capture.fixtures[0];
  const auto& moving = capture.fixtures[1];
  for (const auto& [frame, shift] : {std::pair{0, 0.0}, {1, 0.001}, {2, 0.0025}}) {
    const Clip &a = fixed.frames[static_cast<std::size_t>(frame)],
               &b = moving.frames[static_cast<std::size_t>(frame)];
    EXPECT_NEAR(b.region.lower.x() - a.region.upper.x(), 0.2, 1e-12);
    EXPECT_NEAR(b.place({b.region.lower.x(), 0}).x() - a.place({a.region.upper.x(), 0}).x(),
                0.2 + shift, 1e-12);
  }
  EXPECT_EQ(fixed.forces.cols(), 0);
  EXPECT_NEAR(moving.forces(0, 2), 0.55, 1e-15);
  EXPECT_TRUE(std::isnan(moving.forces(1, 2)));
}

TEST_F(StandardTest, BiasExtensionIsAt45DegreesUnlessStated) {
  replace("capture.toml", "\"strip\"", "\"bias-extension\"");
  replace("capture.toml", "grain_angle_deg = 30\n", "");
  EXPECT_NEAR(read_mechanical_capture(folder_).grain_angle, std::numbers::pi / 4, 1e-15);
}

TEST_F(StandardTest, RefusesWhatItDoesNotKnow) {
  EXPECT_THAT(refusal_with("capture.toml", "\"strip\"", "\"grab\""),
              HasSubstr("test: \"grab\" is not valid; must be one of"));
  EXPECT_THAT(refusal_with("capture.toml", "\"F\"", "\"force\""),
              HasSubstr("curve.csv has no column \"force\"; there are s, F"));
  EXPECT_THAT(refusal_with("capture.toml", "\"F\"", "\"s\""),
              StartsWith("capture.toml:13: curve.force: \"s\" is the column of displacement, too"));
  EXPECT_THAT(refusal_with("curve.csv", "20", "x"),
              StartsWith("curve.csv:3: F: \"x\" is not a finite number"));
}

TEST_F(StandardTest, JawsDoNotPassThroughEachOther) {
  const std::string range =
      " m is out of range; must be above -0.2 and at most 0.4, of a free "
      "length of 0.2 m; is displacement_unit right?";
  EXPECT_THAT(refusal_with("curve.csv", "2.5,55", "-200,55"),
              StartsWith("curve.csv:4: s: -0.2" + range));
  EXPECT_THAT(refusal_with("curve.csv", "2.5,55", "-199,55"), HasSubstr("has no [geometry]"));
  EXPECT_THAT(refusal_with("capture.toml", "displacement_unit = \"mm\"\n", ""),
              StartsWith("curve.csv:3: s: 1" + range));
}

TEST_F(StandardTest, SaysWhatSeparatesTheColumns) {
  write("curve.csv", "s;F\n0,0;0,1\n");
  EXPECT_THAT(refusal(), StartsWith("curve.csv:1: columns seem to be separated by semicolons"));
  write("curve.csv", "s\tF\n0\t0\n");
  EXPECT_THAT(refusal(), StartsWith("curve.csv:1: columns seem to be separated by tabs"));
  write("curve.csv", "\n\ns,s\n0,0\n");
  EXPECT_THAT(refusal(), StartsWith("curve.csv:3: s: two columns of this name"));
}

TEST_F(StandardTest, ACommaWithinQuotesIsPartOfTheCell) {
  write("curve.csv", "s, \"F, cN\" ,\"note\"\n0,0,\"a, b\"\n1,20,\n");
  replace("capture.toml", "\"F\"", "\"F, cN\"");
  EXPECT_NEAR(read_mechanical_capture(folder_).fixtures[1].forces(0, 1), 0.2, 1e-15);
}

class PictureFrameTest : public ReadMechanical {
 protected:
  void SetUp() override {
    write("capture.toml",
          "format = \"weft-capture\"\nversion = 1\nkind = \"mechanical\"\ntest = "
          "\"picture-frame\"\n[specimen]\nframe_side = 0.2\nside = 0.14\nareal_density = 0.15\n"
          "grain_angle_deg = 30\n[curve]\nfile = \"curve.csv\"\ndisplacement = \"d\"\n"
          "force = \"F\"\ndisplacement_unit = \"mm\"\nforce_unit = \"cN\"\n");
    // 90 degrees - 2 acos((sqrt(2) + d / L) / 2).
    write("curve.csv", "d,angle,F\n0,0,0\n10,4.12661,250\n");
  }
};

TEST_F(PictureFrameTest, IsASquareThatIsSheared) {
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  EXPECT_EQ(capture.frame_count, 2);
  EXPECT_EQ(capture.width, 0.14);
  EXPECT_EQ(capture.height, 0.14);
  EXPECT_EQ(capture.gravity, Vec3::Zero());
  EXPECT_NEAR(capture.grain_angle, std::numbers::pi / 6, 1e-15);
  ASSERT_TRUE(capture.picture_frame);
  EXPECT_EQ(capture.picture_frame->side, 0.2);
  EXPECT_NEAR(capture.picture_frame->shear[0], 0, 1e-15);
  EXPECT_NEAR(capture.picture_frame->shear[1], 4.12661 * std::numbers::pi / 180, 1e-7);
  ASSERT_EQ(capture.fixtures.size(), 1u);
  EXPECT_TRUE(capture.fixtures[0].frames[1].region.contains({0.14, 0.14}));
  EXPECT_NEAR(capture.fixtures[0].forces(0, 1), 2.5, 1e-15);
  EXPECT_TRUE(std::isnan(capture.fixtures[0].forces(1, 1)));
}

TEST_F(PictureFrameTest, TakesAnglesToo) {
  replace("capture.toml", "displacement = \"d\"", "shear_angle = \"angle\"");
  replace("capture.toml", "displacement_unit = \"mm\"", "shear_angle_unit = \"deg\"");
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  EXPECT_NEAR(capture.picture_frame->shear[1], 4.12661 * std::numbers::pi / 180, 1e-15);
  replace("capture.toml", "shear_angle_unit = \"deg\"\n", "");
  EXPECT_THAT(refusal(), StartsWith("curve.csv:3: angle: 4.12661 rad is out of range; must be in "
                                    "[-1.39626, 1.39626], a shear of -80 to 80 degrees"));
}

TEST_F(PictureFrameTest, NamesFileLineAndKey) {
  EXPECT_THAT(refusal_with("capture.toml", "frame_side = 0.2", "frame_side = 0.13"),
              StartsWith("capture.toml:6: specimen.frame_side: 0.13 is out of range; must be in "
                         "[0.14, 10]"));
  EXPECT_THAT(refusal_with("capture.toml", "side = 0.14", "side = 0"),
              StartsWith("capture.toml:7: specimen.side: 0 is out of range"));
  EXPECT_THAT(refusal_with("capture.toml", "frame_side", "frame"),
              HasSubstr("specimen.frame_side: missing"));
  EXPECT_THAT(refusal_with("capture.toml", "force_unit", "angle_unit"),
              HasSubstr("curve.angle_unit: unknown key"));
  EXPECT_THAT(refusal_with("capture.toml", "[curve]\n", "[curve]\nshear_angle = \"angle\"\n"),
              StartsWith("capture.toml:10: curve: either displacement or shear_angle is needed"));
  EXPECT_THAT(refusal_with("capture.toml", "displacement = \"d\"\n", ""),
              HasSubstr("curve: either displacement or shear_angle is needed"));
  EXPECT_THAT(refusal_with("capture.toml", "force = \"F\"", "force = \"d\""),
              HasSubstr("curve.force: \"d\" is the column of displacement, too"));
  // 2 L (cos 5 degrees - cos 45 degrees) is 0.1156 m.
  EXPECT_THAT(refusal_with("curve.csv", "10,", "120,"),
              StartsWith("curve.csv:3: d: 0.12 m is out of range; must be in [-0.24"));
  EXPECT_THAT(refusal_with("curve.csv", "\n0,0,0\n10,4.12661,250", ""), HasSubstr("no rows"));
  const std::string kind = "kind = \"mechanical\"\n";
  EXPECT_THAT(refusal_with("capture.toml", kind, kind + "clip_noise = 1e-5\n"),
              StartsWith("capture.toml:4: clip_noise: not valid for a picture frame"));
}

class CantileverTest : public ReadMechanical {
 protected:
  /// Reads ten points at 30 degrees below the horizontal, as x and y grow.
  void with_points(int x, int y) const {
    std::string text = "x,y\n";
    for (int i = 0; i < 10; ++i)
      text += std::to_string(x * 0.00866 * i) + "," + std::to_string(y * 0.005 * i) + "\n";
    write("profile.csv", text);
    read_mechanical_capture(folder_);
  }
  void SetUp() override {
    write("capture.toml",
          "format = \"weft-capture\"\nversion = 1\nkind = \"mechanical\"\ntest = "
          "\"cantilever\"\nspecimen = { width = 0.02, areal_density = 0.15 }\n[profile]\nfile = "
          "\"profile.csv\"\nclamp_angle_deg = 30\n");
    // Ten points 1 cm apart, at 30 degrees below the horizontal, from (0.1, 0.3) m.
    std::string text = "x,y\n";
    for (int i = 0; i < 10; ++i)
      text += std::to_string(0.1 + 0.01 * i * std::cos(std::numbers::pi / 6)) + "," +
              std::to_string(0.3 - 0.005 * i) + "\n";
    write("profile.csv", text);
  }
};

TEST_F(CantileverTest, IsAStripInAClampWithItsProfileAsTheShape) {
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  EXPECT_EQ(capture.frame_count, 1);
  EXPECT_EQ(capture.gravity, Vec3(0, 0, -9.81));
  ASSERT_EQ(capture.fixtures.size(), 1u);
  const Clip& clip = capture.fixtures[0].frames[0];
  EXPECT_NEAR(capture.width - clip.region.upper.x(), 0.09, 1e-5);  // x and y have 6 digits
  const MeasuredGeometry geometry = read_geometry(capture);
  ASSERT_EQ(geometry.frames.size(), 1u);
  ASSERT_EQ(geometry.mesh.vertex_count(), 20);
  // A straight strip goes on in the clamp's direction.
  for (Eigen::Index i = 0; i < 20; ++i)
    EXPECT_LT((clip.place(geometry.mesh.material.col(i)) - geometry.frames[0].col(i)).norm(), 1e-5);
}

TEST_F(CantileverTest, RefusesWhatIsNoProfile) {
  EXPECT_THAT(refusal_with("profile.csv", "x,y", "x,z"), HasSubstr("no column \"y\""));
  EXPECT_THAT(refusal_with("capture.toml", "clamp_angle_deg = 30", "clamp_angle_deg = 95"),
              HasSubstr("clamp_angle_deg"));
  write("profile.csv", "x,y\n0,0\n0.01,0\n");
  EXPECT_THAT(refusal(), HasSubstr("2 points"));
  // A straight strip is on the clamp's line, but not where that points further down.
  EXPECT_THAT(message_of([&] { with_points(1, -1); }), HasSubstr("no error"));
  EXPECT_THAT(message_of([&] { with_points(1, 1); }),
              AllOf(StartsWith("profile.csv: the tip is"), HasSubstr("y is up")));
  EXPECT_THAT(message_of([&] { with_points(-1, -1); }),
              AllOf(HasSubstr("the tip's x is"), HasSubstr("the first point at the clamp")));
  std::string text = "x,y\n";
  for (int i = 0; i < 10; ++i) text += std::to_string(10 * i) + ",0\n";
  write("profile.csv", text);
  EXPECT_THAT(refusal(), HasSubstr("in m"));
}

class OverhangCapture : public ReadMechanical {
 protected:
  void SetUp() override {
    write("capture.toml",
          "format = \"weft-capture\"\nversion = 1\nkind = \"mechanical\"\ntest = "
          "\"overhang\"\nspecimen = { width = 0.025, areal_density = 0.15, grain_angle_deg = 90 "
          "}\n[overhang]\nlengths = [77, 79.5, 78]\nlength_unit = \"mm\"\n");
    write("readings.csv", "face,overhang\n1,7.7\n2,7.95\n");
  }
};

TEST_F(OverhangCapture, IsAStripOverAnEdgeWithAFrameAReading) {
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  ASSERT_TRUE(capture.overhang);
  EXPECT_EQ(capture.frame_count, 3);
  EXPECT_NEAR(capture.overhang->lengths[1], 0.0795, 1e-15);
  EXPECT_NEAR(capture.overhang->angle, 41.5 * std::numbers::pi / 180, 1e-15);
  EXPECT_EQ(capture.gravity, Vec3(0, 0, -9.81));
  EXPECT_FALSE(capture.geometry);
  ASSERT_EQ(capture.fixtures.size(), 1u);
  const Clip& edge = capture.fixtures[0].frames[2];
  EXPECT_NEAR(capture.width - edge.region.upper.x(), (0.077 + 0.0795 + 0.078) / 3, 1e-15);
  EXPECT_EQ(capture.height, 0.025);
  // The edge is where the clip ends, horizontal.
  EXPECT_LT(edge.place({edge.region.upper.x(), 0.0125}).cwiseProduct(Vec3(1, 0, 1)).norm(), 1e-15);
}

// Of 77, 79.5 and 78: mean 78.1667, squares 1.3611 + 1.7778 + 0.0278, over 2.
TEST_F(OverhangCapture, DeviationIsTheScatterOfThreeOrStated) {
  EXPECT_NEAR(read_mechanical_capture(folder_).overhang->deviation, std::sqrt(3.16667 / 2) * 1e-3,
              1e-8);
  replace("capture.toml", "[77, 79.5, 78]", "[77, 77, 77]");
  EXPECT_NEAR(read_mechanical_capture(folder_).overhang->deviation, 1e-3 / std::sqrt(12), 1e-12);
  replace("capture.toml", "[77, 77, 77]", "[77, 90]");
  EXPECT_EQ(read_mechanical_capture(folder_).overhang->deviation, 1e-3);
  replace("capture.toml", "[77, 90]", "[77, 90]\ndeviation = 2.5");
  EXPECT_NEAR(read_mechanical_capture(folder_).overhang->deviation, 2.5e-3, 1e-15);
}

TEST_F(OverhangCapture, TakesTheColumnOfATable) {
  replace("capture.toml", "lengths = [77, 79.5, 78]\nlength_unit = \"mm\"",
          "file = \"readings.csv\"\ncolumn = \"overhang\"\nlength_unit = \"cm\"\nangle_deg = 45");
  const MechanicalCapture capture = read_mechanical_capture(folder_);
  EXPECT_EQ(capture.frame_count, 2);
  EXPECT_NEAR(capture.overhang->lengths[1], 0.0795, 1e-15);
  EXPECT_NEAR(capture.overhang->angle, std::numbers::pi / 4, 1e-15);
  replace("capture.toml", "length_unit = \"cm\"\n", "");
  EXPECT_THAT(refusal(), StartsWith("readings.csv:2: overhang: 7.7 is out of range; must be in "
                                    "[0.001, 1]; is length_unit right?"));
  replace("capture.toml", "column = \"overhang\"", "column = \"L\"");
  EXPECT_THAT(refusal(), HasSubstr("no column \"L\""));
}

TEST_F(OverhangCapture, NamesFileLineAndKey) {
  EXPECT_THAT(refusal_with("capture.toml", "length_unit = \"mm\"\n", ""),
              StartsWith("capture.toml:7: overhang.lengths"));
  EXPECT_THAT(refusal_with("capture.toml", "lengths = [77, 79.5, 78]", "lengths = []"),
              HasSubstr("overhang.lengths"));
  EXPECT_THAT(refusal_with("capture.toml", "lengths = [77, 79.5, 78]\n", ""),
              StartsWith("capture.toml:6: overhang: either lengths or file is needed"));
  EXPECT_THAT(refusal_with("capture.toml", "lengths = ", "file = \"readings.csv\"\nlengths = "),
              HasSubstr("either lengths or file is needed"));
  EXPECT_THAT(refusal_with("capture.toml", "lengths = ", "angle_deg = 80\nlengths = "),
              StartsWith("capture.toml:7: overhang.angle_deg: 80 is out of range; must be in [1, "
                         "74]"));
  EXPECT_THAT(refusal_with("capture.toml", "lengths = ", "deviation = 0\nlengths = "),
              HasSubstr("overhang.deviation: 0 is out of range"));
  EXPECT_THAT(refusal_with("capture.toml", "lengths = ", "length = 3\nlengths = "),
              HasSubstr("overhang.length: unknown key"));
  EXPECT_THAT(refusal_with("capture.toml", "{ width", "{ free_length = 0.1, width"),
              HasSubstr("specimen.free_length: unknown key"));
  const std::string kind = "kind = \"mechanical\"\n";
  EXPECT_THAT(refusal_with("capture.toml", kind, kind + "clip_noise = 1e-5\n"),
              StartsWith("capture.toml:4: clip_noise: not valid for an overhang"));
}

}  // namespace
}  // namespace weft::mechanical_capture_test
