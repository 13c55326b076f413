#include "weft/mesh/mesh_io.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "weft/base/error.h"
#include "weft/base/number_text.h"

namespace weft {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY and PC2 are written as in memory");

std::ifstream open_to_read(const std::filesystem::path& path) {
  std::error_code status;
  if (!std::filesystem::exists(path, status)) throw error_at({path, 0, {}}, "no such file");
  std::ifstream stream(path, std::ios::binary);
  if (!stream || std::filesystem::is_directory(path, status)) {
    throw error_at({path, 0, {}}, "cannot be read");
  }
  return stream;
}

std::ofstream open_to_write(const std::filesystem::path& path) {
  std::ofstream stream(path, std::ios::binary);
  if (!stream) throw error_at({path, 0, {}}, "cannot be written");
  return stream;
}

void close_written(std::ofstream& stream, const std::filesystem::path& path) {
  stream.close();
  if (!stream) throw error_at({path, 0, {}}, "cannot be written (is the disk full?)");
}

std::string_view next_word(std::string_view& line) {
  const std::size_t start = line.find_first_not_of(" \t\r");
  if (start == std::string_view::npos) return line = {};
  line.remove_prefix(start);
  const std::size_t end = std::min(line.find_first_of(" \t\r"), line.size());
  const std::string_view word = line.substr(0, end);
  line.remove_prefix(end);
  return word;
}

/// Reads an OBJ line by line.
class ObjReader {
 public:
  explicit ObjReader(const std::filesystem::path& path) : path_(path) {}

  ObjMesh read() {
    std::ifstream stream = open_to_read(path_);
    std::string text;
    while (std::getline(stream, text)) {
      ++line_;
      std::string_view rest = text;
      const std::string_view keyword = next_word(rest);
      if (keyword == "v") vertices_.push_back(read_vector<3>(rest));
      if (keyword == "vt") textures_.push_back(read_vector<2>(rest));
      if (keyword == "f") read_face(rest);
    }
    if (vertices_.empty()) throw error_at({path_, 0, {}}, "no vertices");
    return finish();
  }

 private:
  Error fail(std::string_view reason) const { return error_at({path_, line_, {}}, reason); }

  template <int N>
  Eigen::Matrix<double, N, 1> read_vector(std::string_view rest) const {
    Eigen::Matrix<double, N, 1> value;
    for (int i = 0; i < N; ++i) {
      const std::string_view word = next_word(rest);
      if (word.empty()) throw fail(fmt::format("expected {} numbers, found {}", N, i));
      const auto number = number_of<double>(word);
      if (!number || !std::isfinite(*number))
        throw fail(fmt::format("\"{}\" is not a finite number", word));
      value[i] = *number;
    }
    return value;
  }

  /// A 1-based index, or a negative one that counts from the last; to 0-based.
  int read_index(std::string_view word, std::size_t count, std::string_view what) const {
    const auto index = number_of<int>(word);
    if (!index) throw fail(fmt::format("\"{}\" is not an index", word));
    const int zero_based = *index < 0 ? static_cast<int>(count) + *index : *index - 1;
    if (zero_based < 0 || zero_based >= static_cast<int>(count)) {
      throw fail(fmt::format("{} {} does not exist; {} were read so far", what, *index, count));
    }
    return zero_based;
  }

  void read_face(std::string_view rest) {
    std::vector<int> corners;
    for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) {
      const std::size_t slash = word.find('/');
      corners.push_back(read_index(word.substr(0, slash), vertices_.size(), "vertex"));
      if (slash == std::string_view::npos) continue;
      std::string_view texture = word.substr(slash + 1);
      texture = texture.substr(0, texture.find('/'));
      if (!texture.empty()) {
        assign_texture(corners.back(), read_index(texture, textures_.size(), "texture vertex"));
      }
    }
    if (corners.size() < 3) throw fail("a face needs at least 3 vertices");
    for (std::size_t i = 2; i < corners.size(); ++i) {
      triangles_.push_back({corners[0], corners[i - 1], corners[i]});
    }
  }

  void assign_texture(int vertex, int texture) {
    texture_of_vertex_.resize(vertices_.size(), -1);
    int& assigned = texture_of_vertex_[static_cast<std::size_t>(vertex)];
    if (assigned >= 0 && textures_[static_cast<std::size_t>(assigned)] !=
                             textures_[static_cast<std::size_t>(texture)]) {
      seam_ = true;
    }
    assigned = texture;
  }

  ObjMesh finish() {
    ObjMesh mesh;
    mesh.triangles = std::move(triangles_);
    const auto count = static_cast<Eigen::Index>(vertices_.size());
    mesh.positions.resize(3, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      mesh.positions.col(i) = vertices_[static_cast<std::size_t>(i)];
    }
    texture_of_vertex_.resize(vertices_.size(), -1);
    MaterialPoints texture(2, count);
    for (Eigen::Index i = 0; i < count; ++i) {
      const int index = texture_of_vertex_[static_cast<std::size_t>(i)];
      if (index < 0 || seam_) return mesh;
      texture.col(i) = textures_[static_cast<std::size_t>(index)];
    }
    mesh.texture = std::move(texture);
    return mesh;
  }

  std::filesystem::path path_;
  int line_ = 0;
  std::vector<Vec3> vertices_;
  std::vector<Vec2> textures_;
  std::vector<std::array<int, 3>> triangles_;
  std::vector<int> texture_of_vertex_;
  bool seam_ = false;  ///< a vertex has two different (u, v)
};

template <typename Value>
void append(std::string& buffer, Value value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  buffer.append(bytes, sizeof value);
}

template <typename Value>
Value extract(const char* bytes) {
  Value value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

constexpr std::size_t kPc2HeaderSize = 32;
constexpr char kPc2Signature[12] = "POINTCACHE2";

}  // namespace

ObjMesh read_obj(const std::filesystem::path& path) { return ObjReader(path).read(); }

MaterialSurface read_material_surface(const std::filesystem::path& path) {
  ObjMesh obj = read_obj(path);
  if (!obj.texture) {
    throw error_at({path, 0, "vt"}, "each vertex needs one vt: its (u, v) in m");
  }
  TriangleMesh mesh{std::move(*obj.texture), std::move(obj.triangles)};
  // Programs that write OBJ with v upwards wind their faces the other way round.
  for (int t = 0; t < mesh.triangle_count(); ++t) {
    auto& triangle = mesh.triangles[static_cast<std::size_t>(t)];
    if (material_area(mesh, t) < 0) std::swap(triangle[1], triangle[2]);
  }
  validate(mesh, path.string());
  return {std::move(mesh), std::move(obj.positions)};
}

void write_obj(const std::filesystem::path& path, const TriangleMesh& mesh, const Points& x,
               const std::string& comment) {
  std::string text;
  if (!comment.empty()) text += "# " + comment + "\n";
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    text += fmt::format("v {} {} {}\n", x(0, i), x(1, i), x(2, i));
  }
  for (Eigen::Index i = 0; i < mesh.material.cols(); ++i) {
    text += fmt::format("vt {} {}\n", mesh.material(0, i), mesh.material(1, i));
  }
  for (const auto& [a, b, c] : mesh.triangles) {
    text += fmt::format("f {0}/{0} {1}/{1} {2}/{2}\n", a + 1, b + 1, c + 1);
  }
  std::ofstream stream = open_to_write(path);
  stream << text;
  close_written(stream, path);
}

void write_ply(const std::filesystem::path& path, const TriangleMesh& mesh, const Points& x) {
  std::string data = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      mesh.vertex_count(), mesh.triangle_count());
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    for (int axis = 0; axis < 3; ++axis) append(data, static_cast<float>(x(axis, i)));
    for (int axis = 0; axis < 2; ++axis) append(data, static_cast<float>(mesh.material(axis, i)));
  }
  for (const auto& triangle : mesh.triangles) {
    append(data, std::uint8_t{3});
    for (const int vertex : triangle) append(data, std::int32_t{vertex});
  }
  std::ofstream stream = open_to_write(path);
  stream.write(data.data(), static_cast<std::streamsize>(data.size()));
  close_written(stream, path);
}

PointCache read_pc2(const std::filesystem::path& path) {
  std::ifstream stream = open_to_read(path);
  const auto fail = [&](const std::string& reason) { return error_at({path, 0, {}}, reason); };
  std::error_code failure;
  const std::uint64_t file_size = std::filesystem::file_size(path, failure);
  if (failure) throw fail(fmt::format("cannot be read: {}", failure.message()));
  char header[kPc2HeaderSize];
  if (!stream.read(header, sizeof header) || std::memcmp(header, kPc2Signature, 12) != 0) {
    throw fail("not a PC2 file (no POINTCACHE2 header)");
  }
  const auto version = extract<std::int32_t>(header + 12);
  const auto points = extract<std::int32_t>(header + 16);
  const auto samples = extract<std::int32_t>(header + 28);
  if (version != 1) throw fail(fmt::format("PC2 version {}; must be 1", version));
  if (points < 1 || samples < 1) {
    throw fail(fmt::format("{} points in {} samples; both must be above 0", points, samples));
  }
  const std::uint64_t frame_size = 12 * static_cast<std::uint64_t>(points);
  const std::uint64_t expected = kPc2HeaderSize + frame_size * static_cast<std::uint64_t>(samples);
  if (file_size != expected) {
    throw fail(fmt::format("{} points in {} samples take {} bytes, the file has {}", points,
                           samples, expected, file_size));
  }
  PointCache cache;
  cache.start_frame = static_cast<double>(extract<float>(header + 20));
  cache.sample_rate = static_cast<double>(extract<float>(header + 24));
  Eigen::Matrix3Xf frame(3, points);
  for (int i = 0; i < samples; ++i) {
    stream.read(reinterpret_cast<char*>(frame.data()), static_cast<std::streamsize>(frame_size));
    if (!stream) throw fail("cannot be read to its end");
    if (!frame.allFinite()) {
      throw fail(fmt::format("sample {} holds a position that is not finite", i));
    }
    cache.frames.emplace_back(frame.cast<double>());
  }
  return cache;
}

void write_pc2(const std::filesystem::path& path, const PointCache& cache) {
  if (cache.frames.empty()) throw error_at({path, 0, {}}, "no frames to write");
  const Eigen::Index points = cache.frames.front().cols();
  std::string header(kPc2Signature, sizeof kPc2Signature);
  append(header, std::int32_t{1});
  append(header, static_cast<std::int32_t>(points));
  append(header, static_cast<float>(cache.start_frame));
  append(header, static_cast<float>(cache.sample_rate));
  append(header, static_cast<std::int32_t>(cache.frames.size()));
  std::ofstream stream = open_to_write(path);
  stream.write(header.data(), static_cast<std::streamsize>(header.size()));
  for (const Points& positions : cache.frames) {
    if (positions.cols() != points) {
      throw error_at({path, 0, {}},
                     fmt::format("frames of {} and of {} points", points, positions.cols()));
    }
    const Eigen::Matrix3Xf frame = positions.cast<float>();
    stream.write(
        reinterpret_cast<const char*>(frame.data()),
        static_cast<std::streamsize>(static_cast<std::size_t>(frame.size()) * sizeof(float)));
  }
  close_written(stream, path);
}

}  // namespace weft
