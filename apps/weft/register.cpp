#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "command_line.h"
#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/text_file.h"
#include "weft/capture/landmark_file.h"
#include "weft/capture/material_cover.h"
#include "weft/mesh/mesh_io.h"
#include "weft/registration/hung_start.h"
#include "weft/registration/landmarks.h"
#include "weft/registration/nonrigid_icp.h"
#include "weft/registration/registration_checks.h"
#include "weft/report/plot.h"
#include "weft/vision/video.h"

namespace weft::app {
namespace {

struct RegisterArguments {
  std::string scan;
  std::string swatch;
  std::string out;
  std::string start;
  std::string landmarks;
  std::string held, gravity = "0,0,-9.81";
  std::string u_axis = "1,0,0", v_axis = "0,0,-1";
  bool axes_given = false;
  int grid = 41;
  double unit = 1;
  double stamp = 0;
  std::string stamp_origin = "0,0";
  bool print = false;
  std::string pictures, camera;
  RegistrationOptions options;
  bool overwrite = false;
  bool json = false;
};

Vec3 direction(const std::string& option, const std::string& text) {
  const auto numbers = numbers_in(option, text, ',', 3);
  const Vec3 v(numbers[0], numbers[1], numbers[2]);
  if (!(v.norm() > 1e-9)) throw Error(fmt::format("{}: no direction", option));
  return v.normalized();
}

GridTemplate read_template(const RegisterArguments& arguments) {
  const auto sides = numbers_in("--swatch", arguments.swatch, 'x', 2);
  if (!(sides[0] >= 0.001 && sides[0] <= 10 && sides[1] >= 0.001 && sides[1] <= 10)) {
    throw Error(fmt::format("--swatch {}: sides must be 0.001 to 10 m", arguments.swatch));
  }
  const double longer = std::max(sides[0], sides[1]);
  const auto along = [&](double side) {
    return std::max(3, 1 + static_cast<int>(std::lround((arguments.grid - 1) * side / longer)));
  };
  return make_grid_template(sides[0], sides[1], along(sides[0]), along(sides[1]));
}

/// The shape in an OBJ whose vt are (u, v) in m, at the vertices of the grid.
Points read_start(const std::string& path, const GridTemplate& grid) {
  const MaterialSurface start = read_material_surface(path);
  check_covers_swatch(start.mesh, grid.width, grid.height, path);
  return interpolate(start.mesh, MaterialLocator(start.mesh), start.x, grid.mesh.material);
}

/// Flat, and turned as the axes say.
std::vector<RegistrationStart> starts_by_axes(const RegisterArguments& arguments,
                                              const GridTemplate& grid, const Scan& scan,
                                              const ScanGeometry& geometry) {
  constexpr double least_sine = 0.1;  // 6 degrees
  const Vec3 u = direction("--u-axis", arguments.u_axis);
  const Vec3 v = direction("--v-axis", arguments.v_axis);
  if (u.cross(v).norm() < least_sine)
    throw Error(fmt::format("--u-axis {}: is along --v-axis {}; the two must be across",
                            arguments.u_axis, arguments.v_axis));
  return with_errors_at({.file = arguments.scan},
                        [&] { return flat_starts(grid, scan, geometry, u, v); });
}

Vec3 gravity_of(const RegisterArguments& arguments) {
  const auto numbers = numbers_in("--gravity", arguments.gravity, ',', 3);
  const Vec3 gravity(numbers[0], numbers[1], numbers[2]);
  if (!(gravity.norm() > 0))
    throw Error(fmt::format("--gravity {}: must not be 0,0,0: the cloth of --held hangs",
                            arguments.gravity));
  return gravity;
}

std::vector<RegistrationStart> first_starts(const RegisterArguments& arguments,
                                            const GridTemplate& grid, const Scan& scan,
                                            const ScanGeometry& geometry,
                                            const std::vector<Landmark>& landmarks,
                                            const std::vector<Landmark>& held) {
  if (!arguments.start.empty()) return {{read_start(arguments.start, grid), {}}};
  std::vector<RegistrationStart> starts;
  if (landmarks.size() >= 3)
    starts.push_back({flat_start(grid, landmarks), {}});
  else
    starts = starts_by_axes(arguments, grid, scan, geometry);
  if (held.empty()) return starts;
  HungStartOptions hang;
  hang.gravity = gravity_of(arguments);
  hang.threads = arguments.options.threads;
  for (RegistrationStart& start : hung_starts(grid, scan, geometry, held, hang))
    starts.push_back(std::move(start));
  return starts;
}

/// Registers again, twice, with the crossings of the stamped grid; says in `landmarks` how many.
ScanRegistration follow_stamp(const RegisterArguments& arguments, const GridTemplate& grid,
                              const Scan& scan, const ScanGeometry& geometry,
                              ScanRegistration registration, std::size_t& landmarks) {
  constexpr double texels = 20;  // a pitch
  const auto origin = numbers_in("--stamp-origin", arguments.stamp_origin, ',', 2);
  const StampedGrid stamp{arguments.stamp, Vec2(origin[0], origin[1])};
  for (int round = 0; round < 2; ++round) {
    const FabricImage image = unwrap_scan(grid, registration.x, scan, arguments.stamp / texels);
    const auto crossings = find_stamped_grid(grid, registration.x, image, stamp);
    landmarks = crossings.size();
    if (crossings.empty()) break;
    RegistrationOptions options = arguments.options;
    options.start_error = arguments.stamp;
    registration = register_scan(grid, scan, geometry, RegistrationStart{registration.x, {}},
                                 crossings, options);
  }
  return registration;
}

/// The camera of the pictures: a file of 12 numbers, the rows of a projection.
Pinhole read_camera(const std::string& path, const Points& in_front) {
  std::ifstream file(path);
  if (!file || std::filesystem::is_directory(path)) throw error_at({path, 0, {}}, "cannot be read");
  Projection projection;
  bool complete = true;
  for (int k = 0; k < 12 && complete; ++k)
    complete = static_cast<bool>(file >> projection(k / 4, k % 4));
  std::string more;
  if (!complete || file >> more)
    throw error_at({path, 0, {}},
                   fmt::format("expected 12 numbers and no more, 3 rows of 4: the projection, m to "
                               "px{}",
                               complete ? fmt::format("; \"{}\" follows them", more) : ""));
  return Pinhole(projection, in_front.rowwise().mean(), "--camera");
}

/// Keeps the grid of a sequence on what the first frame has printed.
class Print {
 public:
  Print(const RegisterArguments& arguments, const GridTemplate& grid,
        const std::vector<Scan>& scans)
      : grid_(grid), texel_(std::sqrt(grid.width * grid.height) / texels) {
    if (arguments.pictures.empty() != arguments.camera.empty()) {
      throw Error("--pictures and --camera belong together");
    }
    if (!arguments.pictures.empty()) {
      pictures_ = read_frames(arguments.pictures, static_cast<int>(scans.size()));
      camera_ = read_camera(arguments.camera, scans.front().position);
    }
    on_ = arguments.print || !pictures_.empty();
    tracking_.spacing = tracking_.window = 27 * texel_;
    tracking_.reach = 13 * texel_;
  }

  double texel() const { return texel_; }
  bool on() const { return on_; }

  ScanRegistration follow(std::size_t frame, const Scan& scan, const ScanGeometry& geometry,
                          ScanRegistration registration, const RegistrationOptions& options,
                          std::size_t& landmarks) {
    const auto look = [&](const Points& x) {
      return pictures_.empty() ? unwrap_scan(grid_, x, scan, texel_)
                               : unwrap_picture(grid_, x, pictures_[frame], camera_, texel_);
    };
    if (frame > 0) {
      return follow_print(grid_, scan, geometry, std::move(registration), reference_, look, options,
                          tracking_, landmarks);
    }
    reference_ = look(registration.x);
    return registration;
  }

 private:
  static constexpr double texels = 370;  // along a side
  const GridTemplate& grid_;
  double texel_;
  bool on_ = false;
  std::vector<Image> pictures_;
  Pinhole camera_;
  FabricImage reference_;
  TextureTracking tracking_;
};

std::string vertex_rows(const GridTemplate& grid, const ScanRegistration& registration, int frame) {
  std::string text;
  for (int v = 0; v < grid.mesh.vertex_count(); ++v) {
    const double distance = registration.distance[v];
    text +=
        fmt::format("{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{},{},{:.6g}\n", frame, v,
                    grid.mesh.material(0, v), grid.mesh.material(1, v), registration.x(0, v),
                    registration.x(1, v), registration.x(2, v), registration.supported(v) ? 1 : 0,
                    std::isnan(distance) ? std::string() : fmt::format("{:.6g}", distance),
                    registration.supported(v) ? registration.weight[v] : 0.0);
  }
  return text;
}

/// How the distances of the inliers are spread.
LinePlot residual_plot(const ScanRegistration& registration) {
  constexpr int bins = 60;
  const double limit = std::max(3 * registration.residual_rms, 1e-6);
  PlotSeries series;
  series.y.assign(bins, 0);
  for (int b = 0; b < bins; ++b) {
    series.x.push_back(1e3 * limit * (2 * (b + 0.5) / bins - 1));
  }
  for (const double r : registration.residual) {
    const double at = (r / limit + 1) / 2 * bins;
    if (at >= 0 && at < bins) series.y[static_cast<std::size_t>(at)] += 1;
  }
  LinePlot plot;
  plot.title = "points of the scan from the registered surface";
  plot.x.label = "distance along the normal";
  plot.x.unit = "mm";
  plot.y.label = "points";
  plot.y.from_zero = true;
  plot.series.push_back(std::move(series));
  return plot;
}

HeatMap distance_map(const GridTemplate& grid, const ScanRegistration& registration) {
  HeatMap map;
  map.title = "distance of the scan, by place on the fabric";
  map.x_axis.label = "u";
  map.y_axis.label = "v";
  map.x_axis.unit = map.y_axis.unit = "m";
  for (int i = 0; i < grid.columns; ++i) map.x.push_back(grid.mesh.material(0, i));
  for (int j = 0; j < grid.rows; ++j) map.y.push_back(grid.mesh.material(1, grid.vertex(0, j)));
  map.values.resize(grid.rows, grid.columns);
  for (int j = 0; j < grid.rows; ++j) {
    for (int i = 0; i < grid.columns; ++i) {
      const int v = grid.vertex(i, j);
      map.values(j, i) = registration.supported(v) ? 1e3 * registration.distance[v]
                                                   : std::numeric_limits<double>::quiet_NaN();
    }
  }
  map.label = "distance";
  map.unit = "mm";
  map.gap = "unsupported";
  map.lower = 0;
  return map;
}

nlohmann::json registration_json(int frame, const ScanRegistration& r) {
  return {{"frame", frame},
          {"points", r.points},
          {"inliers", r.inliers},
          {"residual_median", r.residual_median},
          {"residual_p95", r.residual_p95},
          {"residual_rms", r.residual_rms},
          {"reach", r.reach},
          {"landmark_rms", r.landmark_rms},
          {"strain_rms", r.strain_rms},
          {"unsupported_vertices", unsupported_vertices(r)},
          {"steps", r.rounds}};
}

void print_line(const nlohmann::json& s) {
  fmt::print(
      "frame {}: {} of {} points, median {:.2f} mm, 95 % {:.2f} mm, strain {:.2f} % rms, {} "
      "vertices unsupported\n",
      s["frame"].get<int>(), s["inliers"].get<int>(), s["points"].get<int>(),
      1e3 * s["residual_median"].get<double>(), 1e3 * s["residual_p95"].get<double>(),
      100 * s["strain_rms"].get<double>(), s["unsupported_vertices"].get<int>());
}

/// Of a sequence the scan `k`. Landmarks are on the first.
ScanSource source_of(const RegisterArguments& arguments, std::size_t scans, std::size_t k) {
  ScanSource source{arguments.scan, "--unit", k == 0 ? arguments.landmarks : std::string()};
  if (scans > 1) source.scan += fmt::format(": frame {}", k);
  return source;
}

void print_doubts(int frame, const ScanRegistration& registration) {
  for (const std::string& doubt : registration_doubts(registration))
    fmt::print(stderr, "warning: frame {}: {}\n", frame, doubt);
}

/// What asks for a sequence, given one scan.
void refuse_for_one(const RegisterArguments& arguments) {
  const bool pictures = !arguments.pictures.empty() && !arguments.camera.empty();
  if (!arguments.print && !pictures) return;
  throw Error(fmt::format("{}: only with a sequence; {} is one scan",
                          arguments.print ? "--print" : "--pictures", arguments.scan));
}

/// Of each scan, where something is looked for in its colours.
void check_colours(const RegisterArguments& arguments, const std::vector<Scan>& scans) {
  const bool print = arguments.print && arguments.pictures.empty();
  if (!(arguments.stamp > 0) && !print) return;
  for (std::size_t k = 0; k < scans.size(); ++k) {
    if (scans[k].colour.cols() > 0 || scans[k].texture) continue;
    throw Error(fmt::format("{}: {} has no colours{}", arguments.stamp > 0 ? "--stamp" : "--print",
                            source_of(arguments, scans.size(), k).scan,
                            arguments.stamp > 0 ? "" : "; give --pictures and --camera"));
  }
}

void run_register(const RegisterArguments& arguments) {
  const std::filesystem::path out = arguments.out;
  const GridTemplate grid = read_template(arguments);
  std::vector<Landmark> landmarks;
  if (!arguments.landmarks.empty()) landmarks = read_landmarks(arguments.landmarks, grid);
  if (arguments.axes_given && landmarks.size() >= 3)
    throw Error("--u-axis, --v-axis: not with three landmarks or more, which place the sheet");
  std::vector<Landmark> held;
  if (!arguments.held.empty()) held = read_landmarks(arguments.held, grid);
  const std::vector<Scan> scans = read_scans(arguments.scan, arguments.unit);
  if (scans.size() == 1) refuse_for_one(arguments);
  check_colours(arguments, scans);
  for (std::size_t k = 0; k < scans.size(); ++k)
    check_scan_extent(scans[k], grid, source_of(arguments, scans.size(), k));
  prepare_output_folder(out, {"registration.json", "registered.obj"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);

  const std::string results =
      R"(registered\.(obj|pc2)|vertices\.csv|registration\.json|(residuals|distance)\.(svg|csv))";
  const double cell = std::min(grid.cell_u(), grid.cell_v());
  const double size = std::sqrt(grid.width * grid.height);
  Print print(arguments, grid, scans);
  nlohmann::json frames = nlohmann::json::array();
  std::string vertices = "frame,vertex,u_m,v_m,x_m,y_m,z_m,supported,distance_m,weight\n";
  PointCache cache;
  for (std::size_t k = 0; k < scans.size(); ++k) {
    const double spacing =
        arguments.stamp > 0 ? std::min(cell / 4, arguments.stamp / 20) : cell / 4;
    const Scan scan = sample_scan(scans[k], spacing);
    const ScanGeometry geometry = scan_geometry(scan, 16, arguments.options.threads);
    RegistrationOptions options = arguments.options;
    ScanRegistration registration;
    if (k == 0) {
      const auto starts = first_starts(arguments, grid, scan, geometry, landmarks, held);
      landmarks.insert(landmarks.end(), held.begin(), held.end());
      registration = register_scan(grid, scan, geometry, starts, landmarks, options);
    } else {
      // The cloth is near to where it was.
      options.start_error = std::max(0.06 * size, 1.5 * cell);
      registration = register_scan(grid, scan, geometry, {cache.frames.back(), {}}, {}, options);
    }
    const int frame = static_cast<int>(k);
    std::size_t crossings = 0;
    if (arguments.stamp > 0) {
      registration =
          follow_stamp(arguments, grid, scan, geometry, std::move(registration), crossings);
    }
    std::size_t tracked = 0;
    if (print.on()) {
      registration = print.follow(k, scan, geometry, std::move(registration), options, tracked);
    }
    check_registration(registration, scan, grid, source_of(arguments, scans.size(), k));
    frames.push_back(registration_json(frame, registration));
    frames.back()["print_landmarks"] = tracked;
    frames.back()["stamp_crossings"] = crossings;
    if (!arguments.json) print_line(frames.back());
    print_doubts(frame, registration);
    vertices += vertex_rows(grid, registration, frame);
    if (k == 0) {
      if (arguments.overwrite) remove_results(out, results);
      write_obj(out / "registered.obj", grid.mesh, registration.x,
                fmt::format("registered to {}", arguments.scan));
      write_plot(out / "residuals.svg", residual_plot(registration));
      write_plot(out / "distance.svg", distance_map(grid, registration));
    }
    cache.frames.push_back(std::move(registration.x));
  }
  write_text(out / "vertices.csv", vertices);
  if (scans.size() > 1) write_pc2(out / "registered.pc2", cache);
  const nlohmann::json result = {{"format", "weft-registration"},
                                 {"version", 1},
                                 {"command", command_line()},
                                 {"made", now()},
                                 {"swatch", {grid.width, grid.height}},
                                 {"columns", grid.columns},
                                 {"rows", grid.rows},
                                 {"frames", frames}};
  write_text(out / "registration.json", result.dump(2) + "\n");
  if (arguments.json) fmt::print("{}\n", result.dump(2));
}

/// Where the grid lies before it is fitted.
void add_start_options(CLI::App& command, RegisterArguments& arguments) {
  command.add_option("--start", arguments.start,
                     "shape to begin from: an OBJ whose vt are (u, v) in m");
  command.add_option("--landmarks", arguments.landmarks,
                     "points of the fabric on the first scan: a CSV with u_m, v_m, x_m, y_m, z_m "
                     "and perhaps weight; three or more place the sheet");
  command.add_option("--held", arguments.held,
                     "points of the fabric that hold it, on the first scan, a CSV as of "
                     "--landmarks: they are landmarks, and cloth that hangs by them under "
                     "--gravity is where the registration begins, too (without --start)");
  command
      .add_option("--gravity", arguments.gravity,
                  "with --held: in the scan's axes, m/s^2, not 0,0,0")
      ->capture_default_str();
  command
      .add_option("--u-axis", arguments.u_axis,
                  "where u runs, about, in the scan's axes (without --start and three landmarks)")
      ->capture_default_str();
  command.add_option("--v-axis", arguments.v_axis, "where v runs, about")->capture_default_str();
}

/// What is seen on the fabric.
void add_print_options(CLI::App& command, RegisterArguments& arguments) {
  command
      .add_option("--stamp", arguments.stamp,
                  "pitch of dark grid lines stamped on the fabric, m, 0 to 1: their crossings are "
                  "looked for in the scan's colours; 0: none")
      ->check(number_in(0, 1))
      ->capture_default_str();
  command
      .add_option("--stamp-origin", arguments.stamp_origin,
                  "u,v of a crossing of the stamped grid, m, each 0 to the pitch")
      ->capture_default_str();
  command.add_flag("--print", arguments.print,
                   "in a sequence, keep the grid on what the first frame has printed, by the "
                   "colours of the scans");
  command.add_option("--pictures", arguments.pictures,
                     "the same by pictures of the frames: a pattern such as frames/%03d.png");
  command.add_option("--camera", arguments.camera,
                     "camera of the pictures: a file with 3 rows of 4 numbers, the projection from "
                     "the scans' axes (m) to px");
}

/// How closely the grid follows the scan.
void add_fit_options(CLI::App& command, RegisterArguments& arguments) {
  command
      .add_option("--reach", arguments.options.start_error,
                  "how far the start may be off, m, 0 to 10; 0: 0.15 of the swatch's size")
      ->check(number_in(0, 10))
      ->capture_default_str();
  command
      .add_option("--smoothing", arguments.options.smoothing,
                  "features narrower than 6 times this are smoothed, m, 0 to 1; 0: 0.3 to 1 cell "
                  "by the scatter of the points")
      ->check(number_in(0, 1))
      ->capture_default_str();
  command
      .add_option("--isometry", arguments.options.isometry,
                  "distance that weighs as much as 100 % of strain, m, 0 to 100; 0: 0.5 of the "
                  "swatch's size, 0.1 with 16 landmarks or more")
      ->check(number_in(0, 100))
      ->capture_default_str();
}

}  // namespace

void add_register(CLI::App& app) {
  auto* command = add_command(
      app, "register", "a regular grid laid on a 3D scan of a swatch, or on each of a sequence");
  auto arguments = std::make_shared<RegisterArguments>();
  command
      ->add_option("scan", arguments->scan,
                   "mesh or points: .ply, .obj, .xyz, .txt, .pts or .csv; for a sequence a folder "
                   "of these, a .pcseq, or a .csv with a column frame")
      ->required();
  command->add_option("--swatch", arguments->swatch, "WIDTHxHEIGHT along u and v, m, 0.001 to 10")
      ->required();
  command->add_option("--out", arguments->out, "folder for the results")->required();
  command->add_option("--grid", arguments->grid, "vertices along the longer side, 3 to 401")
      ->check(integer_in(3, 401))
      ->capture_default_str();
  command->add_option("--unit", arguments->unit, "m per unit of the scan's coordinates")
      ->check(number_in(1e-9, 1e6))
      ->capture_default_str();
  add_start_options(*command, *arguments);
  add_print_options(*command, *arguments);
  add_fit_options(*command, *arguments);
  add_threads(*command, arguments->options.threads);
  command->add_flag("--overwrite", arguments->overwrite, "replace the results of another run");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer("Example:\n  weft register scan.ply --swatch 0.5x0.5 --out registered");
  command->callback([arguments, command] {
    refuse_without(*command, "--held", {"--gravity"});
    refuse_without(*command, "--stamp", {"--stamp-origin"});
    refuse_beside(*command, "--start", {"--gravity", "--u-axis", "--v-axis"});
    arguments->axes_given = command->count("--u-axis") + command->count("--v-axis") > 0;
    run_register(*arguments);
  });
}

}  // namespace weft::app
