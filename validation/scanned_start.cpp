/// Copies of video captures with truth whose first frame was scanned, too (start_surface in
/// docs/formats.md):
///
///     weft_validate_scanned_start OUT [--noise METRES] [--surface shown|lattice] CAPTURE...
///
/// OUT/NAME is the copy of a capture NAME; its start_surface is the true surface of frame 0 with
/// independent noise in each coordinate of its vertices, of this standard deviation (0.0005). With
/// `lattice` true surfaces, that of frame 0 and those of the copy's [truth], are the vertices of
/// the lattice that moved, the control points of the surface that was shown.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "program.h"
#include "source_lattice.h"
#include "weft/base/error.h"
#include "weft/base/random.h"
#include "weft/capture/capture.h"
#include "weft/mesh/mesh_io.h"

namespace {

using namespace weft;
using validation::SourceSurface;
namespace fs = std::filesystem;

constexpr std::uint64_t kSeed = 1;

void add_key(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  const std::string table = "[video]\n";
  const std::size_t at = text.find(table);
  if (at == std::string::npos) throw Error(file.string() + ": no line \"[video]\"");
  text.insert(at + table.size(), "start_surface = \"start.obj\"\n");
  std::ofstream(file, std::ios::binary) << text;
}

/// The copy's true surfaces become their control points.
void show_lattice(const Capture& copy) {
  const validation::LimitSurface surface(validation::grid_of(copy, read_truth(copy).mesh));
  const fs::path points = copy.folder / copy.truth->points;
  PointCache cache = read_pc2(points);
  for (Points& frame : cache.frames) frame = surface.control(frame);
  write_pc2(points, cache);
}

void copy_with_start(const fs::path& capture_folder, const fs::path& out, double noise,
                     SourceSurface surface) {
  const fs::path copy = out / capture_folder.filename();
  if (fs::exists(copy)) throw Error(copy.string() + " exists");
  read_capture(capture_folder);  // refuses what is none before anything is written
  fs::create_directories(out);
  fs::copy(capture_folder, copy, fs::copy_options::recursive);
  const Capture capture = read_capture(copy);
  if (surface == SourceSurface::lattice) show_lattice(capture);
  const TruthSurface truth = read_truth(capture);
  Points x = truth.frames.front();
  Rng rng(kSeed);
  for (double& coordinate : x.reshaped()) coordinate += noise * rng.normal();
  write_obj(copy / "start.obj", truth.mesh, x);
  add_key(copy / "capture.toml");
}

int run(const std::vector<std::string>& words) {
  double noise = 5e-4;
  SourceSurface surface = SourceSurface::shown;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == "--noise" && i + 1 < words.size())
      noise = validation::number<double>(words[i], words[i + 1], 0), ++i;
    else if (words[i] == "--surface" && i + 1 < words.size())
      surface = validation::surface_from_name(words[++i]);
    else
      names.push_back(words[i]);
  }
  if (names.size() < 2)
    throw Error("OUT [--noise METRES] [--surface shown|lattice] CAPTURE... are expected");
  for (std::size_t i = 1; i < names.size(); ++i)
    copy_with_start(names[i], names[0], noise, surface);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_scanned_start", [&] {
    return run({argv + 1, argv + argc});
  });
}
