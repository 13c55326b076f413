#include "weft/capture/scan_capture.h"

#include <gmock/gmock.h>

#include "capture/temporary_capture.h"
#include "weft/capture/landmark_file.h"
#include "weft/capture/mechanical_capture.h"
#include "weft/mesh/mesh_io.h"

namespace weft::scan_capture_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class ReadScan : public TemporaryCapture {
 protected:
  void SetUp() override {
    mesh_ = make_swatch(0.1, 0.08, 5, 4, GridPattern::uniform);
    Points x = Points::Zero(3, mesh_.vertex_count());
    x.topRows(2) = mesh_.material;
    write_obj(folder_ / "hang.obj", mesh_, x);
    x.row(2).setConstant(0.5);
    write_pc2(folder_ / "hang.pc2", {0, 1, {x, 2 * x}});
    write("capture.toml", R"(format = "weft-capture"
version = 1
kind = "scan"
name = "swatch"

[swatch]
width = 0.1
height = 0.08
areal_density = 0.2
grain_angle_deg = 90

[world]
gravity = [0, -10, 0]

[[target]]
name = "hang"
grid = "hang.obj"
noise = 3e-4

[[target.clamp]]
name = "top"
kind = "bar"
region = [[0, 0], [0.1, 0]]

[[target.clamp]]
name = "corner"
kind = "points"
vertices = [19]
weight = 0.02
force_noise = 0.005
)");
  }
  std::string refusal() const {
    return message_of([this] {
      const ScanCapture capture = read_scan_capture(folder_);
      for (const ScanTarget& target : capture.targets) read_scan_shape(capture, target);
    });
  }
  std::string refusal_with(const std::string& before, const std::string& after) const {
    const std::string original = text_of(folder_ / "capture.toml");
    replace("capture.toml", before, after);
    std::string result = refusal();
    write("capture.toml", original);
    return result;
  }
  TriangleMesh mesh_;
};

TEST_F(ReadScan, ReadsATarget) {
  EXPECT_EQ(capture_kind(folder_), CaptureKind::scan);
  const ScanCapture capture = read_scan_capture(folder_);
  EXPECT_EQ(capture.name, "swatch");
  EXPECT_EQ(capture.height, 0.08);
  EXPECT_NEAR(capture.grain_angle, 1.5707963267948966, 1e-15);
  ASSERT_EQ(capture.targets.size(), 1u);
  const ScanTarget& target = capture.targets.front();
  EXPECT_EQ(target.noise, 3e-4);
  EXPECT_EQ(target.gravity, Vec3(0, -10, 0));
  ASSERT_EQ(target.clamps.size(), 2u);
  EXPECT_EQ(target.clamps[0].kind, ClampKind::bar);
  EXPECT_FALSE(target.clamps[0].force);
  EXPECT_NEAR(*target.clamps[1].force, 0.2, 1e-15);  // 20 g under 10 m/s^2
  EXPECT_EQ(target.clamps[1].force_noise, 0.005);
  // Vertex 19 is the last of 5 x 4.
  EXPECT_NEAR((target.clamps[1].region.lower - Vec2(0.1, 0.08)).norm(), 0, 1e-12);
  const ScanShape shape = read_scan_shape(capture, target);
  EXPECT_EQ(shape.mesh.vertex_count(), 20);
  EXPECT_EQ(shape.weights, VecX::Ones(20));
  EXPECT_EQ(shape.x.row(2).norm(), 0);
}

TEST_F(ReadScan, PositionsMayComeFromASequence) {
  replace("capture.toml", "noise = 3e-4", "points = \"hang.pc2\"\nframe = 1");
  const ScanCapture capture = read_scan_capture(folder_);
  EXPECT_EQ(read_scan_shape(capture, capture.targets.front()).x(2, 3), 1.0);
  EXPECT_THAT(refusal_with("frame = 1", "frame = 2"), HasSubstr("2 samples"));
}

TEST_F(ReadScan, UnsupportedVerticesHaveLessWeight) {
  std::string weights = "vertex,weight\n";
  for (int i = 0; i < 20; ++i) weights += std::to_string(i) + (i == 7 ? ",0\n" : ",1\n");
  write("w.csv", weights);
  replace("capture.toml", "noise = 3e-4", "weights = \"w.csv\"");
  const ScanCapture capture = read_scan_capture(folder_);
  const ScanShape shape = read_scan_shape(capture, capture.targets.front());
  EXPECT_EQ(shape.weights[7], 0);
  EXPECT_EQ(shape.weights.sum(), 19);
  write("w.csv", weights + "20,1\n");
  EXPECT_THAT(refusal(), HasSubstr("21 rows; the grid has 20 vertices"));
  write("w.csv", weights.replace(weights.find("3,1"), 3, "3,2"));
  EXPECT_THAT(refusal(), AllOf(StartsWith("w.csv:5"), HasSubstr("within [0, 1]")));
}

TEST_F(ReadScan, NothingMeasuredIsRefusedUnlessAClampPulls) {
  std::string weights = "weight\n";
  for (int i = 0; i < 20; ++i) weights += "0\n";
  write("w.csv", weights);
  replace("capture.toml", "noise = 3e-4", "weights = \"w.csv\"");
  EXPECT_EQ(refusal(), "no error");
  EXPECT_THAT(refusal_with("weight = 0.02\nforce_noise = 0.005\n", ""),
              AllOf(StartsWith("w.csv: weight: 0 for all vertices"), HasSubstr("\"hang\"")));
}

TEST_F(ReadScan, AGridOfAnotherSizeIsRefused) {
  replace("capture.toml", "vertices = [19]", "region = [[0.1, 0.08], [0.1, 0.08]]");
  Points x = Points::Zero(3, mesh_.vertex_count());
  for (const double scale : {1000.0, 0.001}) {
    x.topRows(2) = scale * mesh_.material;
    write_obj(folder_ / "hang.obj", mesh_, x);
    EXPECT_THAT(refusal(), AllOf(StartsWith("hang.obj: edges between measured vertices are"),
                                 HasSubstr("valid: 1/3 to 3")));
  }
  const TriangleMesh part = make_swatch(0.1, 0.06, 5, 4, GridPattern::uniform);
  x.topRows(2) = part.material;
  write_obj(folder_ / "hang.obj", part, x);
  EXPECT_THAT(refusal(), StartsWith("hang.obj: vt: (u, v) from (0, 0) to (0.1, 0.06); the swatch"));
}

TEST_F(ReadScan, WeightsOfOneFrameOfSeveral) {
  std::string weights = "frame,vertex,weight\n";
  for (int frame = 0; frame < 2; ++frame)
    for (int i = 0; i < 20; ++i)
      weights += std::to_string(frame) + "," + std::to_string(i) + (frame ? ",0.5\n" : ",1\n");
  write("w.csv", weights);
  replace("capture.toml", "noise = 3e-4", "points = \"hang.pc2\"\nframe = 1\nweights = \"w.csv\"");
  const ScanCapture capture = read_scan_capture(folder_);
  EXPECT_EQ(read_scan_shape(capture, capture.targets.front()).weights, VecX::Constant(20, 0.5));
}

TEST_F(ReadScan, NamesFileLineAndKey) {
  EXPECT_THAT(refusal_with("noise = 3e-4", "noise = 3"),
              AllOf(StartsWith("capture.toml:18"), HasSubstr("noise")));
  EXPECT_THAT(refusal_with("noise = 3e-4", "nois = 3e-4"),
              AllOf(StartsWith("capture.toml:18"), HasSubstr("nois")));
  EXPECT_THAT(refusal_with("grid = \"hang.obj\"", "grid = \"none.obj\""),
              AllOf(StartsWith("capture.toml:17"), HasSubstr("no such file")));
  EXPECT_THAT(refusal_with("[0.1, 0]]", "[0.2, 0]]"), HasSubstr("reaches off the swatch"));
  EXPECT_THAT(refusal_with("[[0, 0], [0.1, 0]]", "[[0.1, 0], [0, 0]]"), HasSubstr("first corner"));
  EXPECT_THAT(refusal_with("kind = \"bar\"", "kind = \"pin\""), HasSubstr("pin"));
  EXPECT_THAT(refusal_with("vertices = [19]", "vertices = [20]"), HasSubstr("vertices"));
  EXPECT_THAT(refusal_with("vertices = [19]", "vertices = [13, 19]"), HasSubstr("vertex 14"));
  EXPECT_THAT(refusal_with("weight = 0.02", "weight = 0.02\nforce = 1"), HasSubstr("not both"));
  EXPECT_THAT(refusal_with("weight = 0.02\n", ""), HasSubstr("belongs to a `force`"));
  EXPECT_THAT(refusal_with("vertices = [19]\n", ""), HasSubstr("one of `region` and `vertices`"));
  EXPECT_THAT(refusal_with("name = \"corner\"", "name = \"top\""), HasSubstr("two clamps"));
  EXPECT_THAT(refusal_with("width = 0.1", "width = 0.05"), HasSubstr("swatch"));
  EXPECT_THAT(refusal_with("kind = \"scan\"", "kind = \"video\""), HasSubstr("scan"));
}

TEST_F(ReadScan, ARawScanHasNoShapeYet) {
  replace("capture.toml", "vertices = [19]", "region = [[0.1, 0.08], [0.1, 0.08]]");
  replace("capture.toml", "grid = \"hang.obj\"", "scan = \"hang.obj\"");
  EXPECT_NO_THROW(read_scan_capture(folder_));
  EXPECT_THAT(refusal(), HasSubstr("raw scan without a registered grid"));
}

TEST_F(ReadScan, WritesAndReadsARawScan) {
  ScanCapture capture = read_scan_capture(folder_);
  capture.truth = "truth/fabric.toml";
  ScanTarget& target = capture.targets.front();
  target.v_axis = Vec3(0, 1, 0);
  RawScan raw;
  raw.scan.position = Points::Random(3, 20);
  raw.landmarks = {{Vec2(0.1, 0.08), Vec3(1, -2, 0.3), 0.5}, {Vec2(0, 0), Vec3(0, 0, 1e-6), 1}};
  write_scan_capture(folder_ / "copy", capture, {ScanShape{}}, {raw});
  const ScanCapture copy = read_scan_capture(folder_ / "copy");
  const ScanTarget& read = copy.targets.front();
  EXPECT_TRUE(read.grid.empty());
  EXPECT_EQ(read.v_axis, target.v_axis);
  EXPECT_EQ(read.clamps.size(), target.clamps.size());
  EXPECT_EQ(copy.truth->filename(), "fabric.toml");
  EXPECT_NEAR((read_scan(read.scan).position - raw.scan.position).norm(), 0, 1e-8);
  const GridTemplate swatch = make_grid_template(capture.width, capture.height, 3, 3);
  const std::vector<Landmark> landmarks = read_landmarks(read.landmarks, swatch);
  ASSERT_EQ(landmarks.size(), 2u);
  EXPECT_EQ(landmarks[0].uv, raw.landmarks[0].uv);
  EXPECT_EQ(landmarks[0].position, raw.landmarks[0].position);
  EXPECT_EQ(landmarks[0].weight, 0.5);
}

TEST_F(ReadScan, KeysOfARawScan) {
  EXPECT_THAT(refusal_with("noise = 3e-4", "noise = 3e-4\nunit = 0.001"),
              HasSubstr("unit: of a raw `scan`; this target has a registered `grid`"));
  replace("capture.toml", "vertices = [19]", "region = [[0.1, 0.08], [0.1, 0.08]]");
  replace("capture.toml", "grid = \"hang.obj\"",
          "scan = \"hang.obj\"\nunit = 0.001\nu_axis = [0, 2, 0]");
  const ScanTarget target = read_scan_capture(folder_).targets.front();
  EXPECT_EQ(target.unit, 0.001);
  EXPECT_EQ(target.u_axis, Vec3::UnitY());
  EXPECT_THAT(refusal_with("[0, 2, 0]", "[0, 0, 0]"), HasSubstr("u_axis: no direction"));
  EXPECT_THAT(refusal_with("[0, 2, 0]", "[0, 0, 3]"), HasSubstr("u_axis is along v_axis"));
}

TEST_F(ReadScan, WritesWhatItReads) {
  ScanCapture capture = read_scan_capture(folder_);
  ScanShape shape = read_scan_shape(capture, capture.targets.front());
  shape.weights[3] = 0.25;
  shape.start = 1.5 * shape.x;
  write_scan_capture(folder_ / "copy", capture, {shape});
  const ScanCapture copy = read_scan_capture(folder_ / "copy");
  EXPECT_EQ(copy.areal_density, capture.areal_density);
  EXPECT_EQ(copy.grain_angle, capture.grain_angle);
  const ScanTarget &a = copy.targets.front(), &b = capture.targets.front();
  EXPECT_EQ(a.gravity, b.gravity);
  EXPECT_EQ(a.noise, b.noise);
  EXPECT_EQ(a.clamps[0].kind, b.clamps[0].kind);
  EXPECT_EQ(a.clamps[1].force, b.clamps[1].force);
  EXPECT_TRUE(a.clamps[1].region == b.clamps[1].region);
  const ScanShape read = read_scan_shape(copy, a);
  EXPECT_EQ(read.weights, shape.weights);
  EXPECT_NEAR((read.x - shape.x).norm(), 0, 1e-9);
  EXPECT_NEAR((*read.start - *shape.start).norm(), 0, 1e-9);
}

}  // namespace
}  // namespace weft::scan_capture_test
