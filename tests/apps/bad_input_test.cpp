/// What the program says of bad input: one line with file, key and reason, and exit status 2.
#include <gmock/gmock.h>

#include <sstream>

#include "apps/program.h"
#include "weft/fabric/fabric.h"
#include "weft/vision/video.h"

namespace weft::bad_input_test {
namespace {

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::StartsWith;

const std::filesystem::path kBundled =
    std::filesystem::path(WEFT_SOURCE_DIR) / "data/captures/cotton_waving_A";

/// Each test starts with a copy of the bundled capture, without its video, in the folder `c`.
class BadInput : public ProgramTest {
 protected:
  void SetUp() override {
    ProgramTest::SetUp();
    for (const std::string name : {"capture.toml", "corners.csv"}) {
      write("c/" + name, text_of(kBundled / name));
    }
    write("c/video.mp4", "");
  }
  /// Uses the bundled capture's video, which is long: only where frames are read.
  void with_video() const {
    std::filesystem::remove(folder_ / "c/video.mp4");
    std::filesystem::create_symlink(kBundled / "video.mp4", folder_ / "c/video.mp4");
  }
  /// Two frames, numbered images.
  void with_images(const Image& frame) const {
    replace("c/capture.toml", "video.mp4", "frame_%02d.png");
    replace("c/capture.toml", "frame_count = 100", "frame_count = 2");
    replace("c/capture.toml", "fit_frames = [0, 49]", "fit_frames = [0, 1]");
    for (const std::string name : {"frame_00.png", "frame_01.png"}) {
      write_png(folder_ / "c" / name, frame);
    }
  }
  /// What `check` says of the capture after one replacement in a file, which is undone afterwards;
  /// without the folder in front.
  std::string check_with(const std::string& name, const std::string& before,
                         const std::string& after) const {
    const std::string original = text_of(folder_ / "c" / name);
    replace("c/" + name, before, after);
    std::string message = check();
    write("c/" + name, original);
    return message;
  }
  std::string toml_with(const std::string& before, const std::string& after) const {
    return check_with("capture.toml", before, after);
  }
  std::string check() const { return bare(refusal({"check", capture()})); }
  std::string capture() const { return path("c"); }
  std::string bare(const std::string& message) const {
    const std::string prefix = path("c") + "/";
    return message.starts_with(prefix) ? message.substr(prefix.size()) : message;
  }
};

TEST_F(BadInput, MissingAndUnknownKeys) {
  EXPECT_EQ(toml_with("areal_density = 0.3", ""), "capture.toml:7: swatch.areal_density: missing");
  EXPECT_EQ(toml_with("start = ", "strat = "),
            "capture.toml:20: video.strat: unknown key; did you mean \"start\"?");
  EXPECT_EQ(toml_with("areal_density = 0.3", "areal_density = \"light\""),
            "capture.toml:10: swatch.areal_density: expected a number, found a string");
  EXPECT_EQ(toml_with("areal_density = 0.3", "areal_density = nan"),
            "capture.toml:10: swatch.areal_density: nan is not a finite number");
  EXPECT_THAT(toml_with("[truth]", "[truth"), StartsWith("capture.toml:56: "));
}

TEST_F(BadInput, WrongShapesOfMatrices) {
  EXPECT_EQ(toml_with(", 491.5784543127535]", "]"),
            "capture.toml:27: camera.projection[0]: expected an array of 4 numbers, found 3");
  EXPECT_THAT(toml_with("  [0.06645141735241232, 0.9635455516099786, -0.2591605276744081, "
                        "1.6940459825650473]\n",
                        ""),
              AllOf(StartsWith("capture.toml:34: projector.projection: "),
                    HasSubstr("3 rows of 4 numbers, found 2")));
}

TEST_F(BadInput, ACameraThatLooksAway) {
  // Rows of the depth and of x negated: the same camera turned by half a turn about the vertical.
  replace("c/capture.toml",
          "[891.159136516144, 343.53024806944643, -14.911809586536997, 491.5784543127535]",
          "[-891.159136516144, -343.53024806944643, 14.911809586536997, -491.5784543127535]");
  EXPECT_THAT(toml_with("[-0.026628231404530328, 0.9985586776698873, -0.046599404957928116, "
                        "1.5361826697273546]",
                        "[0.026628231404530328, -0.9985586776698873, 0.046599404957928116, "
                        "-1.5361826697273546]"),
              AllOf(StartsWith("capture.toml:26: camera.projection: "), HasSubstr("looks away")));
}

TEST_F(BadInput, CornersThatDoNotMatchTheRestShape) {
  EXPECT_THAT(
      toml_with("at = [0.5, 0.0]", "at = [0.3, 0.0]"),
      AllOf(StartsWith("capture.toml:53: fixture[1].motion: at 0 s \"left corner\" and \"right"),
            HasSubstr("0.375 m apart"), HasSubstr("stretch to 0.33 m at most")));
}

TEST_F(BadInput, MotionFiles) {
  const std::string text = text_of(folder_ / "c/corners.csv");
  write("c/corners.csv", text.substr(0, text.rfind('\n', text.size() - 2) + 1));
  EXPECT_THAT(check(), AllOf(StartsWith("corners.csv: time_s: ends at 3.26667 s"),
                             HasSubstr("100 frames"), HasSubstr("3.3 s")));
  write("c/corners.csv", text);
  EXPECT_EQ(check_with("corners.csv", "0.033333333,", "nan,"),
            "corners.csv:3: time_s: \"nan\" is not a finite number");
  EXPECT_THAT(check_with("corners.csv", "0.033333333,", "0.5,"),
              AllOf(StartsWith("corners.csv:4: time_s: "), HasSubstr("must increase")));
  EXPECT_EQ(check_with("corners.csv", "0.000011322", "inf"),
            "corners.csv:3: right_y_m: \"inf\" is not a finite number");
  EXPECT_THAT(toml_with("\"left_y_m\"", "\"left_y\""),
              AllOf(StartsWith("capture.toml:47: fixture[0].columns: "), HasSubstr("\"left_y\"")));
  std::filesystem::remove(folder_ / "c/corners.csv");
  EXPECT_THAT(check(), AllOf(StartsWith("capture.toml:46: fixture[0].motion: no such file: "),
                             EndsWith("corners.csv")));
}

TEST_F(BadInput, MissingFiles) {
  EXPECT_EQ(refusal({"check", path("nowhere")}),
            path("nowhere") + ": not a folder; a capture is a folder with a capture.toml");
  std::filesystem::remove(folder_ / "c/video.mp4");
  EXPECT_THAT(check(), AllOf(StartsWith("capture.toml:16: video.file: no such file: "),
                             EndsWith("c/video.mp4")));
  std::filesystem::remove(folder_ / "c/capture.toml");
  EXPECT_EQ(check(), "capture.toml: no such file");
}

TEST_F(BadInput, PathsThatTheSystemRefuses) {
  const std::string circle = ": cannot be read: Too many levels of symbolic links";
  const std::string longest(300, 'a'), too_long = ": cannot be read: File name too long";
  std::filesystem::create_symlink("loop", folder_ / "loop");
  EXPECT_EQ(refusal({"check", path("loop")}), path("loop") + circle);
  EXPECT_EQ(refusal({"check", path(longest)}), path(longest) + too_long);
  std::filesystem::create_symlink("loop.csv", folder_ / "c/loop.csv");
  EXPECT_EQ(toml_with("motion = \"corners.csv\"", "motion = \"loop.csv\""),
            "capture.toml:46: fixture[0].motion: " + path("c/loop.csv") + circle);
  EXPECT_EQ(toml_with("video.mp4", longest),
            "capture.toml:16: video.file: " + path("c/" + longest) + too_long);
  EXPECT_EQ(toml_with("video.mp4", longest + "/%d.png"),
            "capture.toml:16: video.file: " + path("c/" + longest) + too_long);
  write("tests.toml", "format = \"weft-experiments\"\nversion = 1\n[[experiment]]\ncapture = \"" +
                          longest + "\"\n");
  EXPECT_EQ(refusal({"suggest", "satin", "--candidates", path("tests.toml")}),
            path("tests.toml") + ":4: experiment[0].capture: " + path(longest) + too_long);
  std::filesystem::create_directories(folder_ / "out");
  std::filesystem::create_symlink("result.json", folder_ / "out/result.json");
  EXPECT_EQ(refusal({"fit", capture(), "--out", path("out")}), path("out/result.json") + circle);
}

TEST_F(BadInput, PathsThatAreNoUtf8) {
  const std::string latin = path("caf\xe9"), shown = path("caf\\xe9");
  std::filesystem::copy(capture(), latin);
  EXPECT_EQ(refusal({"fit", latin, "--out", path("out")}),
            "argument 2, \"" + shown + "\", is not valid UTF-8");
  EXPECT_EQ(refusal({"fit", capture(), "--out", path("out"), "--name", "caf\xe9"}),
            "argument 6, \"caf\\xe9\", is not valid UTF-8");
  // The results of a fit have the folder of each capture, as a whole.
  const std::string output = path("out");
  ChildProcess child({"/usr/bin/env", "-C", latin, WEFT_PROGRAM, "fit", ".", "--out", output});
  child.wait();
  EXPECT_EQ(child.status(), 2);
  EXPECT_THAT(child.err(), AllOf(StartsWith("weft: error: " + shown), HasSubstr("valid UTF-8")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  std::filesystem::copy(capture(), path("caf\u00e9"));
  EXPECT_EQ(refusal({"check", path("caf\u00e9")}),
            path("caf\u00e9/video.mp4") + ": cannot be read as a video");
}

TEST_F(BadInput, VideosThatCannotBeRead) {
  write("c/video.mp4", "this is no video");
  EXPECT_EQ(check(), "video.mp4: cannot be read as a video");
  // Cut short: the index of an MP4 is at its end.
  write("c/video.mp4", text_of(kBundled / "video.mp4").substr(0, 100000));
  EXPECT_EQ(check(), "video.mp4: cannot be read as a video");
  with_images(Image::Constant(480, 640, 0.1f));
  std::filesystem::remove(folder_ / "c/frame_01.png");
  EXPECT_EQ(check(), "frame_01.png: frame 1: no such file");
  write("c/frame_01.png", "this is no image");
  EXPECT_EQ(check(), "frame_01.png: frame 1: cannot be read as an image");
}

TEST_F(BadInput, AVideoOfAnotherSize) {
  with_images(Image::Constant(120, 160, 0.1f));
  EXPECT_EQ(check(),
            "frame_%02d.png: frames of 160 x 120 px; capture.toml says camera.width = 640, "
            "camera.height = 480");
  replace("c/capture.toml", "frame_%02d.png", "video.mp4");
  replace("c/capture.toml", "width = 640", "width = 600");
  with_video();
  EXPECT_EQ(check(),
            "video.mp4: frames of 640 x 480 px; capture.toml says camera.width = 600, "
            "camera.height = 480");
}

TEST_F(BadInput, AVideoWithFewerFrames) {
  with_video();
  replace("c/capture.toml", "frame_count = 100", "frame_count = 101");
  replace("c/capture.toml", "frame_rate = 30.0", "frame_rate = 31.0");
  EXPECT_THAT(check(), AllOf(StartsWith("video.mp4: frame 100: "), HasSubstr("101 frames")));
}

TEST_F(BadInput, TimesThatHardlyFitAreWarnedOf) {
  with_video();
  replace("c/capture.toml", "frame_count = 100", "frame_count = 20");  // each is looked at
  replace("c/capture.toml", "fit_frames = [0, 49]", "fit_frames = [0, 19]");
  const Outcome fine = weft({"check", capture()});
  EXPECT_EQ(fine.status, 0) << fine.err;
  EXPECT_EQ(fine.out.find("warning"), std::string::npos) << fine.out;
  replace("c/capture.toml", "frame_rate = 30.0", "frame_rate = 31.0");
  std::istringstream csv(text_of(folder_ / "c/corners.csv"));
  std::string sparse, line;
  for (int row = -1; std::getline(csv, line); ++row)
    if (row % 3 == 0 || row < 0) sparse += line + "\n";
  write("c/corners.csv", sparse);
  const Outcome doubtful = weft({"check", capture()});
  EXPECT_EQ(doubtful.status, 0) << doubtful.err;
  EXPECT_THAT(
      doubtful.out,
      AllOf(HasSubstr("warning: video.mp4 states 30 frames/s; capture.toml has frame_rate = "
                      "31\n"),
            HasSubstr("a sample every 3.1 frames"), HasSubstr("ok\n")));
}

TEST_F(BadInput, AVideoWithNoClothInIt) {
  with_images(Image::Constant(480, 640, 0.1f));
  EXPECT_THAT(check(), StartsWith("frame_%02d.png: frame 0: no cloth to be seen"));
  EXPECT_THAT(bare(refusal({"fit", capture(), "--out", path("out")})),
              StartsWith("frame_%02d.png: frame 0: no cloth to be seen"));
}

TEST_F(BadInput, Fabrics) {
  const auto with = [&](const std::string& before, const std::string& after) {
    write("f.toml", fabric_to_toml(Fabric::with_defaults("test")));
    replace("f.toml", before, after);
    const std::string message = refusal({"evaluate", capture(), "--fabric", path("f.toml")});
    EXPECT_TRUE(message.starts_with(path("f.toml"))) << message;
    return message.substr(std::min(message.size(), path("f.toml").size()));
  };
  EXPECT_THAT(with("\"baraff-witkin\"", "\"rubber\""),
              AllOf(StartsWith(":4: model: "), HasSubstr("\"rubber\"")));
  EXPECT_THAT(with("\"baraff-witkin\"", "\"springs\""),
              HasSubstr("parameters.weft_stretch: missing"));
  EXPECT_THAT(
      with("value = 500", "value = 5000.5"),
      AllOf(StartsWith(":7: parameters.stretch_stiffness.value: 5000.5"), HasSubstr("[5, 5000]")));
  EXPECT_THAT(with("lower = 5,", "lower = 6000,"),
              StartsWith(":7: parameters.stretch_stiffness.lower: 6000 is not below"));
  EXPECT_THAT(with("\"N/m\"", "\"Pa\""),
              StartsWith(":7: parameters.stretch_stiffness.unit: \"Pa\" is not valid"));
  EXPECT_THAT(with("bend_stiffness", "bent_stiffness"),
              HasSubstr("parameters.bend_stiffness: missing"));
  EXPECT_THAT(with("weft-fabric", "weft-capture"), StartsWith(":1: format: "));
  EXPECT_THAT(refusal({"evaluate", capture(), "--fabric", "silk"}),
              AllOf(HasSubstr("\"silk\" is neither a file nor a preset"), HasSubstr("satin-")));
}

TEST_F(BadInput, OutputThatCannotBeWritten) {
  write("file", "");
  EXPECT_THAT(refusal({"fit", capture(), "--out", path("file/out")}),
              StartsWith(path("file/out") + ": cannot be made: "));
  EXPECT_THAT(refusal({"fit", capture(), "--out", path("file")}),
              StartsWith(path("file") + ": cannot be made: "));
  EXPECT_THAT(refusal({"simulate", capture(), "--fabric", "satin", "--out", "/proc/weft"}),
              StartsWith("/proc/weft"));
  EXPECT_EQ(refusal({"fabrics", "satin", "--out", path("none/f.toml")}),
            path("none/f.toml") + ": cannot be written");
  // Found before anything is computed.
  EXPECT_EQ(
      refusal({"landscape", capture(), "--fabric", "satin", "--out", path("none/landscape.svg")}),
      path("none/landscape.svg") + ": cannot be written");
  EXPECT_EQ(refusal({"surface", capture(), "--out", path("none/s.obj")}),
            path("none/s.obj") + ": cannot be written");
  EXPECT_THAT(refusal({"surface", capture(), "--out", path("s.stl")}),
              AllOf(StartsWith(path("s.stl")), HasSubstr(".obj or .ply")));
  EXPECT_FALSE(std::filesystem::exists(path("out")));
}

TEST_F(BadInput, AnOutputFolderWithAnotherRunInIt) {
  const auto refused = [&](const std::string& name, const std::vector<std::string>& arguments) {
    write("out/" + name, "{}");
    std::vector<std::string> words = arguments;
    words.insert(words.end(), {"--out", path("out")});
    EXPECT_THAT(refusal(words), AllOf(StartsWith(path("out") + ": holds " + name),
                                      HasSubstr("another run"), HasSubstr("--overwrite")));
    EXPECT_EQ(text_of(folder_ / "out" / name), "{}");
    std::filesystem::remove_all(folder_ / "out");
  };
  refused("result.json", {"fit", capture()});
  refused("points.pc2", {"simulate", capture(), "--fabric", "satin"});
  refused("frame_0000.png", {"render", capture(), "--fabric", "satin"});
  refused("matrix.svg", {"matrix", capture(), "--fabrics", "satin"});
  refused("variability.svg", {"variability", capture(), "--fabric", "satin"});
  refused("profile.csv", {"profile", capture(), "--fabric", "satin"});
  refused("capture.toml", {"synthesize", "--fabric", "satin"});
  refused("capture_1.svg", {"compare", capture(), "--fabrics", "satin"});
  refused("capture_1.csv", {"compare", capture(), "--fabrics", "satin"});
}

TEST_F(BadInput, OutputsThatReplaceFiles) {
  const auto landscape = [&](const std::string& out) {
    return refusal({"landscape", capture(), "--fabric", "satin", "--out", path(out)});
  };
  EXPECT_EQ(landscape("l.csv"),
            "--out: " + path("l.csv") + ": a picture ends in .svg; its data go beside it, as .csv");
  const std::string corners = text_of(folder_ / "c/corners.csv");
  EXPECT_THAT(landscape("c/corners.svg"),
              AllOf(StartsWith("--out: " + path("c/corners.csv")), HasSubstr("would replace it")));
  EXPECT_EQ(text_of(folder_ / "c/corners.csv"), corners);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "c/corners.svg"));
  write("c/truth/rest.obj", "v 0 0 0\n");
  EXPECT_THAT(refusal({"surface", capture(), "--out", path("c/truth/rest.obj")}),
              HasSubstr("is the capture's truth.rest_mesh, which it would replace"));
  ASSERT_EQ(weft({"fabrics", "satin", "--out", path("f.toml")}).status, 0);
  EXPECT_THAT(refusal({"compare", capture(), "--fabrics", "satin", path("f.toml"), "--keep",
                       path("f.toml")}),
              AllOf(StartsWith("--keep: "), HasSubstr("is one of --fabrics")));
  EXPECT_EQ(refusal({"compare", capture(), "--fabrics", "satin", "--overwrite"}),
            "--overwrite: only with --out");
}

TEST_F(BadInput, StripesTooNarrowOrWideInTheImage) {
  for (const std::string period : {"1", "10000"}) {
    EXPECT_THAT(toml_with("stripe_period = 22.821", "stripe_period = " + period),
                AllOf(StartsWith("capture.toml:40: projector.stripe_period: " + period +
                                 " projector px are "),
                      HasSubstr("px in the camera's image; must be in [4, 200]")));
  }
}

TEST_F(BadInput, ACaptureGivenTwice) {
  const std::string again = capture() + "/../c/";
  const std::string reason = "captures: " + again + " is given twice";
  EXPECT_EQ(refusal({"fit", capture(), again, "--out", path("out")}), reason);
  EXPECT_EQ(refusal({"variability", capture(), again, "--fabric", "satin", "--out", path("out")}),
            reason);
  EXPECT_EQ(refusal({"matrix", capture(), again, "--fabrics", "satin", "--out", path("out")}),
            reason);
  EXPECT_EQ(refusal({"compare", capture(), again, "--fabrics", "satin"}), reason);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

TEST_F(BadInput, Commands) {
  EXPECT_THAT(refusal({"fti", "x"}), AllOf(StartsWith("\"fti\" is no command"), HasSubstr("fit")));
  EXPECT_THAT(refusal({}), HasSubstr("subcommand is required"));
  EXPECT_THAT(refusal({"fit"}), HasSubstr("captures is required"));
  EXPECT_THAT(refusal({"fit", capture()}), HasSubstr("--out is required"));
  EXPECT_THAT(refusal({"check", capture(), "--deep"}), HasSubstr("--deep"));
}

TEST_F(BadInput, Options) {
  const auto fit = [&](const std::string& option, const std::string& value) {
    return refusal({"fit", capture(), "--out", path("out"), option, value});
  };
  for (const std::string seed : {"-1", "1.5", "one", "99999999999999999999"}) {
    EXPECT_THAT(fit("--seed", seed), AllOf(StartsWith("--seed: " + seed), HasSubstr("from 0 to")));
  }
  // CLI11 takes a zero in front for octal, and 0x for hexadecimal.
  EXPECT_THAT(fit("--seed", "010"), StartsWith("--seed: 010 is not an integer from 0 to"));
  for (const std::string grid : {"010", "0x10", "1'0", "10.0", "402", "+10"})
    EXPECT_EQ(
        refusal({"surface", capture(), "--grid", grid}),
        "--grid: " + grid + " is not an integer from 3 to 401 (decimal, without zeros in front)");
  EXPECT_THAT(refusal({"surface", capture(), "--frame", "-1"}), StartsWith("--frame: -1 is not"));
  EXPECT_THAT(fit("--grid", "2"), AllOf(HasSubstr("--grid"), HasSubstr("3 to 401")));
  EXPECT_THAT(fit("--iterations", "-1"), AllOf(HasSubstr("--iterations"), HasSubstr("0 to")));
  EXPECT_THAT(refusal({"fit", capture(), "--out", path("out"), "--method", "annealing",
                       "--iterations", "0"}),
              AllOf(StartsWith("--iterations: 0"), HasSubstr("1 to")));
  EXPECT_THAT(fit("--hops", "-1"), AllOf(HasSubstr("--hops"), HasSubstr("0 to")));
  EXPECT_THAT(
      refusal({"fit", capture(), "--out", path("out"), "--method", "annealing", "--hops", "1"}),
      HasSubstr("--hops: only with --method auto"));
  EXPECT_THAT(fit("--searches", "0"), AllOf(HasSubstr("--searches"), HasSubstr("1 to")));
  EXPECT_THAT(
      refusal({"fit", capture(), "--out", path("out"), "--method", "annealing", "--searches", "2"}),
      HasSubstr("--searches: only with --method auto"));
  EXPECT_THAT(fit("--start-seed", "2"), HasSubstr("--start-seed: only with --start random"));
  EXPECT_THAT(fit("--coarse-levels", "0"), HasSubstr("--coarse-levels"));
  EXPECT_THAT(fit("--steps-per-frame", "0"), HasSubstr("--steps-per-frame"));
  EXPECT_THAT(fit("--alpha", "-0.1"), HasSubstr("--alpha"));
  EXPECT_THAT(fit("--threads", "-1"), HasSubstr("--threads"));
  EXPECT_THAT(fit("--simplex", "nan"), HasSubstr("--simplex"));
  EXPECT_THAT(fit("--start", "end"), AllOf(HasSubstr("--start"), HasSubstr("middle")));
  EXPECT_THAT(fit("--integrator", "euler"), AllOf(HasSubstr("--integrator"), HasSubstr("bdf2")));
  EXPECT_THAT(fit("--parameters", "bend"),
              AllOf(StartsWith("--parameters: "), HasSubstr("\"bend\""), HasSubstr("known: ")));
  EXPECT_THAT(refusal({"fit", capture(), "--out", path("out"), "--method", "annealing", "--coarse",
                       "bend"}),
              AllOf(StartsWith("--coarse: "), HasSubstr("\"bend\"")));
  EXPECT_THAT(refusal({"fit", capture(), "--out", path("out"), "--method", "annealing", "--coarse",
                       "bend_stiffness", "--parameters", "shear_stiffness"}),
              StartsWith("--coarse: bend_stiffness is not searched; these are: shear_stiffness"));
  EXPECT_THAT(fit("--method", "newton"), AllOf(HasSubstr("--method"), HasSubstr("annealing")));
  EXPECT_THAT(fit("--initial", "silk"), HasSubstr("\"silk\""));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out")) << "refused, but the folder was made";
  EXPECT_THAT(refusal({"surface", capture(), "--frame", "100"}),
              AllOf(StartsWith("--frame 100: "), HasSubstr("0 to 99")));
  EXPECT_THAT(refusal({"landscape", capture(), "--fabric", "satin", "--x", "bend"}),
              AllOf(StartsWith("--x: "), HasSubstr("\"bend\"")));
  EXPECT_THAT(refusal({"render", capture(), "--out", path("out")}), HasSubstr("--fabric"));
  EXPECT_THAT(
      refusal({"synthesize", "--fabric", "satin", "--out", path("out"), "--start-shape", "99"}),
      HasSubstr("start"));
  EXPECT_THAT(refusal({"fabrics", "--scale", "bend_stiffness=2"}), StartsWith("--scale"));
  EXPECT_THAT(refusal({"fabrics", "satin", "--scale", "bend_stiffness"}), HasSubstr("NAME=FACTOR"));
  EXPECT_THAT(refusal({"fabrics", "satin", "--scale", "bend_stiffness=1e9"}),
              AllOf(HasSubstr("bend_stiffness"), HasSubstr("[1e-07, 0.01]")));
}

// What was given and would not count is said.
TEST_F(BadInput, OptionsThatWouldNotCount) {
  const auto fit = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"fit", capture(), "--out", path("out")};
    words.insert(words.end(), more.begin(), more.end());
    return refusal(words);
  };
  EXPECT_THAT(fit({"--simplex", "0.5"}), AllOf(StartsWith("--simplex"), HasSubstr("--iterations")));
  EXPECT_THAT(fit({"--integrator", "runge-kutta"}),
              AllOf(StartsWith("--integrator"), HasSubstr("derivatives")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out")) << "refused, but the folder was made";
  EXPECT_THAT(refusal({"evaluate", capture(), "--fabric", "satin", "--integrator", "runge-kutta",
                       "--steps-per-frame", "7"}),
              StartsWith("--steps-per-frame"));
  EXPECT_THAT(refusal({"render", capture(), "--out", path("out"), "--points", path("p.pc2"),
                       "--mesh", path("m.obj"), "--grid", "9"}),
              StartsWith("--grid: not with --points"));
  EXPECT_THAT(refusal({"posterior", path("out"), "--grid", "9"}),
              StartsWith("--grid: only with --true-cost"));
  const auto synthesize = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"synthesize", "--fabric", "satin", "--out", path("out")};
    words.insert(words.end(), more.begin(), more.end());
    return refusal(words);
  };
  EXPECT_THAT(synthesize({"--like", capture(), "--frames", "7"}), StartsWith("--frames: not with"));
  EXPECT_THAT(synthesize({"--scan", "--no-noise", "--noise", "0.01"}),
              StartsWith("--noise: not with"));
  EXPECT_THAT(synthesize({"--rig", "--tests", "shear", "shear"}), StartsWith("--tests: "));
  EXPECT_THAT(synthesize({"--rig", "--tests", "shear", "--known-forces"}),
              StartsWith("--known-forces: "));
  EXPECT_THAT(refusal({"suggest", "satin", "--like", capture(), "--areal-density", "0.2"}),
              StartsWith("--areal-density: not with --like"));
}

TEST_F(BadInput, Suggest) {
  EXPECT_THAT(refusal({"suggest", "silk"}), HasSubstr("\"silk\""));
  EXPECT_THAT(refusal({"suggest", "satin", "--parameters", "bend"}),
              AllOf(StartsWith("--parameters: "), HasSubstr("\"bend\"")));
  EXPECT_THAT(refusal({"suggest", "satin", "--separations", "1.5"}), HasSubstr("--separations"));
  EXPECT_THAT(refusal({"suggest", "satin", "--axes", "left"}), HasSubstr("--axes"));
  EXPECT_THAT(refusal({"suggest", "satin", "--separations", "1", "--amplitudes", "0.5"}),
              HasSubstr("less separation or amplitude"));
  EXPECT_THAT(refusal({"suggest", "satin", "--separations", "0.1", "--amplitudes", "0.1", "--axes",
                       "along"}),
              HasSubstr("or pass"));
  write("tests.toml",
        "format = \"weft-experiments\"\nversion = 1\n[[experiment]]\nseparation = 0\n");
  EXPECT_THAT(refusal({"suggest", "satin", "--candidates", path("tests.toml")}),
              AllOf(HasSubstr("tests.toml:4"), HasSubstr("separation")));
  EXPECT_THAT(refusal({"suggest", "satin", "--candidates", path("tests.toml"), "--frames", "9"}),
              StartsWith("--frames: not with --candidates"));
  std::filesystem::create_directories(folder_ / "empty");
  EXPECT_THAT(refusal({"suggest", path("empty")}), HasSubstr("fabric.toml"));
}

TEST_F(BadInput, PosteriorWithoutAFit) {
  std::filesystem::create_directories(folder_ / "empty");
  EXPECT_THAT(refusal({"posterior", path("empty")}), HasSubstr("result.json"));
  EXPECT_THAT(refusal({"posterior", path("empty"), "--steps", "1"}), HasSubstr("--steps"));
}

TEST_F(BadInput, PriorsNeedLeastSquares) {
  ASSERT_EQ(weft({"fabrics", "satin", "--out", path("f.toml")}).status, 0);
  replace("f.toml", "unit = \"N/m\",", "unit = \"N/m\", prior = { median = 30, factor = 2 },");
  EXPECT_THAT(refusal({"fit", capture(), "--out", path("out"), "--initial", path("f.toml"),
                       "--method", "annealing"}),
              AllOf(StartsWith(path("f.toml")), HasSubstr("--method auto")));
  replace("f.toml", "factor = 2", "factor = 0.5");
  EXPECT_THAT(refusal({"fit", capture(), "--out", path("out"), "--initial", path("f.toml")}),
              AllOf(HasSubstr("f.toml:"), HasSubstr("prior.factor")));
}

}  // namespace
}  // namespace weft::bad_input_test
