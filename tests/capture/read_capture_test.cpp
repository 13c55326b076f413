#include <fmt/format.h>
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <numbers>

#include "capture/temporary_capture.h"
#include "weft/capture/capture_checks.h"

namespace weft::read_capture_test {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class ReadCapture : public TemporaryCapture {
 protected:
  /// Says what read_capture thinks of the capture with another camera.
  std::string message_with_camera(const Projection& projection) const {
    std::string rows;
    for (int i = 0; i < 3; ++i) {
      rows += fmt::format("[{}, {}, {}, {}],", projection(i, 0), projection(i, 1), projection(i, 2),
                          projection(i, 3));
    }
    const std::string text = text_of(folder_ / "capture.toml");
    const std::size_t begin = text.find("projection = ");
    const std::size_t end = text.find("\n]", begin) + 2;
    return message_with(text.substr(begin, end - begin), "projection = [" + rows + "]");
  }
};

TEST_F(ReadCapture, ReadsTheBundledCapture) {
  const Capture capture = read_capture(bundled_capture());
  EXPECT_EQ(capture.name, "cotton_waving_A");
  EXPECT_EQ(capture.width, 0.5);
  EXPECT_EQ(capture.height, 0.5);
  EXPECT_EQ(capture.areal_density, 0.3);
  EXPECT_EQ(capture.hem_width, 0);
  EXPECT_FALSE(capture.start_surface.has_value());
  EXPECT_EQ(capture.gravity, Vec3(0, 0, -9.81));
  EXPECT_EQ(capture.frame_rate, 30);
  EXPECT_EQ(capture.frame_count, 100);
  EXPECT_EQ(capture.fit_first, 0);
  EXPECT_EQ(capture.fit_last, 49);
  EXPECT_EQ(capture.rig.width, 640);
  EXPECT_EQ(capture.rig.height, 480);
  EXPECT_EQ(capture.rig.pattern.period, 22.821);
  EXPECT_EQ(capture.rig.pattern.profile, StripePattern::Profile::square);
  EXPECT_FALSE(capture.distortion.has_value());
  EXPECT_TRUE(capture.video.is_absolute());
  ASSERT_EQ(capture.fixtures.size(), 2u);
  EXPECT_EQ(capture.fixtures[1].name, "right corner");
  EXPECT_EQ(capture.fixtures[1].at, Vec2(0.5, 0));
  // The second row of corners.csv.
  EXPECT_NEAR((capture.fixtures[1].motion.position(1 / 30.0) - Vec3(0.1875, 0.000011322, 1)).norm(),
              0, 1e-9);
  ASSERT_TRUE(capture.truth.has_value());
}

// Fixtures, camera and truth were written by different programs: they must meet.
TEST_F(ReadCapture, FixturesOfTheBundledCaptureAreWhereItsTruthHasThem) {
  const Capture capture = read_capture(bundled_capture());
  const TruthSurface truth = read_truth(capture);
  for (const int frame : {0, 20, 49, 99}) {
    const Points& x = truth.frames[static_cast<std::size_t>(frame)];
    const double time = frame / capture.frame_rate;
    // Corners of the 41 x 41 grid. Blender's pins give way by a fraction of a millimetre.
    EXPECT_NEAR((x.col(0) - capture.fixtures[0].motion.position(time)).norm(), 0, 5e-4);
    EXPECT_NEAR((x.col(40) - capture.fixtures[1].motion.position(time)).norm(), 0, 5e-4);
    for (Eigen::Index i = 0; i < x.cols(); ++i) {
      const Vec3 image = capture.rig.camera.project(x.col(i));
      ASSERT_TRUE(image.x() > 0 && image.x() < 640 && image.y() > 0 && image.y() < 480);
    }
  }
}

TEST_F(ReadCapture, OptionalKeysHaveTheirDefaults) {
  replace("capture.toml", "[world]", "#");
  replace("capture.toml", "gravity = ", "#");
  replace("capture.toml", "fit_frames = ", "#");
  replace("capture.toml", "name = \"cotton_waving_A\"", "");
  replace("capture.toml", "start = ", "#");
  replace("capture.toml", "description = ", "#");
  std::string text = text_of(folder_ / "capture.toml");
  write("capture.toml", text.substr(0, text.find("[truth]")));
  const Capture capture = read_capture(folder_);
  EXPECT_EQ(capture.gravity, Vec3(0, 0, -9.81));
  EXPECT_EQ(capture.fit_last, 99);
  EXPECT_EQ(capture.name, folder_.filename().string());
  EXPECT_FALSE(capture.truth.has_value());
  EXPECT_EQ(capture.rig.projector_width, 0);
}

TEST_F(ReadCapture, OptionalKeysAreRead) {
  replace("capture.toml", "pattern = \"square\"",
          "pattern = \"sine\"\nedge_gain = 7.5\nblack_level = 0.1\nwidth = 1920\nheight = 1080");
  replace("capture.toml", "height = 480 ",
          "height = 480\ndistortion = [0.1, -0.2, 1e-3, 2e-3, 0.05]\n#");
  const Capture capture = read_capture(folder_);
  EXPECT_EQ(capture.rig.pattern.profile, StripePattern::Profile::sine);
  EXPECT_EQ(capture.rig.pattern.edge_gain, 7.5);
  EXPECT_EQ(capture.rig.pattern.black_level, 0.1);
  EXPECT_EQ(capture.rig.projector_width, 1920);
  EXPECT_EQ(capture.rig.projector_height, 1080);
  ASSERT_TRUE(capture.distortion.has_value());
  EXPECT_EQ(capture.distortion->k1, 0.1);
  EXPECT_EQ(capture.distortion->k2, -0.2);
  EXPECT_EQ(capture.distortion->p1, 1e-3);
  EXPECT_EQ(capture.distortion->p2, 2e-3);
  EXPECT_EQ(capture.distortion->k3, 0.05);
}

TEST_F(ReadCapture, MissingKeysAreNamed) {
  EXPECT_EQ(message_with("width = 0.5 ", "#"), "capture.toml:7: swatch.width: missing");
  EXPECT_THAT(message_with("format = ", "#"), HasSubstr("capture.toml: format: missing"));
  EXPECT_THAT(message_with("file = ", "#"), HasSubstr("video.file: missing"));
  EXPECT_THAT(message_with("frame_count = ", "#"), HasSubstr("video.frame_count: missing"));
  EXPECT_THAT(message_with("[camera]", "[kamera]"),
              HasSubstr("camera: missing (is it \"kamera\" on line 22?)"));
  EXPECT_THAT(message_with("stripe_period = ", "#"), HasSubstr("projector.stripe_period: missing"));
  EXPECT_THAT(message_with("at = [0.5, 0.0]", ""),
              AllOf(StartsWith("capture.toml:49: "), HasSubstr("fixture[1].at: missing")));
  EXPECT_THAT(message_with("points = ", "#"), HasSubstr("truth.points: missing"));
  const std::string text = text_of(folder_ / "capture.toml");
  write("capture.toml", text.substr(0, text.find("[[fixture]]")));
  EXPECT_THAT(message(), HasSubstr("capture.toml: fixture: missing; at least one [[fixture]]"));
}

TEST_F(ReadCapture, UnknownKeysAreNamedWithAHint) {
  EXPECT_EQ(message_with("start = ", "strat = "),
            "capture.toml:20: video.strat: unknown key; did you mean \"start\"?");
  EXPECT_THAT(message_with("[truth]", "[extra]\na = 1\n[truth]"),
              AllOf(HasSubstr("extra: unknown key"), Not(HasSubstr("did you mean"))));
  EXPECT_THAT(message_with("stripe_period", "blak_level = 0.1\nstripe_period"),
              HasSubstr("projector.blak_level: unknown key; did you mean \"black_level\"?"));
  EXPECT_THAT(message_with("at = [0.5, 0.0]", "at = [0.5, 0.0]\nvertex = 24"),
              HasSubstr("fixture[1].vertex: unknown key"));
}

TEST_F(ReadCapture, ValuesOutOfRangeAreRejectedWithTheRange) {
  EXPECT_EQ(message_with("width = 0.5 ", "width = 500 "),
            "capture.toml:8: swatch.width: 500 is out of range; must be in [0.001, 10]");
  EXPECT_THAT(message_with("height = 0.5 ", "height = -0.5 "), HasSubstr("swatch.height: -0.5"));
  EXPECT_THAT(message_with("areal_density = 0.3", "areal_density = 300"),
              HasSubstr("swatch.areal_density: 300 is out of range"));
  EXPECT_THAT(message_with("areal_density = 0.3", "areal_density = nan"),
              HasSubstr("swatch.areal_density: nan is not a finite number"));
  EXPECT_THAT(message_with("areal_density = 0.3", "areal_density = 0.3\nhem_width = -0.01"),
              HasSubstr("swatch.hem_width: -0.01 is out of range"));
  EXPECT_THAT(message_with("-9.81", "-981"), HasSubstr("world.gravity[2]: -981 is out of range"));
  EXPECT_THAT(message_with("frame_rate = 30.0", "frame_rate = 0"), HasSubstr("video.frame_rate"));
  EXPECT_THAT(message_with("frame_count = 100", "frame_count = 0"), HasSubstr("video.frame_count"));
  EXPECT_THAT(message_with("fit_frames = [0, 49]", "fit_frames = [0, 100]"),
              HasSubstr("video.fit_frames[1]: 100 is out of range; must be in [0, 99]"));
  EXPECT_THAT(message_with("fit_frames = [0, 49]", "fit_frames = [9, 3]"),
              HasSubstr("video.fit_frames: first frame 9 is after last frame 3"));
  EXPECT_THAT(message_with("stripe_period = 22.821", "stripe_period = 0"),
              HasSubstr("projector.stripe_period: 0 is out of range"));
  EXPECT_THAT(message_with("version = 1", "version = 2"), HasSubstr("version: 2 is out of range"));
  EXPECT_THAT(message_with("kind = \"video\"", "kind = \"forces\""), HasSubstr("kind: \"forces\""));
  EXPECT_THAT(message_with("at-rest", "moving"), HasSubstr("must be \"at-rest\""));
  EXPECT_THAT(message_with("\"square\"", "\"dots\""),
              HasSubstr("projector.pattern: \"dots\" is not valid; must be one of \"square\""));
  EXPECT_THAT(message_with("at = [0.5, 0.0]", "at = [0.6, 0.0]"),
              HasSubstr("fixture[1].at: (0.6, 0) is off the swatch; u must be in [0, 0.5]"));
  EXPECT_THAT(message_with("pattern = ", "width = 800\npattern = "),
              HasSubstr("projector.width: width and height must be given together"));
}

TEST_F(ReadCapture, WrongShapesOfMatricesAreRejected) {
  EXPECT_THAT(message_with(", 491.5784543127535]", "]"),
              AllOf(StartsWith("capture.toml:27: camera.projection[0]: "),
                    HasSubstr("expected an array of 4 numbers, found 3")));
  EXPECT_THAT(message_with("[891.159136516144, 343.53024806944643, -14.911809586536997, "
                           "491.5784543127535],",
                           ""),
              HasSubstr("camera.projection: expected an array of 3 rows of 4 numbers, found 2"));
  EXPECT_THAT(message_with("891.159136516144", "\"891\""),
              HasSubstr("camera.projection[0][0]: expected a number, found a string"));
  EXPECT_THAT(message_with("891.159136516144", "inf"), HasSubstr("not a finite number"));
  EXPECT_THAT(message_with("at = [0.5, 0.0]", "at = [0.5]"),
              HasSubstr("fixture[1].at: expected an array of 2 numbers, found 1"));
  EXPECT_THAT(message_with("height = 480", "distortion = [0.1, 0.2]\nheight = 480"),
              HasSubstr("camera.distortion: expected an array of 5 numbers, found 2"));
}

TEST_F(ReadCapture, ASingularProjectionIsRejected) {
  Projection projection = read_capture(folder_).rig.camera.projection();
  projection.row(1) = 2 * projection.row(0);
  EXPECT_THAT(message_with_camera(projection),
              AllOf(HasSubstr("camera.projection: "), HasSubstr("singular")));
}

TEST_F(ReadCapture, ACameraThatLooksAwayIsRejected) {
  const Pinhole camera = read_capture(folder_).rig.camera;
  const Mat3 left = camera.projection().leftCols<3>();
  // The same camera in the same place, turned about the vertical.
  const auto turned = [&](double degrees) {
    const Mat3 turn =
        Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Vec3::UnitZ()).toRotationMatrix();
    Projection projection;
    projection << left * turn, -left * turn * camera.center();
    return projection;
  };
  EXPECT_EQ(message_with_camera(turned(0)), "no error");
  EXPECT_EQ(message_with_camera(-3 * turned(0)), "no error") << "the scale of a projection is free";
  for (const double degrees : {150.0, 180.0, 200.0}) {
    EXPECT_THAT(message_with_camera(turned(degrees)),
                AllOf(StartsWith("capture.toml:26: camera.projection: "), HasSubstr("looks away")));
    EXPECT_THAT(message_with_camera(-turned(degrees)), HasSubstr("looks away"));
  }
  EXPECT_THAT(message_with_camera(turned(45)),
              AllOf(HasSubstr("camera.projection: the camera does not see \""),
                    EndsWith("outside its 640 x 480 px")));
}

TEST_F(ReadCapture, ACameraThatTheSwatchSwingsBehindIsRejected) {
  // The camera is 1.5 m from the corners; in the last row they are 9 m nearer.
  const std::string text = text_of(folder_ / "corners.csv");
  const std::size_t last = text.rfind('\n', text.size() - 2) + 1;
  write("corners.csv", text.substr(0, last) + "3.3,-0.1875,-9,1,0.1875,-9,1\n");
  EXPECT_THAT(message(), AllOf(StartsWith("capture.toml:"), HasSubstr("is behind the camera at")));
}

TEST_F(ReadCapture, AProjectorThatDoesNotSeeTheCornersIsRejected) {
  EXPECT_THAT(message_with("pattern = ", "width = 100\nheight = 100\npattern = "),
              HasSubstr("projector.projection: the projector does not see \"left corner\""));
}

TEST_F(ReadCapture, CornersFurtherApartThanTheClothCanStretchAreRejected) {
  // They are 0.375 m apart at rest and 0.3881 m at most: 1.1 times 0.3409 and 0.3528 m.
  EXPECT_EQ(message_with("at = [0.5, 0.0]", "at = [0.353, 0.0]"), "no error");
  EXPECT_THAT(message_with("at = [0.5, 0.0]", "at = [0.340, 0.0]"),
              AllOf(StartsWith("capture.toml:53: fixture[1].motion: "),
                    HasSubstr("\"left corner\" and \"right corner\" are 0.375 m apart"),
                    HasSubstr("0.34 m apart")));
}

TEST_F(ReadCapture, CornersTooFarApartAtAnyTimeAreRejected) {
  const std::string text = text_of(folder_ / "corners.csv");
  const std::size_t last = text.rfind('\n', text.size() - 2) + 1;
  // Twice as far, in the last row alone.
  write("corners.csv", text.substr(0, last) + "3.3,-0.375,0,1,0.375,0,1\n");
  EXPECT_THAT(message(),
              AllOf(HasSubstr("fixture[1].motion: at 3.3 s"), HasSubstr("0.75 m apart")));
}

TEST_F(ReadCapture, CornersInMillimetresAreRejected) {
  std::string csv = "time_s,left_x_m,left_y_m,left_z_m,right_x_m,right_y_m,right_z_m\n";
  for (int i = 0; i < 100; ++i) csv += fmt::format("{},-187.5,0,1000,187.5,0,1000\n", i / 30.0);
  write("corners.csv", csv);
  EXPECT_THAT(message(), HasSubstr("are 375 m apart"));
}

TEST_F(ReadCapture, TwoFixturesOfOneNameOrPlaceAreRejected) {
  EXPECT_THAT(message_with("\"right corner\"", "\"left corner\""),
              HasSubstr("fixture[1].name: two fixtures are named \"left corner\""));
  EXPECT_THAT(message_with("at = [0.5, 0.0]", "at = [0.0, 0.0]"),
              HasSubstr("hold the same point of the swatch"));
}

TEST_F(ReadCapture, TwoFixturesOfOneMotionAreRejected) {
  EXPECT_EQ(
      message_with("[\"right_x_m\", \"right_y_m\", \"right_z_m\"]",
                   "[\"left_x_m\", \"left_y_m\", \"left_z_m\"]"),
      "capture.toml:54: fixture[1].columns: \"left corner\" and \"right corner\" have the same "
      "columns of corners.csv");
  // Where one is but for one coordinate, which is the same.
  std::string csv = "time_s,left_x_m,left_y_m,left_z_m,right_x_m,right_y_m,right_z_m\n";
  for (int i = 0; i < 100; ++i) csv += fmt::format("{},0,0,1,0.004,0,1\n", i / 30.0);
  write("corners.csv", csv);
  EXPECT_THAT(message(), AllOf(StartsWith("capture.toml:53: fixture[1].motion: at 0 s"),
                               HasSubstr("0.004 m apart; valid: from 0.01 of their distance")));
}

TEST_F(ReadCapture, KnowsHowFarSamplesOfMotionAreApart) {
  EXPECT_NEAR(motion_sample_interval(read_capture(folder_)), 1 / 30.0, 1e-6);
}

TEST_F(ReadCapture, AMotionFileShorterThanTheVideoIsRejected) {
  std::string text = text_of(folder_ / "corners.csv");
  text.resize(text.rfind('\n', text.size() - 2) + 1);
  write("corners.csv", text);
  EXPECT_THAT(message(), AllOf(StartsWith("corners.csv: time_s: ends at 3.26667 s"),
                               HasSubstr("100 frames"), HasSubstr("3.3 s")));
}

TEST_F(ReadCapture, AMotionFileThatStartsAfterTheVideoIsRejected) {
  std::string text = text_of(folder_ / "corners.csv");
  const std::size_t second = text.find('\n') + 1;
  text.erase(second, text.find('\n', second) + 1 - second);
  write("corners.csv", text);
  EXPECT_THAT(message(), HasSubstr("corners.csv: time_s: starts at 0.0333333 s"));
}

TEST_F(ReadCapture, TimesThatAreNoTimesAreRejected) {
  replace("corners.csv", "0.033333333,", "nan,");
  EXPECT_EQ(message(), "corners.csv:3: time_s: \"nan\" is not a finite number");
  replace("corners.csv", "nan,", "0.5,");
  EXPECT_THAT(message(), AllOf(StartsWith("corners.csv:4: time_s: "), HasSubstr("must increase")));
  replace("corners.csv", "0.5,", "0.000000000,");
  EXPECT_THAT(message(), AllOf(StartsWith("corners.csv:3: time_s: "), HasSubstr("must increase")));
}

TEST_F(ReadCapture, BadMotionCellsAreRejected) {
  replace("corners.csv", "0.000011322", "inf");
  EXPECT_EQ(message(), "corners.csv:3: right_y_m: \"inf\" is not a finite number");
  replace("corners.csv", "inf", "1e");
  EXPECT_EQ(message(), "corners.csv:3: right_y_m: \"1e\" is not a finite number");
  replace("corners.csv", ",1e,", ",");
  EXPECT_EQ(message(), "corners.csv:3: 6 cells; the header has 7 columns");
}

TEST_F(ReadCapture, BadMotionHeadersAreRejected) {
  EXPECT_THAT(
      message_with("\"right_x_m\"", "\"rihgt_x_m\""),
      AllOf(StartsWith("capture.toml:54: fixture[1].columns: "),
            HasSubstr("corners.csv has no column \"rihgt_x_m\""), HasSubstr("time_s, left_x_m")));
  const std::string text = text_of(folder_ / "corners.csv");
  replace("corners.csv", "time_s", "time");
  EXPECT_EQ(message(), "corners.csv:1: time_s: no such column");
  write("corners.csv", "\n" + text_of(folder_ / "corners.csv"));
  EXPECT_EQ(message(), "corners.csv:2: time_s: no such column");
  write("corners.csv", text);
  replace("corners.csv", "right_z_m", "left_z_m");
  EXPECT_THAT(message(), HasSubstr("corners.csv:1: left_z_m: two columns of this name"));
  write("corners.csv", "");
  EXPECT_THAT(message(), HasSubstr("corners.csv: empty"));
  write("corners.csv", text.substr(0, text.find('\n')));
  EXPECT_THAT(message(), HasSubstr("corners.csv: no rows"));
}

TEST_F(ReadCapture, MotionFilesOfOtherProgramsAreRead) {
  std::string text = text_of(folder_ / "corners.csv");
  std::string changed = "\xef\xbb\xbf";
  for (const char c : text) {
    if (c == '\n') changed += "\r";
    changed += c;
    if (c == ',') changed += " ";
  }
  write("corners.csv", changed + "\r\n");
  EXPECT_EQ(message(), "no error");
}

TEST_F(ReadCapture, AbsentFilesAreNamed) {
  EXPECT_THAT(
      message_with("video.mp4", "film.mp4"),
      AllOf(StartsWith("capture.toml:16: video.file: no such file: "), HasSubstr("film.mp4")));
  EXPECT_THAT(message_with("video.mp4", "images/%04d.png"), HasSubstr("video.file: no such file"));
  EXPECT_THAT(
      message_with("motion = \"corners.csv\"", "motion = \"c.csv\""),
      AllOf(StartsWith("capture.toml:46: fixture[0].motion: no such file: "), HasSubstr("c.csv")));
  std::filesystem::remove(folder_ / "capture.toml");
  EXPECT_EQ(message(), "capture.toml: no such file");
  EXPECT_THAT(message_of([&] { read_capture(folder_ / "absent"); }), HasSubstr("not a folder"));
}

TEST_F(ReadCapture, NeverOpensTheTruth) {
  // The temporary folder has none.
  EXPECT_FALSE(std::filesystem::exists(folder_ / "truth"));
  EXPECT_EQ(message(), "no error");
}

}  // namespace
}  // namespace weft::read_capture_test
