/// Targets that other programs made.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <map>

#include "scan_validation.h"
#include "source_lattice.h"
#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/capture/mechanical_capture.h"
#include "weft/fabric/orthotropic.h"

namespace weft {
namespace {

struct TestFrames {
  const char* test;
  std::vector<int> frames;
};
/// Some frames of each test: the cloth taut, turned, hanging.
const std::vector<TestFrames> kTests{{"stretch_u", {4, 8, 12}},
                                     {"stretch_v", {4, 8, 12}},
                                     {"shear", {1, 5, 9}},
                                     {"bend_u", {6, 12}},
                                     {"bend_v", {6, 12}}};
constexpr double kPointNoise = 75e-6;  // m, of what the program takes of mechanical captures
constexpr double kForceNoise = 3e-3;   // N

/// One test as a capture of scans, a frame a target. Poses are not told: a bar is where its points
/// are.
ScanCapture as_scans(const MechanicalCapture& from, const std::vector<int>& frames,
                     std::vector<ScanShape>& shapes) {
  const MeasuredGeometry geometry = read_geometry(from);
  ScanCapture capture;
  capture.name = from.name;
  capture.width = from.width;
  capture.height = from.height;
  capture.areal_density = from.areal_density;
  capture.grain_angle = from.grain_angle;
  for (const int frame : frames) {
    ScanTarget target;
    target.name = fmt::format("{} {}", from.name, frame);
    target.noise = kPointNoise;
    target.gravity = from.gravity;
    for (const MechanicalFixture& fixture : from.fixtures) {
      ScanClamp clamp;
      clamp.name = fixture.name;
      clamp.kind = ClampKind::bar;
      clamp.region = fixture.frames[static_cast<std::size_t>(frame)].region;
      if (from.fixtures.size() > 1) clamp.force = fixture.forces.col(frame).norm();
      clamp.force_noise = kForceNoise;
      target.clamps.push_back(clamp);
    }
    capture.targets.push_back(target);
    shapes.push_back({geometry.mesh,
                      geometry.frames[static_cast<std::size_t>(frame)],
                      VecX::Ones(geometry.mesh.vertex_count()),
                      {}});
  }
  return capture;
}

Fabric true_fabric(const std::filesystem::path& path) {
  const TomlTable file = TomlTable::parse_file(path);
  const TomlTable a = file.table("membrane"), d = file.table("bending");
  const Range any{0, 1e6};
  Fabric fabric = Fabric::with_defaults("truth", "stvk");
  fabric.set("membrane_uu", a.number("A11", any));
  fabric.set("membrane_uv", a.number("A12", any));
  fabric.set("membrane_vv", a.number("A22", any));
  fabric.set("membrane_shear", a.number("A66", any));
  fabric.set("bend_uu", d.number("D11", any));
  fabric.set("bend_uv", d.number("D12", any));
  fabric.set("bend_vv", d.number("D22", any));
  fabric.set("bend_twist", d.number("D66", any));
  return fabric;
}

void print_bending(const Fabric& found, const Fabric& truth) {
  for (const char* name : {"bend_uu", "bend_uv", "bend_vv", "bend_twist"})
    fmt::print("  {:<11} {:>11.5g} N m, true {:>11.5g}, error {:8.2f} %\n", name, found.value(name),
               truth.value(name), 100 * (found.value(name) / truth.value(name) - 1));
}

void fit_mechanical_fabric(const Arguments& arguments, const std::string& name) {
  std::vector<std::shared_ptr<const ScanTrial>> trials;
  ScanOptions options;
  options.cells = arguments.cells;
  options.descriptor = arguments.descriptor;
  for (const TestFrames& test : kTests) {
    std::vector<ScanShape> shapes;
    const MechanicalCapture from =
        read_mechanical_capture(arguments.data / "mechanical" / (name + "_" + test.test));
    const ScanCapture capture = as_scans(from, test.frames, shapes);
    for (const auto& trial : prepare_scan(capture, shapes, options)) trials.push_back(trial);
  }
  const Fabric truth =
      true_fabric(arguments.data / "mechanical" / (name + "_shear") / "truth/parameters.toml");
  // Wrong by factors of 2 and 3, with one rigidity in all directions.
  OrthotropicModuli wrong = moduli_of(stiffness_of(truth));
  wrong.e_u *= 2;
  wrong.e_v *= 0.5;
  wrong.shear *= 2;
  wrong.poisson = 0.1;
  wrong.b *= 3;
  Fabric start = orthotropic_fabric("start", stiffness_of(wrong));
  start.set("bend_uv", 0.1 * wrong.b);  // counts only where it is searched
  std::vector<std::vector<std::string>> sets{default_scan_parameters(start)};
  sets.push_back({"membrane_uu", "membrane_vv", "membrane_uv", "membrane_shear", "bend_uu",
                  "bend_vv", "bend_uv", "bend_twist"});
  for (const auto& free : sets) {
    fmt::print("\n{}: {} targets on {} cells, {} unknowns\n", name, trials.size(), arguments.cells,
               free.size());
    const ScanProblem problem(trials, arguments.make_solver(), start, free);
    if (free.size() > 5) print_targets(problem, truth, "at the truth");
    const ScanFitResult fit = fit_scan(problem, start, arguments.with_mesh_error());
    print_fit(problem, fit, &truth);
    print_bending(fit.fabric, truth);
    print_targets(problem, fit.fabric, "at the estimate");
  }
}

/// The shape of a static video capture's true surface at its last frame, or of its control points.
Points rest_of(const Capture& from, const TruthSurface& truth, validation::SourceSurface surface) {
  const Points& shown = truth.frames.back();
  if (surface == validation::SourceSurface::shown) return shown;
  Points control = validation::LimitSurface(validation::grid_of(from, truth.mesh)).control(shown);
  const auto apart = (control - shown).colwise().norm();
  fmt::print("{}: control points {:.2f} mm from the surface in the mean, {:.2f} at most\n",
             from.name, 1e3 * apart.mean(), 1e3 * apart.maxCoeff());
  return control;
}

/// That shape as a target.
void add_rest(const Capture& from, const Arguments& arguments,
              std::vector<std::shared_ptr<const ScanTrial>>& trials) {
  const TruthSurface truth = read_truth(from);
  ScanCapture capture;
  capture.name = from.name;
  capture.width = from.width;
  capture.height = from.height;
  capture.areal_density = from.areal_density;
  capture.hem_width = from.hem_width;
  ScanTarget target;
  target.name = fmt::format("{} {}", from.name, from.frame_count - 1);
  target.gravity = from.gravity;
  for (const CaptureFixture& fixture : from.fixtures) {
    ScanClamp clamp;
    clamp.name = fixture.name;
    clamp.kind = ClampKind::points;
    clamp.region = {fixture.at, fixture.at};
    target.clamps.push_back(clamp);
  }
  capture.targets = {target};
  const ScanShape shape{truth.mesh,
                        rest_of(from, truth, arguments.surface),
                        VecX::Ones(truth.mesh.vertex_count()),
                        {}};
  ScanOptions options;
  options.cells = arguments.cells;
  options.pattern = arguments.pattern;
  options.descriptor = arguments.descriptor;
  trials.push_back(prepare_scan(capture, std::vector<ScanShape>{shape}, options).front());
}

/// What the source's lattice is as a sheet with both diagonals taut (its note): C11 = k + k_d, C12
/// = k_d, shear k_d.
Fabric continuum(const validation::Constants& c) {
  return orthotropic_fabric(
      "continuum", {c.edge + c.diagonal, c.edge + c.diagonal, c.diagonal, c.diagonal, c.bending});
}

/// The same as threads with diagonals that act in tension only; k_d is a spring on each of two
/// diagonals h sqrt(2) long, 2 k_d per width. `own_twist`: with what the hinges along the diagonals
/// resist twist by, 4/3 of an isotropic plate's.
Fabric with_diagonals(const validation::Constants& c, const std::string& model, bool own_twist) {
  Fabric fabric = Fabric::with_defaults("lattice", model);
  fabric.set("stretch_stiffness", c.edge);
  fabric.set("diagonal_stiffness", 2 * c.diagonal);
  fabric.set("bend_stiffness", c.bending);
  fabric.set("shear_stiffness", 0.01);  // the least
  if (own_twist) {
    fabric.include("twist_stiffness");
    fabric.set("twist_stiffness", 4. / 3 * c.bending);
  }
  return fabric;
}

void fit_rest(const Arguments& arguments,
              const std::vector<std::shared_ptr<const ScanTrial>>& trials, const Fabric& source,
              const Fabric& wrong, const std::vector<std::string>& free) {
  const ScanProblem problem(trials, arguments.make_solver(), source, free);
  print_targets(problem, source, "at the source's values");
  for (const Fabric& from : {source, wrong}) {
    fmt::print("{} from {}\n", from.model, from.name);
    const ScanFitResult fit = fit_scan(problem, from, arguments.with_mesh_error());
    print_fit(problem, fit, &source);
    print_targets(problem, fit.fabric, "at the estimate");
  }
}

}  // namespace

void mechanical_scans(const Arguments& arguments) {
  for (const std::string& name :
       arguments.fabrics.empty() ? std::vector<std::string>{"knit", "blend"} : arguments.fabrics)
    fit_mechanical_fabric(arguments, name);
}

void capture_scans(const Arguments& arguments) {
  for (const std::string& name : arguments.fabrics.empty()
                                     ? std::vector<std::string>{"cotton", "denim", "silk"}
                                     : arguments.fabrics) {
    std::vector<std::shared_ptr<const ScanTrial>> trials;
    const Capture capture = read_capture(arguments.data / "captures" / (name + "_static_1"));
    add_rest(capture, arguments, trials);
    const validation::Constants constants = validation::read_constants(capture);
    const Fabric source = continuum(constants);
    OrthotropicModuli wrong = moduli_of(stiffness_of(source));
    wrong.e_u *= 2;
    wrong.e_v *= 0.5;
    wrong.shear *= 0.5;
    wrong.poisson = 0.2;
    wrong.b *= 3;
    const Fabric start = orthotropic_fabric("start", stiffness_of(wrong));
    fmt::print("\n{}: {} targets on {} cells\n", name, trials.size(), arguments.cells);
    if (capture.hem_width == 0)  // a sheet has none
      fit_rest(arguments, trials, source, start, default_scan_parameters(source));
    const Fabric threads =
        with_diagonals(constants, arguments.thread_model, arguments.search_twist);
    if (!arguments.make_solver()->takes(threads.model)) continue;
    Fabric off = threads;
    off.name = "start";
    off.set("stretch_stiffness", 2 * threads.value("stretch_stiffness"));
    off.set("diagonal_stiffness", 0.5 * threads.value("diagonal_stiffness"));
    off.set("bend_stiffness", 3 * threads.value("bend_stiffness"));
    std::vector<std::string> free{"stretch_stiffness", "diagonal_stiffness", "bend_stiffness"};
    if (arguments.search_twist) {
      off.set("twist_stiffness", off.value("bend_stiffness"));
      free.emplace_back("twist_stiffness");
    }
    fit_rest(arguments, trials, threads, off, free);
  }
}

}  // namespace weft
