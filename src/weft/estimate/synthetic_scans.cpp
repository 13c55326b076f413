#include "weft/estimate/synthetic_scans.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "weft/base/error.h"
#include "weft/base/number_text.h"
#include "weft/base/random.h"
#include "weft/base/text_file.h"
#include "weft/dynamics/held_equilibrium.h"

namespace weft {
namespace {

constexpr double kPerturbation = 5e-4;      // m, of what starts flat in a plane
constexpr double kAround = 0.05;            // m, by which the box of the outliers is wider
constexpr int kMarks = 9;                   // along a side of a clamp
constexpr double kStatedNoise = 1e-6;       // m, of a perfect scan
constexpr double kStatedForceNoise = 1e-4;  // N

void require(bool valid, const std::string& text) {
  if (!valid) throw Error(text);
}

/// "name:a,b" as its name and its numbers.
struct Words {
  std::string name;
  std::vector<double> numbers;
};

Words words_of(const std::string& text) {
  Words words;
  const std::size_t colon = text.find(':');
  words.name = text.substr(0, colon);
  if (colon == std::string::npos) return words;
  const auto numbers = numbers_of(std::string_view(text).substr(colon + 1), ',');
  if (!numbers)
    throw Error(fmt::format("experiment \"{}\": expected NAME:NUMBER[,NUMBER...]", text));
  words.numbers = *numbers;
  return words;
}

/// The nearest line to `border`, at least one cell from both ends of the side.
double on_line(double border, double cell, double side) {
  const double last = std::round(side / cell) - 1;
  return std::clamp(std::round(border / cell), 1.0, std::max(last, 1.0)) * cell;
}

class ExperimentText {
 public:
  ExperimentText(const std::string& text, double width, double height, Vec2 cell)
      : text_(text),
        words_(words_of(text)),
        width_(width),
        height_(height),
        cell_(std::move(cell)) {}

  ScanExperiment experiment() const {
    const std::string& name = words_.name;
    if (name == "frame") {
      const double angle = number(0, -60, 60, "degrees");
      count(1, 1);
      return picture_frame(width_, height_, angle * std::numbers::pi / 180, kPerturbation);
    }
    if (name == "corners") {
      count(2, 3);
      const double separation = words_.numbers.size() == 3 ? number(2, 0.2, 1, "") : 0.95;
      return corner_weights(width_, height_, separation, number(0, 0, 10, "kg"),
                            number(1, 0, 10, "kg"));
    }
    const bool along_u = name.ends_with("-u");
    const ScanAxis axis = along_u ? ScanAxis::u : ScanAxis::v;
    const double side = along_u ? width_ : height_, cell = along_u ? cell_.x() : cell_.y();
    if (name == "stretch-u" || name == "stretch-v") {
      count(1, 1);
      return edge_stretch(width_, height_, axis, number(0, 0, 0.5, ""), kPerturbation);
    }
    if (name == "edge-u" || name == "edge-v") {
      count(1, 1);
      return edge_weight(width_, height_, axis, on_line(0.1 * side, cell, side),
                         number(0, 0, 10, "kg"));
    }
    if (name == "ledge-u" || name == "ledge-v") {
      count(1, 1);
      return ledge(width_, height_, axis, on_line(number(0, 1e-3, side, "m"), cell, side));
    }
    throw Error(
        fmt::format("experiment \"{}\": no such experiment; frame, stretch-u, stretch-v, corners, "
                    "edge-u, edge-v, ledge-u, ledge-v",
                    text_));
  }

 private:
  void count(std::size_t least, std::size_t most) const {
    const std::size_t n = words_.numbers.size();
    require(n >= least && n <= most,
            fmt::format(
                "experiment \"{}\": numbers given: {}, needed: {}", text_, n,
                least == most ? fmt::format("{}", least) : fmt::format("{} to {}", least, most)));
  }
  double number(std::size_t k, double lower, double upper, const char* unit) const {
    require(k < words_.numbers.size(),
            fmt::format("experiment \"{}\": expected NAME:NUMBER[,NUMBER...]", text_));
    const double value = words_.numbers[k];
    require(value >= lower && value <= upper,
            fmt::format("experiment \"{}\": {:g} {}, valid: {:g} to {:g}", text_, value, unit,
                        lower, upper));
    return value;
  }

  const std::string& text_;
  Words words_;
  double width_, height_;
  Vec2 cell_;
};

void check(const CloudOptions& options) {
  require(options.points >= 100 && options.points <= 10'000'000,
          fmt::format("a cloud of {} points, valid: 100 to 10000000", options.points));
  require(options.noise >= 0 && options.noise <= 0.1,
          fmt::format("noise of {} m, valid: 0 to 0.1", options.noise));
  require(options.outliers >= 0 && options.outliers <= 0.5,
          fmt::format("a share of outliers of {}, valid: 0 to 0.5", options.outliers));
  require(options.hole >= 0 && options.hole <= 10,
          fmt::format("a hole of radius {} m, valid: 0 to 10", options.hole));
}

/// The grid that is written within the mesh that is simulated.
struct NestedGrids {
  TriangleMesh coarse, fine;
  std::vector<int> fine_of_coarse;  ///< vertices
  Vec2 cell;                        ///< m, of the coarse one
};

NestedGrids nested_grids(const SyntheticScanOptions& options) {
  const double spacing = std::min(options.width, options.height) / options.registered_cells;
  const int across = static_cast<int>(std::lround(options.width / spacing));
  const int down = static_cast<int>(std::lround(options.height / spacing));
  const int n = options.refinement;
  NestedGrids grids{
      make_swatch(options.width, options.height, across + 1, down + 1, GridPattern::uniform),
      make_swatch(options.width, options.height, n * across + 1, n * down + 1,
                  GridPattern::uniform),
      {},
      Vec2(options.width / across, options.height / down)};
  for (int row = 0; row <= down; ++row)
    for (int column = 0; column <= across; ++column)
      grids.fine_of_coarse.push_back(n * row * (n * across + 1) + n * column);
  return grids;
}

/// Where the clamps have the fabric: a rectangle of marks in each.
std::vector<Landmark> landmarks_of(const std::vector<ScanClamp>& clamps, const TriangleMesh& mesh,
                                   const Points& x, double noise, Rng& rng) {
  const MaterialLocator locator(mesh);
  std::vector<Landmark> landmarks;
  for (const ScanClamp& clamp : clamps) {
    const Vec2 size = clamp.region.upper - clamp.region.lower;
    const int columns = size.x() > 0 ? kMarks : 1, rows = size.y() > 0 ? kMarks : 1;
    for (int j = 0; j < rows; ++j) {
      for (int i = 0; i < columns; ++i) {
        const Vec2 share(columns > 1 ? i / (kMarks - 1.0) : 0, rows > 1 ? j / (kMarks - 1.0) : 0);
        Landmark landmark;
        landmark.uv = clamp.region.lower + share.cwiseProduct(size);
        landmark.position = interpolate(mesh, locator, x, landmark.uv);
        for (double& coordinate : landmark.position) coordinate += noise * rng.normal();
        landmarks.push_back(landmark);
      }
    }
  }
  return landmarks;
}

}  // namespace

Scan sample_cloud(const TriangleMesh& mesh, const Points& x, double width, double height,
                  const CloudOptions& options) {
  check(options);
  Rng rng(options.seed);
  const Vec2 middle(0.6 * width, 0.45 * height);
  MaterialPoints uv(2, options.points);
  Eigen::Index count = 0;
  for (int k = 0; k < options.points; ++k) {
    const double u = rng.uniform(0, width), v = rng.uniform(0, height);
    if ((Vec2(u, v) - middle).norm() >= options.hole) uv.col(count++) = Vec2(u, v);
  }
  require(count > 0, fmt::format("a hole of radius {} m leaves no points", options.hole));
  uv.conservativeResize(2, count);
  Scan scan;
  scan.position = interpolate(mesh, MaterialLocator(mesh), x, uv);
  const Vec3 lower = x.rowwise().minCoeff().array() - kAround;
  const Vec3 upper = x.rowwise().maxCoeff().array() + kAround;
  for (Eigen::Index k = 0; k < count; ++k) {
    const bool stray = rng.uniform() < options.outliers;
    for (int axis = 0; axis < 3; ++axis) {
      double& value = scan.position(axis, k);
      value = stray ? rng.uniform(lower[axis], upper[axis]) : value + options.noise * rng.normal();
    }
  }
  return scan;
}

ScanExperiment scan_experiment(const std::string& text, double width, double height,
                               const Vec2& cell) {
  return ExperimentText(text, width, height, cell).experiment();
}

const std::vector<std::string>& default_scan_experiments() {
  static const std::vector<std::string> list{"frame:12", "frame:-20", "stretch-u:0.08",
                                             "stretch-v:0.08"};
  return list;
}

ScanCapture make_synthetic_scans(const std::filesystem::path& folder, const Fabric& fabric,
                                 const std::vector<std::string>& experiments,
                                 const SyntheticScanOptions& options) {
  for (const double side : {options.width, options.height})
    require(side >= 0.01 && side <= 10,
            fmt::format("a swatch with a side of {} m, valid: 0.01 to 10", side));
  require(options.registered_cells >= 2 && options.registered_cells <= 200,
          fmt::format("{} cells, valid: 2 to 200", options.registered_cells));
  require(options.refinement >= 1 && options.refinement <= 16,
          fmt::format("a refinement of {}, valid: 1 to 16", options.refinement));
  require(options.force_noise >= 0,
          fmt::format("force noise of {} N must not be below 0", options.force_noise));
  require(!experiments.empty(), "no experiments");
  CloudOptions cloud = options.cloud;
  cloud.noise = options.noise;
  check(cloud);

  const NestedGrids grids = nested_grids(options);
  std::vector<ScanExperiment> list;
  for (const std::string& text : experiments)
    list.push_back(scan_experiment(text, options.width, options.height, grids.cell));
  ScanCapture capture;
  capture.name = fabric.name + " scans";
  capture.description = fmt::format("computed by weft on {} cells a cell of the grid",
                                    options.refinement * options.refinement);
  capture.width = options.width;
  capture.height = options.height;
  capture.areal_density = options.areal_density;
  ScanSynthesis synthesis;
  synthesis.areal_density = options.areal_density;
  synthesis.statics = static_solver_options();
  synthesis.force_noise = options.force_noise;
  synthesis.stated_noise = std::max(options.noise, kStatedNoise);
  synthesis.stated_force_noise = std::max(options.force_noise, kStatedForceNoise);
  Rng rng(options.seed);
  std::vector<ScanShape> shapes;
  std::vector<RawScan> raw;
  for (const ScanExperiment& experiment : list) {
    synthesis.seed = rng.bits();
    SynthesizedScan scan = synthesize_scan(experiment, grids.fine, fabric, synthesis);
    require(scan.converged, fmt::format("experiment \"{}\": no equilibrium; {:.2g} N are left",
                                        experiment.name, scan.residual));
    ScanShape shape;
    shape.mesh = grids.coarse;
    shape.x = scan.exact(Eigen::all, grids.fine_of_coarse);
    for (double& coordinate : shape.x.reshaped()) coordinate += options.noise * rng.normal();
    shape.weights = VecX::Ones(shape.x.cols());
    RawScan points;
    if (options.form == SyntheticScanForm::clouds) {
      cloud.seed = rng.bits();
      points.scan = sample_cloud(grids.fine, scan.exact, options.width, options.height, cloud);
      points.landmarks =
          landmarks_of(scan.target.clamps, grids.fine, scan.exact, options.noise, rng);
    }
    capture.targets.push_back(std::move(scan.target));
    shapes.push_back(std::move(shape));
    raw.push_back(std::move(points));
  }
  if (options.form == SyntheticScanForm::registered) raw.clear();
  capture.truth = "truth/fabric.toml";
  write_scan_capture(folder, capture, shapes, raw);
  make_folder(folder / "truth");
  Fabric truth = fabric;
  truth.areal_density = options.areal_density;
  write_fabric(folder / "truth/fabric.toml", truth);
  return read_scan_capture(folder);
}

}  // namespace weft
