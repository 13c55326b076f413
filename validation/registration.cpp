/// Registration against what others measured or simulated.
///
///   weft_validate_registration truth OUT FRAMES CAPTURE...   true surfaces as noisy clouds
///   weft_validate_registration hung OUT FRAME CAPTURE...     one of them, also from hanging cloth
///   weft_validate_registration video OUT CLOUDS UNIT START SIDE PICTURES CAMERA
///   weft_validate_registration partial OUT CLOUDS UNIT SIDE [HELD]
///
/// CLOUDS: a sequence of scans, UNIT m per unit; START: OBJ of the first frame with vt in m; SIDE:
/// m of the square cloth; PICTURES: a pattern of numbered images; CAMERA: "fx,fy,cx,cy" in px, the
/// clouds' axes x right, y down, z forward; HELD: "x,y,z" of the corner u = v = 0 in the last
/// frame, in m of the clouds' axes.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "program.h"
#include "weft/base/error.h"
#include "weft/base/number_text.h"
#include "weft/base/random.h"
#include "weft/capture/capture.h"
#include "weft/mesh/mesh_io.h"
#include "weft/registration/hung_start.h"
#include "weft/registration/landmarks.h"
#include "weft/registration/nonrigid_icp.h"
#include "weft/report/pictures.h"
#include "weft/report/plot.h"
#include "weft/vision/video.h"

namespace {

using namespace weft;
namespace fs = std::filesystem;

constexpr double kLeastSide = 1e-3;  // m
constexpr double kLeastUnit = 1e-9;  // m

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1,
                         static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

Points read_start(const fs::path& path, const GridTemplate& grid) {
  const MaterialSurface start = read_material_surface(path);
  return interpolate(start.mesh, MaterialLocator(start.mesh), start.x, grid.mesh.material);
}

// --- true surfaces ---

Scan cloud_of(const TriangleMesh& mesh, const MaterialLocator& locator, const Points& x,
              const GridTemplate& grid, std::uint64_t seed) {
  constexpr int points = 20000;
  constexpr double noise = 0.0005, outliers = 0.1;
  Rng rng(seed);
  MaterialPoints uv(2, points);
  for (int k = 0; k < points; ++k) {
    uv.col(k) = Vec2(rng.uniform(0, grid.width), rng.uniform(0, grid.height));
  }
  Scan scan;
  scan.position = interpolate(mesh, locator, x, uv);
  const Vec3 lower = scan.position.rowwise().minCoeff().array() - 0.05;
  const Vec3 upper = scan.position.rowwise().maxCoeff().array() + 0.05;
  for (int k = 0; k < points; ++k) {
    const bool stray = rng.uniform() < outliers;
    for (int axis = 0; axis < 3; ++axis) {
      double& value = scan.position(axis, k);
      value = stray ? rng.uniform(lower[axis], upper[axis]) : value + noise * rng.normal();
    }
  }
  return scan;
}

/// The true surfaces of a capture, and the grid that is laid on them.
class TrueSurfaces {
 public:
  explicit TrueSurfaces(const std::string& folder)
      : capture(read_capture(folder)),
        grid(make_grid_template(capture.width, capture.height, 41, 41)),
        truth_(read_truth(capture)),
        locator_(truth_.mesh) {}
  TrueSurfaces(const TrueSurfaces&) = delete;
  TrueSurfaces& operator=(const TrueSurfaces&) = delete;

  Scan cloud(int frame) const {
    return cloud_of(truth_.mesh, locator_, surface(frame), grid, static_cast<std::uint64_t>(frame));
  }
  /// Where the grid should lie.
  Points expected(int frame) const {
    return interpolate(truth_.mesh, locator_, surface(frame), grid.mesh.material);
  }

  const Capture capture;
  const GridTemplate grid;

 private:
  const Points& surface(int frame) const {
    return truth_.frames.at(static_cast<std::size_t>(frame));
  }
  const TruthSurface truth_;
  const MaterialLocator locator_;
};

struct TruthError {
  double mean = 0, max = 0;  ///< m, at the same (u, v)
};
TruthError error_of(const Points& x, const Points& expected) {
  const Points d = x - expected;
  return {d.colwise().norm().mean(), d.colwise().norm().maxCoeff()};
}

/// From the frame before, or without one from flat sheets.
ScanRegistration register_next(const GridTemplate& grid, const Scan& scan, const Points* before) {
  const ScanGeometry geometry = scan_geometry(scan);
  if (before)
    return register_scan(grid, scan, geometry, RegistrationStart{*before, {}}, {},
                         {.start_error = 0.03});
  return register_scan(grid, scan, geometry,
                       flat_starts(grid, scan, geometry, Vec3::UnitX(), -Vec3::UnitZ()));
}

void validate_truth(const fs::path& out, const std::vector<std::string>& words) {
  std::ofstream table(out / "truth.csv");
  table
      << "capture,frame,same_point_mean_m,same_point_max_m,off_surface_mean_m,inliers,strain_rms\n";
  const int most = validation::number<int>("FRAMES", words.at(0), 1);
  for (const std::string& folder : std::vector(words.begin() + 1, words.end())) {
    const TrueSurfaces truth(folder);
    const std::string& name = truth.capture.name;
    const int frames = std::min(truth.capture.frame_count, most);
    Points x;
    std::vector<double> means, offs;
    for (int frame = 0; frame < frames; ++frame) {
      const ScanRegistration r =
          register_next(truth.grid, truth.cloud(frame), frame > 0 ? &x : nullptr);
      x = r.x;
      const Points expected = truth.expected(frame);
      const Points normals = vertex_normals(truth.grid.mesh, expected);
      const TruthError error = error_of(x, expected);
      means.push_back(error.mean);
      offs.push_back((x - expected).cwiseProduct(normals).colwise().sum().cwiseAbs().mean());
      table << fmt::format("{},{},{:.6g},{:.6g},{:.6g},{},{:.4g}\n", name, frame, error.mean,
                           error.max, offs.back(), r.inliers, r.strain_rms);
    }
    fmt::print(
        "{}: {} frames, same (u, v): first {:.2f}, median {:.2f}, last {:.2f} mm; off the surface: "
        "median {:.2f} mm\n",
        name, frames, 1e3 * means.front(), 1e3 * quantile(means, 0.5), 1e3 * means.back(),
        1e3 * quantile(offs, 0.5));
  }
}

/// Root mean square of the strains of the cells, measured at their centres: along u, along v, and
/// the cosine between the two times their lengths.
Vec3 strains_of(const GridTemplate& grid, const Points& x) {
  Vec3 sum = Vec3::Zero();
  for (int j = 0; j + 1 < grid.rows; ++j) {
    for (int i = 0; i + 1 < grid.columns; ++i) {
      const int a = grid.vertex(i, j), b = grid.vertex(i, j + 1);
      const Vec3 u = (x.col(a + 1) - x.col(a) + x.col(b + 1) - x.col(b)) / (2 * grid.cell_u());
      const Vec3 v = (x.col(b) - x.col(a) + x.col(b + 1) - x.col(a + 1)) / (2 * grid.cell_v());
      sum += Vec3(u.norm() - 1, v.norm() - 1, u.dot(v)).cwiseAbs2();
    }
  }
  return (sum / ((grid.rows - 1) * (grid.columns - 1))).cwiseSqrt();
}

/// One frame from the flat sheet, and from there and from cloth that hangs by the fixtures; what
/// each start costs beside where it ends.
void validate_hung(const fs::path& out, const std::vector<std::string>& words) {
  std::ofstream table(out / "hung.csv");
  table << "capture,frame,start,same_point_mean_m,same_point_max_m,cost_m4,inliers,strain_rms,"
           "unsupported\n";
  const int frame = validation::number<int>("FRAME", words.at(0), 0);
  LinePlot plot;
  plot.title = "where each start of a registration ends, and what it costs there";
  plot.x.label = "cost, of the start that is the truth";
  plot.x.logarithmic = true;
  plot.y.label = "distance at the same (u, v)";
  plot.y.unit = "mm";
  plot.y.from_zero = true;
  for (const std::string& folder : std::vector(words.begin() + 1, words.end())) {
    const TrueSurfaces truth(folder);
    const Capture& capture = truth.capture;
    const GridTemplate& grid = truth.grid;
    PlotSeries series;
    series.name = capture.name;
    series.mark = PlotSeries::Mark::points;
    const Points expected = truth.expected(frame);
    const Scan scan = truth.cloud(frame);
    const ScanGeometry geometry = scan_geometry(scan);
    std::vector<Landmark> held;
    for (const CaptureFixture& fixture : capture.fixtures)
      held.push_back({fixture.at, fixture.motion.position(frame / capture.frame_rate), 1});
    const auto flat = flat_starts(grid, scan, geometry, Vec3::UnitX(), -Vec3::UnitZ());
    const auto hung = hung_starts(grid, scan, geometry, held);
    const auto run = [&](const std::vector<RegistrationStart>& starts,
                         const std::vector<Landmark>& landmarks, const std::string& name) {
      ScanRegistration best;
      for (std::size_t k = 0; k < starts.size(); ++k) {
        ScanRegistration r = register_scan(grid, scan, geometry, starts[k], landmarks);
        const TruthError error = error_of(r.x, expected);
        int unsupported = 0;
        for (int v = 0; v < grid.mesh.vertex_count(); ++v) unsupported += !r.supported(v);
        table << fmt::format("{},{},{} {},{:.6g},{:.6g},{:.6g},{},{:.4g},{}\n", capture.name, frame,
                             name, k, error.mean, error.max, r.cost, r.inliers, r.strain_rms,
                             unsupported);
        if (!landmarks.empty()) {
          series.x.push_back(r.cost);
          series.y.push_back(1e3 * error.mean);
        }
        if (k == 0 || r.cost < best.cost) best = std::move(r);
      }
      return best;
    };
    const ScanRegistration before = run(flat, {}, "flat");
    ScanRegistration after = run(flat, held, "flat and held");
    if (ScanRegistration r = run(hung, held, "hung"); r.cost < after.cost) after = std::move(r);
    // What the registration makes of the truth itself: the source's cloth is strained.
    const ScanRegistration floor =
        run({{expected, {}, RegistrationStart::View::part, 0.01}}, held, "truth");
    for (double& cost : series.x) cost /= floor.cost;
    plot.series.push_back(std::move(series));
    fmt::print("{} frame {}, same (u, v), mean / largest:", capture.name, frame);
    for (const ScanRegistration* r :
         {&before, static_cast<const ScanRegistration*>(&after), &floor})
      fmt::print("  {:.1f} / {:.0f} mm", 1e3 * error_of(r->x, expected).mean,
                 1e3 * error_of(r->x, expected).max);
    const Vec3 strains = 100 * strains_of(grid, expected);
    fmt::print(
        "  (flat; held points and hanging cloth; from the truth); strain of the truth {:.1f}, "
        "{:.1f}, "
        "{:.1f} %\n",
        strains.x(), strains.y(), strains.z());
  }
  write_plot(out / "hung.svg", plot);
}

// --- clouds of a camera ---

struct Split {
  Scan used;
  Points held;
};
/// Every fifth point is kept from the registration.
Split split(const Scan& scan) {
  std::vector<int> used, held;
  for (int k = 0; k < scan.size(); ++k) (k % 5 == 4 ? held : used).push_back(k);
  Split parts;
  parts.used.position = scan.position(Eigen::all, used);
  parts.held = scan.position(Eigen::all, held);
  return parts;
}

struct Held {
  double median = 0, p90 = 0, p95 = 0;  ///< m, of the distance to the surface
  double within = 0;  ///< share of all held-back points over the surface and nearer than 5 mm
};
Held held_distance(const GridTemplate& grid, const Points& x, const Points& points) {
  std::vector<double> over;
  int near = 0;
  for (const double d : distances_to_surface(grid, x, points)) {
    if (std::isnan(d)) continue;
    over.push_back(std::abs(d));
    near += std::abs(d) < 0.005;
  }
  return {quantile(over, 0.5), quantile(over, 0.9), quantile(over, 0.95),
          near / static_cast<double>(points.cols())};
}

struct Drift {
  double median = 0, p90 = 0;  ///< m, length of the shift
  std::size_t points = 0;
};
Drift drift_of(const std::vector<TextureShift>& shifts) {
  std::vector<double> lengths;
  for (const TextureShift& shift : shifts) lengths.push_back(shift.shift.norm());
  return {quantile(lengths, 0.5), quantile(lengths, 0.9), lengths.size()};
}

constexpr double kTexel = 0.0015;

/// The registrations of a sequence, by the clouds alone or with the print, too.
class VideoStudy {
 public:
  VideoStudy(const GridTemplate& grid, std::vector<Image> pictures, Pinhole camera)
      : grid_(grid), pictures_(std::move(pictures)), camera_(std::move(camera)) {
    // What is compared lies between what the landmarks come from: the windows have no texel in
    // common.
    track_.window = 0.024;
    judge_.window = 0.014;
    judge_.reach = 0.012;
    judge_.offset = Vec2(judge_.spacing / 2, judge_.spacing / 2);
  }

  struct Frame {
    Held held;
    Drift drift;
    ScanRegistration registration;
  };
  enum class Print { left_out, used };
  std::vector<Frame> run(const std::vector<Scan>& scans, const Points& start, Print print) {
    std::vector<Frame> frames;
    Points x = start;
    for (std::size_t k = 0; k < scans.size(); ++k) {
      const Split parts = split(scans[k]);
      const ScanGeometry geometry = scan_geometry(parts.used);
      RegistrationOptions options;
      options.start_error = 0.03;
      Frame frame;
      frame.registration =
          register_scan(grid_, parts.used, geometry, RegistrationStart{x, {}}, {}, options);
      if (k == 0) reference_ = unwrap(frame.registration.x, 0);
      if (print == Print::used && k > 0) {
        std::size_t landmarks = 0;
        frame.registration = follow_print(
            grid_, parts.used, geometry, std::move(frame.registration), reference_,
            [&](const Points& at) { return unwrap(at, k); }, options, track_, landmarks);
      }
      x = frame.registration.x;
      frame.held = held_distance(grid_, x, parts.held);
      frame.drift = drift_of(track_texture(reference_, unwrap(x, k), judge_));
      frames.push_back(std::move(frame));
    }
    return frames;
  }
  FabricImage unwrap(const Points& x, std::size_t k) const {
    return unwrap_picture(grid_, x, pictures_[k], camera_, kTexel);
  }

 private:
  const GridTemplate& grid_;
  std::vector<Image> pictures_;
  Pinhole camera_;
  TextureTracking track_, judge_;
  FabricImage reference_;
};

PlotSeries series(const std::string& name, const std::vector<VideoStudy::Frame>& frames,
                  double (*value)(const VideoStudy::Frame&)) {
  PlotSeries s;
  s.name = name;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    s.x.push_back(static_cast<double>(k));
    s.y.push_back(1e3 * value(frames[k]));
  }
  return s;
}

void write_frames(const fs::path& path, const std::string& title, std::vector<PlotSeries> all) {
  LinePlot plot;
  plot.title = title;
  plot.x.label = "frame";
  plot.x.integers = true;
  plot.y.label = "distance";
  plot.y.unit = "mm";
  plot.y.from_zero = true;
  plot.series = std::move(all);
  write_plot(path, plot);
}

void print_frames(const std::string& name, const std::vector<VideoStudy::Frame>& frames) {
  std::vector<double> median, p95, within, drift, drift90, strain;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    median.push_back(1e3 * frames[k].held.median);
    p95.push_back(1e3 * frames[k].held.p95);
    within.push_back(frames[k].held.within);
    strain.push_back(100 * frames[k].registration.strain_rms);
    if (k == 0) continue;
    drift.push_back(1e3 * frames[k].drift.median);
    drift90.push_back(1e3 * frames[k].drift.p90);
  }
  const Drift last = frames.back().drift;
  fmt::print(
      "{}: held-back points, over frames: median {:.2f} mm, 95 % {:.2f} mm, within 5 mm {:.1f} %\n"
      "  drift of the print against frame 0: median {:.2f} mm (largest frame {:.2f}), 90 % of "
      "points "
      "{:.2f} mm; last frame {:.2f} mm at {} points\n  strain rms {:.2f} %\n",
      name, quantile(median, 0.5), quantile(p95, 0.5), 100 * quantile(within, 0.5),
      quantile(drift, 0.5), *std::max_element(drift.begin(), drift.end()), quantile(drift90, 0.5),
      1e3 * last.median, last.points, quantile(strain, 0.5));
}

/// m per unit of the clouds.
double unit_of(const std::vector<std::string>& words) {
  return validation::number<double>("UNIT", words.at(1), kLeastUnit);
}

void validate_video(const fs::path& out, const std::vector<std::string>& words) {
  const std::vector<Scan> scans = read_scans(words.at(0), unit_of(words));
  const double side = validation::number<double>("SIDE", words.at(3), kLeastSide);
  const GridTemplate grid = make_grid_template(side, side, 32, 32);
  const Points start = read_start(words.at(2), grid);
  const auto camera = numbers_of(words.at(5), ',');
  if (!camera || camera->size() != 4) throw Error("CAMERA: expected fx,fy,cx,cy");
  Projection projection;
  projection << (*camera)[0], 0, (*camera)[2], 0, 0, (*camera)[1], (*camera)[3], 0, 0, 0, 1, 0;
  VideoStudy study(grid, read_frames(words.at(4), static_cast<int>(scans.size())),
                   Pinhole(projection, Vec3::UnitZ(), "camera"));
  const auto clouds = study.run(scans, start, VideoStudy::Print::left_out);
  print_frames("clouds alone", clouds);
  const auto both = study.run(scans, start, VideoStudy::Print::used);
  print_frames("clouds and print", both);

  write_frames(out / "held_back.svg", "held-back points to the surface, median and 95 %",
               {series("clouds alone", clouds, [](const auto& f) { return f.held.median; }),
                series("clouds alone, 95 %", clouds, [](const auto& f) { return f.held.p95; }),
                series("with the print", both, [](const auto& f) { return f.held.median; }),
                series("with the print, 95 %", both, [](const auto& f) { return f.held.p95; })});
  write_frames(out / "drift.svg", "how far the print moved over the grid since frame 0",
               {series("clouds alone", clouds, [](const auto& f) { return f.drift.median; }),
                series("with the print", both, [](const auto& f) { return f.drift.median; })});
  std::vector<Picture> tiles;
  for (const std::size_t k : {std::size_t{0}, scans.size() / 2, scans.size() - 1}) {
    tiles.push_back(intensity_picture(study.unwrap(clouds[k].registration.x, k).grey));
    tiles.push_back(intensity_picture(study.unwrap(both[k].registration.x, k).grey));
  }
  write_picture(out / "print_over_uv.png", montage(tiles, 2));
  PointCache cache;
  for (const auto& frame : both) cache.frames.push_back(frame.registration.x);
  write_pc2(out / "registered.pc2", cache);
  write_obj(out / "registered.obj", grid.mesh, cache.frames.front());
}

void validate_partial(const fs::path& out, const std::vector<std::string>& words) {
  const std::vector<Scan> scans = read_scans(words.at(0), unit_of(words));
  const double side = validation::number<double>("SIDE", words.at(2), kLeastSide);
  const GridTemplate grid = make_grid_template(side, side, 21, 21);
  // The last frame of each trial, where the cloth hangs from the gripper by a corner.
  const Vec3 u = Vec3(1, 0, -1).normalized(), v = Vec3(-1, 0, -1).normalized();
  std::vector<Landmark> held;
  if (words.size() > 3) {
    const auto corner = numbers_of(words[3], ',');
    if (!corner || corner->size() != 3) throw Error("HELD: expected x,y,z");
    held.emplace_back().position = Eigen::Map<const Vec3>(corner->data());
  }
  constexpr std::size_t trial = 25;
  for (std::size_t k = trial - 1; k < scans.size(); k += trial) {
    const Split parts = split(scans[k]);
    const ScanGeometry geometry = scan_geometry(parts.used);
    auto starts = flat_starts(grid, parts.used, geometry, u, v);
    if (!held.empty())
      for (RegistrationStart& start : hung_starts(grid, parts.used, geometry, held))
        starts.push_back(std::move(start));
    const ScanRegistration r = register_scan(grid, parts.used, geometry, starts, held);
    const Held distance = held_distance(grid, r.x, parts.held);
    int unsupported = 0;
    for (int i = 0; i < grid.mesh.vertex_count(); ++i) unsupported += !r.supported(i);
    fmt::print(
        "frame {}: {} of {} points taken for cloth, held-back points over the surface: median "
        "{:.2f}, 90 % {:.2f} mm, {:.0f} % of all within 5 mm; {} of {} vertices unsupported; "
        "strain "
        "rms {:.1f} %\n",
        k, r.inliers, r.points, 1e3 * distance.median, 1e3 * distance.p90, 100 * distance.within,
        unsupported, grid.mesh.vertex_count(), 100 * r.strain_rms);
    write_obj(out / fmt::format("partial_{}.obj", k), grid.mesh, r.x);
  }
}

int run(int argc, char** argv) {
  if (argc < 4) {
    fmt::print(stderr, "usage: weft_validate_registration truth|hung|video|partial OUT ...\n");
    return 2;
  }
  const std::string kind = argv[1];
  const fs::path out = argv[2];
  fs::create_directories(out);
  const std::vector<std::string> words(argv + 3, argv + argc);
  if (kind == "truth") validate_truth(out, words);
  if (kind == "hung") validate_hung(out, words);
  if (kind == "video") validate_video(out, words);
  if (kind == "partial") validate_partial(out, words);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_registration",
                                       [&] { return run(argc, argv); });
}
