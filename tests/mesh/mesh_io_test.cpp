#include "weft/mesh/mesh_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>

#include "common/temporary_folder.h"
#include "weft/base/error.h"

namespace weft::mesh_io_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// A folder of its own for each test, removed afterwards.
class MeshIo : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  static std::string read(const std::filesystem::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }
  template <typename Function>
  static std::string message(Function function) {
    try {
      function();
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }
  std::string obj_message(const std::string& text) const {
    const auto path = write("bad.obj", text);
    return message([&] { read_obj(path); });
  }

  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

TEST_F(MeshIo, ReadsAnObjAsOtherProgramsWriteIt) {
  // Comments, groups, materials, normals, CRLF, a quad, negative indices, extra coordinates.
  const ObjMesh mesh = read_obj(
      write("m.obj",
            "# made elsewhere\r\nmtllib x.mtl\r\no grid\r\nv 0 0 0\r\nv 1 0 0 1.0\r\nv 1 1e0 0\r\n"
            "v 0 1 0.5\r\nvt 0 0\r\nvt 1 0 0\r\nvt 1 1\r\nvt 0 1\r\nvn 0 0 1\r\ns off\r\n"
            "f 1/1/1 2/2/1 3/3/1 4/4/1\r\nf -4/-4/1 -3/-3/1 -2/-2/1\r\n"));
  ASSERT_EQ(mesh.positions.cols(), 4);
  EXPECT_EQ(mesh.positions.col(3), Vec3(0, 1, 0.5));
  ASSERT_EQ(mesh.triangles.size(), 3u);
  EXPECT_EQ(mesh.triangles[0], (std::array<int, 3>{0, 1, 2}));
  EXPECT_EQ(mesh.triangles[1], (std::array<int, 3>{0, 2, 3}));
  EXPECT_EQ(mesh.triangles[2], (std::array<int, 3>{0, 1, 2}));
  ASSERT_TRUE(mesh.texture.has_value());
  EXPECT_EQ(mesh.texture->col(2), Vec2(1, 1));
}

TEST_F(MeshIo, TextureIsAbsentWithoutOneForEachVertex) {
  EXPECT_FALSE(read_obj(write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")).texture);
  EXPECT_FALSE(
      read_obj(write("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2//1 3/1\n")).texture);
  // A seam: one vertex with two (u, v).
  EXPECT_FALSE(read_obj(write("c.obj",
                              "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
                              "vt 1 1\nvt 5 5\nf 1/1 2/2 3/3\nf 2/5 4/4 3/3\n"))
                   .texture);
}

TEST_F(MeshIo, BadObjFilesAreNamedWithTheirLine) {
  EXPECT_THAT(obj_message("v 0 0 0\nv 1 zero 0\n"),
              AllOf(HasSubstr("bad.obj:2: "), HasSubstr("\"zero\" is not a finite number")));
  EXPECT_THAT(obj_message("v 0 nan 0\n"), HasSubstr("not a finite number"));
  EXPECT_THAT(obj_message("v 0 0\n"), HasSubstr("expected 3 numbers, found 2"));
  EXPECT_THAT(obj_message("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"),
              AllOf(HasSubstr("bad.obj:4: "), HasSubstr("vertex 4 does not exist")));
  EXPECT_THAT(obj_message("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"), HasSubstr("vertex 0"));
  EXPECT_THAT(obj_message("v 0 0 0\nv 1 0 0\nf 1 2\n"), HasSubstr("at least 3 vertices"));
  EXPECT_THAT(obj_message("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n"),
              HasSubstr("texture vertex 1 does not exist"));
  EXPECT_THAT(obj_message("v 0 0 0\nv 1 0 0\nv 0 1 0\nf a b c\n"), HasSubstr("not an index"));
  EXPECT_THAT(obj_message("# nothing\n"), HasSubstr("no vertices"));
  EXPECT_THAT(message([&] { read_obj(folder_ / "absent.obj"); }), HasSubstr("no such file"));
  EXPECT_THAT(message([&] { read_obj(folder_); }), HasSubstr("cannot be read"));
}

TEST_F(MeshIo, ObjComesBackAsItWasWritten) {
  const TriangleMesh mesh = make_swatch(0.5, 0.3, 4, 3);
  const Points x = Points::Random(3, mesh.vertex_count());
  write_obj(folder_ / "m.obj", mesh, x, "a comment");
  const ObjMesh back = read_obj(folder_ / "m.obj");
  EXPECT_EQ(back.triangles, mesh.triangles);
  EXPECT_EQ(back.positions, x);
  ASSERT_TRUE(back.texture.has_value());
  EXPECT_EQ(*back.texture, mesh.material);
  EXPECT_THAT(read(folder_ / "m.obj"), ::testing::StartsWith("# a comment\nv "));
}

TEST_F(MeshIo, PlyHasTheHeaderAndTheBytesOfItsFormat) {
  const TriangleMesh mesh = make_swatch(0.5, 0.25, 2, 2);
  Points x = Points::Zero(3, 4);
  x.col(3) = Vec3(1, 2, 3);
  write_ply(folder_ / "m.ply", mesh, x);
  const std::string data = read(folder_ / "m.ply");
  const std::size_t body = data.find("end_header\n") + 11;
  EXPECT_THAT(data.substr(0, body),
              AllOf(HasSubstr("ply\nformat binary_little_endian 1.0\n"),
                    HasSubstr("element vertex 4\n"), HasSubstr("element face 2\n")));
  ASSERT_EQ(data.size() - body, 4u * 5 * 4 + 2u * (1 + 3 * 4));
  float last_vertex[5];
  std::memcpy(last_vertex, data.data() + body + 3 * 20, sizeof last_vertex);
  EXPECT_THAT(last_vertex, ::testing::ElementsAre(1.f, 2.f, 3.f, 0.5f, 0.25f));
  EXPECT_EQ(data[body + 80], 3);
}

TEST_F(MeshIo, Pc2ComesBackAsItWasWritten) {
  PointCache cache{.start_frame = 5, .sample_rate = 0.5, .frames = {}};
  for (int i = 0; i < 3; ++i) cache.frames.push_back(Points::Random(3, 7));
  write_pc2(folder_ / "m.pc2", cache);
  EXPECT_EQ(std::filesystem::file_size(folder_ / "m.pc2"), 32u + 3 * 7 * 12);
  const PointCache back = read_pc2(folder_ / "m.pc2");
  EXPECT_EQ(back.start_frame, 5);
  EXPECT_EQ(back.sample_rate, 0.5);
  ASSERT_EQ(back.frames.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(back.frames[i], cache.frames[i].cast<float>().cast<double>());
  }
}

// Written by Blender 3.4.
TEST_F(MeshIo, ReadsPc2AndObjOfAnotherProgram) {
  const std::filesystem::path truth =
      std::filesystem::path(WEFT_SOURCE_DIR) / "data/captures/cotton_waving_A/truth";
  const PointCache cache = read_pc2(truth / "points.pc2");
  ASSERT_EQ(cache.frames.size(), 100u);
  ASSERT_EQ(cache.frames[0].cols(), 41 * 41);
  // The held corner, from the capture's corners.csv.
  EXPECT_NEAR((cache.frames[0].col(0) - Vec3(-0.1875, 0, 1)).norm(), 0, 1e-4);
  const ObjMesh rest = read_obj(truth / "rest.obj");
  ASSERT_TRUE(rest.texture.has_value());
  EXPECT_EQ(rest.positions.cols(), 41 * 41);
  EXPECT_EQ(rest.triangles.size(), 2u * 40 * 40);
  EXPECT_NEAR((rest.texture->col(41 * 41 - 1) - Vec2(0.5, 0.5)).norm(), 0, 1e-6);
}

TEST_F(MeshIo, BadPc2FilesAreRejected) {
  write_pc2(folder_ / "good.pc2", {.frames = {Points::Random(3, 7), Points::Random(3, 7)}});
  const std::string good = read(folder_ / "good.pc2");
  const auto says = [&](const std::string& data) {
    const auto path = write("bad.pc2", data);
    return message([&] { read_pc2(path); });
  };
  EXPECT_THAT(says("POINTCACHE"), HasSubstr("bad.pc2: not a PC2 file"));
  EXPECT_THAT(says("X" + good.substr(1)), HasSubstr("not a PC2 file"));
  EXPECT_THAT(says(good.substr(0, good.size() - 1)), HasSubstr("the file has 199"));
  EXPECT_THAT(says(good + "x"), HasSubstr("take 200 bytes, the file has 201"));
  std::string changed = good;
  changed[12] = 2;
  EXPECT_THAT(says(changed), HasSubstr("version 2"));
  changed = good;
  changed[16] = 0;
  EXPECT_THAT(says(changed), HasSubstr("0 points"));
  changed = good;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(changed.data() + 32 + 84, &nan, sizeof nan);
  EXPECT_THAT(says(changed), HasSubstr("sample 1 holds a position that is not finite"));
  EXPECT_THAT(message([&] { read_pc2(folder_ / "absent.pc2"); }), HasSubstr("no such file"));
}

TEST_F(MeshIo, UnwritablePathsAreRejected) {
  const TriangleMesh mesh = make_swatch(1, 1, 2, 2);
  const Points x = Points::Zero(3, 4);
  const std::filesystem::path nowhere = folder_ / "absent" / "m";
  EXPECT_THAT(message([&] { write_obj(nowhere, mesh, x); }), HasSubstr("cannot be written"));
  EXPECT_THAT(message([&] { write_ply(nowhere, mesh, x); }), HasSubstr("cannot be written"));
  EXPECT_THAT(message([&] { write_pc2(nowhere, {.frames = {x}}); }),
              HasSubstr("cannot be written"));
  EXPECT_THROW(write_pc2(folder_ / "m.pc2", {}), Error);
  EXPECT_THROW(write_pc2(folder_ / "m.pc2", {.frames = {x, Points::Zero(3, 5)}}), Error);
}

}  // namespace
}  // namespace weft::mesh_io_test
