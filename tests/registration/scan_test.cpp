#include "weft/registration/scan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>
#include <fstream>

#include "common/temporary_folder.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/mesh/mesh_io.h"
#include "weft/registration/point_tree.h"
#include "weft/vision/video.h"

namespace weft::scan_test {
namespace {

using ::testing::HasSubstr;

class ScanFile : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    const auto path = folder_.path() / name;
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
  static std::string refusal(const std::filesystem::path& path) {
    try {
      read_scans(path);
    } catch (const Error& error) {
      return error.what();
    }
    return "read";
  }
  test::TemporaryFolder folder_;
};

template <class Value>
void append(std::string& bytes, Value value, bool big = false) {
  char raw[sizeof value];
  std::memcpy(raw, &value, sizeof value);
  if (big) std::reverse(raw, raw + sizeof value);
  bytes.append(raw, sizeof value);
}

TEST_F(ScanFile, ReadsAnAsciiPlyWithColoursAndFaces) {
  const Scan scan = read_scan(
      write(
          "a.ply",
          "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement vertex 4\r\nproperty float x\r\n"
          "property float y\r\nproperty float z\r\nproperty uchar red\r\nproperty uchar green\r\n"
          "property uchar blue\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\n"
          "end_header\r\n0 0 0 255 0 0\r\n10 0 0 0 255 0\r\n10 10 0 0 0 255\r\n0 10 0 51 51 51\r\n"
          "4 0 1 2 3\r\n"),
      1e-2);
  ASSERT_EQ(scan.size(), 4);
  EXPECT_EQ(scan.position.col(2), Vec3(0.1, 0.1, 0));
  EXPECT_FLOAT_EQ(scan.colour(1, 1), 1);
  EXPECT_FLOAT_EQ(scan.colour(0, 3), 0.2f);
  EXPECT_EQ(scan.triangles, (std::vector<std::array<int, 3>>{{0, 1, 2}, {0, 2, 3}}));
}

TEST_F(ScanFile, ReadsBinaryPlyOfBothByteOrders) {
  for (const bool big : {false, true}) {
    std::string text = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                       "_endian 1.0\nelement vertex 2\nproperty double x\nproperty float y\n"
                       "property float z\nproperty short other\nend_header\n";
    for (int k = 0; k < 2; ++k) {
      append(text, 1.5 + k, big);
      append(text, 2.5f, big);
      append(text, -3.5f, big);
      append(text, std::int16_t{7}, big);
    }
    const Scan scan = read_scan(write("b.ply", text));
    ASSERT_EQ(scan.size(), 2);
    EXPECT_EQ(scan.position.col(1), Vec3(2.5, 2.5, -3.5));
    EXPECT_THAT(refusal(write("c.ply", text.substr(0, text.size() - 1))), HasSubstr("cut short"));
  }
}

TEST_F(ScanFile, ReadsWhatThisProgramWrites) {
  const TriangleMesh mesh = make_swatch(0.2, 0.1, 4, 3);
  Points x = Points::Zero(3, 12);
  x.topRows<2>() = mesh.material;
  write_ply(folder_.path() / "m.ply", mesh, x);
  write_obj(folder_.path() / "m.obj", mesh, x);
  for (const char* name : {"m.ply", "m.obj"}) {
    const Scan scan = read_scan(folder_.path() / name);
    EXPECT_EQ(scan.triangles, mesh.triangles);
    EXPECT_LT((scan.position - x).norm(), 1e-7);
  }
}

TEST_F(ScanFile, ReadsTheTextureOfAnObj) {
  // Two pixels, left black, right white.
  Image picture(1, 2);
  picture << 0, 1;
  write_png(folder_.path() / "skin.png", picture);
  write("a.mtl", "newmtl skin\nmap_Kd skin.png\n");
  const auto path = write("a.obj",
                          "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.25 0.5\n"
                          "vt 0.75 0.5\nf 1/1 2/2 3/2 4/1\n");
  const Scan scan = read_scan(path);
  ASSERT_TRUE(scan.texture);
  const Scan sampled = sample_scan(scan, 0.1);
  ASSERT_EQ(sampled.colour.cols(), sampled.size());
  // From the middle of one pixel to that of the other the grey rises as x does.
  for (int k = 0; k < sampled.size(); ++k) {
    EXPECT_NEAR(sampled.colour(1, k), sampled.position(0, k), 1e-5);
  }
  write("a.mtl", "map_Kd skin.png\nmap_Kd other.png\n");
  EXPECT_THAT(refusal(path), HasSubstr("a.mtl:2"));
  const Scan painted = read_scan(write("b.obj", "v 0 0 0 255 0 51\nv 1 0 0 0 255 0\n"));
  EXPECT_FLOAT_EQ(painted.colour(2, 0), 0.2f);
}

TEST_F(ScanFile, ReadsPointLists) {
  EXPECT_EQ(read_scan(write("a.xyz", "# comment\n1 2 3\n\n4 5 6\n")).position.col(1),
            Vec3(4, 5, 6));
  const Scan coloured = read_scan(write("a.csv", "x,y,z,r,g,b\n1,2,3,0,0,255\n4,5,6,0,51,0\n"));
  EXPECT_FLOAT_EQ(coloured.colour(1, 1), 0.2f);
  EXPECT_EQ(read_scan(write("a.pts", "1\n1 2 3 -900 255 0 0\n")).colour(0, 0), 1);
  EXPECT_THAT(refusal(write("b.xyz", "1 2 3\n4 five 6\n")), HasSubstr("b.xyz:2: \"five\""));
  EXPECT_THAT(refusal(write("c.xyz", "1 2\n")), HasSubstr("c.xyz:1: 2 numbers"));
  EXPECT_THAT(refusal(write("d.xyz", "1 2 nan\n")), HasSubstr("not finite"));
  EXPECT_THAT(refusal(write("e.xyz", "\n")), HasSubstr("no points"));
  EXPECT_THAT(refusal(write("e.stl", "solid")), HasSubstr(".ply, .obj"));
  EXPECT_THAT(refusal(folder_.path() / "none.xyz"), HasSubstr("no such file"));
}

// An index in front would be read as x.
TEST_F(ScanFile, WithoutAHeaderOnlySomeCountsSayWhatTheNumbersAre) {
  EXPECT_EQ(read_scan(write("3.xyz", "1 2 3\n")).colour.cols(), 0);
  EXPECT_FLOAT_EQ(read_scan(write("6.xyz", "1 2 3 0 51 255\n")).colour(1, 0), 0.2f);
  EXPECT_FLOAT_EQ(read_scan(write("7.xyz", "1 2 3 9 0 51 255\n")).colour(1, 0), 0.2f);
  for (const std::string more : {"4", "4 5", "4 5 6 7 8", "4 5 6 7 8 9"}) {
    const std::string count = std::to_string(3 + (more.size() + 1) / 2);
    EXPECT_THAT(refusal(write("n.xyz", "# points\n1 2 3 " + more + "\n")),
                AllOf(HasSubstr("n.xyz:2: " + count + " numbers; without a header"),
                      HasSubstr("3, 6 with its colour, or 7")));
  }
  EXPECT_THAT(refusal(write("m.xyz", "1 2 3\n\n1 2 3 4 5 6\n")),
              HasSubstr("m.xyz:3: 6 numbers, 3 in the lines before"));
}

TEST_F(ScanFile, AHeaderSaysWhichColumnsAreThePoints) {
  const Scan scan = read_scan(
      write("a.csv", "id;z;Y;x;nx;blue;green;red\n7;3;2;1;0;51;0;255\n8;6;5;4;0;0;0;0\n"));
  EXPECT_EQ(scan.position.col(1), Vec3(4, 5, 6));
  ASSERT_EQ(scan.colour.cols(), 2);
  EXPECT_FLOAT_EQ(scan.colour(2, 0), 0.2f);
  // Normals are no colours.
  EXPECT_EQ(read_scan(write("n.xyz", "//X Y Z nx ny nz\n1 2 3 0 -1 0\n")).colour.cols(), 0);
  EXPECT_EQ(read_scan(write("t.txt", "Scan of Monday\n1 2 3\n")).size(), 1);
  EXPECT_EQ(read_scan(write("m.csv", "\xEF\xBB\xBFx,y,z\n1,2,3\n")).size(), 1);
  EXPECT_THAT(refusal(write("b.csv", "\nu,v,w\n1,2,3\n")),
              HasSubstr("b.csv:2: the header \"u,v,w\" has no columns x, y and z"));
  EXPECT_THAT(refusal(write("c.csv", "x,y,z,r\n1,2,3\n")),
              HasSubstr("c.csv:2: 3 numbers, 4 columns"));
}

/// A header of `vertices` vertices and a face, and the data of three and one.
std::string ply(const std::string& vertices, const std::string& version = "1.0",
                const std::string& type = "float") {
  return "ply\nformat ascii " + version + "\nelement vertex " + vertices + "\nproperty " + type +
         " x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int "
         "vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
}

TEST_F(ScanFile, SaysWhereAPlyIsWrong) {
  EXPECT_EQ(read_scan(write("a.ply", ply("3"))).size(), 3);
  EXPECT_THAT(refusal(write("b.ply", ply("3").replace(ply("3").find("1 0 0"), 1, "one"))),
              HasSubstr("b.ply:11: \"one\" is not a number"));
  EXPECT_THAT(refusal(write("c.ply", ply("three"))),
              HasSubstr("c.ply:3: \"element vertex three\""));
  EXPECT_THAT(refusal(write("d.ply", ply("4"))), HasSubstr("d.ply:13: cut short"));
  // One less: its numbers are read as a face without corners, and more is left.
  EXPECT_THAT(refusal(write("e.ply", ply("2"))),
              HasSubstr("e.ply:12: data after the elements that the header declares: 2 vertex, 1 "
                        "face"));
  EXPECT_THAT(refusal(write("f.ply", ply("3") + "5\n")), HasSubstr("f.ply:14: data after"));
  EXPECT_EQ(read_scan(write("g.ply", ply("3") + " \r\n\n")).size(), 3);
  EXPECT_THAT(refusal(write("h.ply", ply("3", "2.0"))), HasSubstr("h.ply:2: \"format ascii 2.0\""));
  EXPECT_THAT(refusal(write("i.ply", ply("3", "1.0", "real"))),
              HasSubstr("i.ply:4: type \"real\" is not understood"));
  std::string binary =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float "
      "y\nproperty float z\nend_header\n";
  for (int k = 0; k < 4; ++k) append(binary, 1.5f);
  EXPECT_THAT(refusal(write("j.ply", binary)), HasSubstr("j.ply: data after the elements"));
}

TEST_F(ScanFile, ReadsSequences) {
  std::string text;
  append(text, std::int32_t{2});
  for (const std::int16_t first : {std::int16_t{10}, std::int16_t{-20}}) {
    append(text, std::int32_t{1});
    for (std::int16_t k = 0; k < 3; ++k) append(text, static_cast<std::int16_t>(first + k));
  }
  const auto frames = read_scans(write("a.pcseq", text), 0.5);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[1].position.col(0), Vec3(-10, -9.5, -9));
  EXPECT_THAT(refusal(write("b.pcseq", text.substr(0, 12))), HasSubstr("cut short"));

  const auto table = read_scans(write("t.csv", "frame,x,y,z\n0,1,2,3\n1,4,5,6\n1,7,8,9\n"));
  ASSERT_EQ(table.size(), 2u);
  EXPECT_EQ(table[1].position.col(1), Vec3(7, 8, 9));
  EXPECT_THAT(refusal(write("u.csv", "frame,x,y,z\n0,1,2,3\n2,4,5,6\n")), HasSubstr("u.csv:3"));
  // A mark, blank lines and comments do not make one scan of all frames.
  for (const std::string header : {"\xEF\xBB\xBF"
                                   "frame,x,y,z\r\n",
                                   "\n# of Monday\nframe,x,y,z\n", "Frame;X;Y;Z\n"}) {
    const auto marked = read_scans(write("m.csv", header + "0,1,2,3\n1,4,5,6\n"));
    ASSERT_EQ(marked.size(), 2u) << header;
    EXPECT_EQ(marked[1].position.col(0), Vec3(4, 5, 6));
  }
  EXPECT_THAT(refusal(write("w.csv", "\nframe,x,y\n0,1,2\n")),
              HasSubstr("w.csv:2: z: a sequence needs the columns"));

  write("s/1.xyz", "1 2 3\n");
  write("s/0.xyz", "4 5 6\n");
  EXPECT_EQ(read_scans(folder_.path() / "s").front().position.col(0), Vec3(4, 5, 6));
  write("s/2.obj", "v 0 0 0\n");
  EXPECT_THAT(refusal(folder_.path() / "s"), HasSubstr("one ending"));
}

TEST(SampleScan, FillsLargeTriangles) {
  Scan scan;
  scan.position.resize(3, 3);
  scan.position << 0, 0.1, 0, 0, 0, 0.1, 0, 0, 0;
  scan.triangles = {{0, 1, 2}};
  const Scan sampled = sample_scan(scan, 0.01);
  const PointTree tree(sampled.position);
  Rng rng(3);
  for (int k = 0; k < 200; ++k) {
    const double u = rng.uniform(0, 0.1), v = rng.uniform(0, 0.1 - u);
    EXPECT_LT(tree.nearest(Vec3(u, v, 0)).squared, 0.01 * 0.01);
  }
}

TEST(SampleScan, RefusesMoreThanThereIsMemoryFor) {
  Scan scan;
  scan.position.resize(3, 3);
  scan.position << 0, 300, 0, 0, 0, 300, 0, 0, 0;
  scan.triangles = {{0, 1, 2}};
  EXPECT_GT(sample_scan(scan, 1).size(), 45000);
  try {
    sample_scan(scan, 1e-6);
    FAIL() << "sampled";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("1e-06 m apart; valid: up to 2e+07"));
  }
}

TEST(PointTree, FindsWhatASearchThroughAllFinds) {
  Rng rng(5);
  Points points(3, 700);
  for (Eigen::Index k = 0; k < points.size(); ++k) points.data()[k] = rng.uniform();
  points.col(17) = points.col(400);
  const PointTree tree(points);
  std::vector<PointTree::Neighbour> found;
  for (int trial = 0; trial < 50; ++trial) {
    const Vec3 query(rng.uniform(), rng.uniform(), rng.uniform());
    std::vector<double> all(700);
    for (int k = 0; k < 700; ++k) {
      all[static_cast<std::size_t>(k)] = (points.col(k) - query).squaredNorm();
    }
    const auto inside = std::count_if(all.begin(), all.end(), [](double d) { return d < 0.04; });
    tree.within(query, 0.2, found);
    EXPECT_EQ(static_cast<long>(found.size()), inside);
    tree.nearest(query, 9, found);
    std::sort(all.begin(), all.end());
    ASSERT_EQ(found.size(), 9u);
    for (std::size_t k = 0; k < 9; ++k) EXPECT_EQ(found[k].squared, all[k]);
    EXPECT_EQ(tree.nearest(query).squared, all[0]);
  }
  EXPECT_EQ(tree.nearest(Vec3(9, 9, 9), 1.0).index, -1);
}

TEST(ScanGeometry, FindsPlanesAndStrays) {
  Rng rng(9);
  Scan scan;
  scan.position.resize(3, 2010);
  const Vec3 normal = Vec3(1, 2, 2) / 3;
  const Vec3 a = normal.unitOrthogonal(), b = normal.cross(a);
  for (int k = 0; k < 2000; ++k) scan.position.col(k) = rng.uniform() * a + rng.uniform() * b;
  for (int k = 2000; k < 2010; ++k) {
    scan.position.col(k) = Vec3(rng.uniform(), rng.uniform(), 3 + rng.uniform());
  }
  const ScanGeometry geometry = scan_geometry(scan);
  for (int k = 0; k < 2000; ++k) {
    EXPECT_GT(std::abs(geometry.normal.col(k).dot(normal)), 0.999999);
    EXPECT_TRUE(geometry.on_surface[static_cast<std::size_t>(k)]);
  }
  for (std::size_t k = 2000; k < 2010; ++k) EXPECT_FALSE(geometry.on_surface[k]);
  // A disc of this radius holds one of 2000 points on the unit square.
  EXPECT_NEAR(geometry.spacing.head(2000).mean(), 0.0126, 0.002);
}

}  // namespace
}  // namespace weft::scan_test
