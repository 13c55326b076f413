#include <gmock/gmock.h>

#include "capture/temporary_capture.h"
#include "weft/mesh/mesh_io.h"

namespace weft::start_surface_test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

/// The bundled capture, whose corners are held at (-0.1875, 0, 1) and (0.1875, 0, 1).
class StartSurface : public TemporaryCapture {
 protected:
  /// A plane through the corners, hanging: x = 0.75 (u - 0.25), z = 1 - v.
  static Points hanging(const MaterialPoints& uv) {
    Points x = Points::Zero(3, uv.cols());
    x.row(0) = 0.75 * (uv.row(0).array() - 0.25);
    x.row(2) = 1 - uv.row(1).array();
    return x;
  }
  Capture with_surface(const TriangleMesh& mesh, const Points& x) const {
    write_obj(folder_ / "start.obj", mesh, x);
    if (text_of(folder_ / "capture.toml").find("start_surface") == std::string::npos)
      replace("capture.toml", "[video]\n", "[video]\nstart_surface = \"start.obj\"\n");
    return read_capture(folder_);
  }
};

TEST_F(StartSurface, IsReadAtTheVerticesOfAnyGrid) {
  const TriangleMesh scanned = make_swatch(0.5, 0.5, 7, 9), ours = make_swatch(0.5, 0.5, 12, 5);
  const Capture capture = with_surface(scanned, hanging(scanned.material));
  const Points start = read_start_surface(capture, ours);
  // The file has 9 digits or more.
  EXPECT_LT((start - hanging(ours.material)).cwiseAbs().maxCoeff(), 1e-7);
}

TEST_F(StartSurface, RejectsAFileThatIsMissing) {
  EXPECT_THAT(message_with("[video]", "[video]\nstart_surface = \"none.obj\""),
              HasSubstr("video.start_surface: no such file"));
}

TEST_F(StartSurface, RejectsAPartOfTheSwatch) {
  const TriangleMesh part = make_swatch(0.5, 0.45, 7, 9);
  const Capture capture = with_surface(part, hanging(part.material));
  EXPECT_THAT(message_of([&] { read_start_surface(capture, part); }),
              StartsWith("start.obj: vt: (u, v) from (0, 0) to (0.5, 0.45); the swatch is"));
}

TEST_F(StartSurface, RejectsMillimetresAndOtherAxes) {
  const TriangleMesh mesh = make_swatch(0.5, 0.5, 7, 9);
  const Points x = hanging(mesh.material);
  const Capture large = with_surface(mesh, 1000 * x);
  EXPECT_THAT(message_of([&] { read_start_surface(large, mesh); }),
              HasSubstr("from the fixture \"left corner\" at frame 0; valid: up to 0.05 m"));
  const Capture moved = with_surface(mesh, x.colwise() + Vec3(0, 0.06, 0));
  EXPECT_THROW(read_start_surface(moved, mesh), Error);
  const Capture near = with_surface(mesh, x.colwise() + Vec3(0, 0.04, 0));
  EXPECT_NO_THROW(read_start_surface(near, mesh));
}

TEST_F(StartSurface, RejectsASurfaceWithoutMaterialPoints) {
  const TriangleMesh mesh = make_swatch(0.5, 0.5, 3, 3);
  const Capture capture = with_surface(mesh, hanging(mesh.material));
  write("start.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_THAT(message_of([&] { read_start_surface(capture, mesh); }),
              HasSubstr("each vertex needs one vt"));
}

}  // namespace
}  // namespace weft::start_surface_test
