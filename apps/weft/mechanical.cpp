#include "mechanical.h"

#include <fmt/core.h>

#include <cmath>
#include <numbers>

#include "report_of_fit.h"
#include "weft/base/error.h"

namespace weft::app {
namespace {

void add_differences(nlohmann::json& object, int force_count, double force_rms, int point_count,
                     const SurfaceDistance& distance, const PoseDistance& pose) {
  if (force_count > 0) object["force_rms"] = json_number(force_rms);
  if (point_count > 0) add_distance(object, distance);
  if (pose.count > 0)
    object["pose"] = {{"position_rms", json_number(pose.position_rms)},
                      {"rotation_rms", json_number(pose.rotation_rms)}};
}

/// What pulls a loaded clip.
std::string load_words(const MechanicalFixture& fixture) {
  std::string text = fmt::format("not held, {:g} g", 1e3 * fixture.mass);
  for (const FixtureCord& cord : fixture.cords) {
    const double most =
        cord.pulley ? cord.tensions.maxCoeff() : cord.forces.colwise().norm().maxCoeff();
    text += fmt::format(", a cord{} of up to {:.4g} N", cord.pulley ? " to a pulley" : "", most);
  }
  return text;
}

void print_fixture(const MechanicalFixture& fixture) {
  const Clip& first = fixture.frames.front();
  double most = 0;
  for (Eigen::Index k = 0; k < fixture.forces.cols(); ++k) {
    const Vec3 force = fixture.forces.col(k);
    most = std::max(most, force.array().isNaN().select(Vec3::Zero(), force).norm());
  }
  fmt::print(
      "fixture     {}: holds ({:g}, {:g}) to ({:g}, {:g}) m, starts at ({:.4f}, {:.4f}, {:.4f}) "
      "m, ",
      fixture.name, first.region.lower.x(), first.region.lower.y(), first.region.upper.x(),
      first.region.upper.y(), first.position.x(), first.position.y(), first.position.z());
  if (fixture.loaded())
    fmt::print("{}\n", load_words(fixture));
  else if (fixture.forces.cols() > 0)
    fmt::print("force up to {:.4g} N\n", most);
  else
    fmt::print("no force\n");
}

}  // namespace

namespace {

void print_overhang(const OverhangTest& test) {
  fmt::print(
      "overhang    {} reading{}, {:.4g} to {:.4g} m, mean {:.4g} m, at {:.4g} degrees below the "
      "horizontal; standard deviation of one {:.2g} m\n",
      test.lengths.size(), test.lengths.size() == 1 ? "" : "s", test.lengths.minCoeff(),
      test.lengths.maxCoeff(), test.lengths.mean(), test.angle * 180 / std::numbers::pi,
      test.deviation);
}

nlohmann::json overhang_json(const OverhangDifference& overhang) {
  return {{"measured", overhang.measured},
          {"computed", json_number(overhang.computed)},
          {"difference", json_number(overhang.computed - overhang.measured)},
          {"rms", json_number(overhang.rms)}};
}

}  // namespace

std::shared_ptr<MechanicalStore> open_mechanical_store(const MechanicalFitArguments& arguments,
                                                       const std::string& fingerprint) {
  const std::filesystem::path out = arguments.out;
  if (arguments.existing == Existing::overwrite) remove_earlier_fit(out, {kMechanicalStoreName});
  return std::make_shared<MechanicalStore>(out / kMechanicalStoreName,
                                           fmt::format("{} by " WEFT_VERSION, fingerprint));
}

nlohmann::json json_number(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

void add_distance(nlohmann::json& object, const SurfaceDistance& distance) {
  object["distance_mean"] = json_number(distance.mean);
  object["distance_rms"] = json_number(distance.rms);
  object["distance_max"] = json_number(distance.max);
}

void MechanicalArguments::add_to(CLI::App& command) {
  command
      .add_option(
          "--cells", cells_,
          "mechanical captures, scans: cells of the mesh across the shortest free side (scans: "
          "without it the grid that was registered)")
      ->check(integer_in(2, 200))
      ->capture_default_str();
}

MechanicalOptions MechanicalArguments::options() const {
  MechanicalOptions options;
  options.cells = cells_;
  return options;
}

const std::vector<std::string>& MechanicalArguments::names() {
  static const std::vector<std::string> names{"--cells"};
  return names;
}

const std::vector<std::string>& video_option_names() {
  static const std::vector<std::string> names{"--grid",         "--steps-per-frame", "--integrator",
                                              "--alpha",        "--fold-threshold",  "--cache",
                                              "--start-surface"};
  return names;
}

void check_mechanical(const std::string& folder) {
  const MechanicalCapture capture = read_mechanical_capture(folder);
  fmt::print("capture     {} (mechanical)\n", capture.name);
  if (!capture.description.empty()) fmt::print("            {}\n", capture.description);
  fmt::print("swatch      {:g} x {:g} m, {:g} kg/m^2, u of the fabric at {:g} degrees\n",
             capture.width, capture.height, capture.areal_density,
             capture.grain_angle * 180 / std::numbers::pi);
  fmt::print("frames      {}\n", capture.frame_count);
  if (capture.drive == ClipDrive::cords)
    fmt::print("drive       cords; a fit finds their friction\n");
  if (capture.clip_noise > 0)
    fmt::print("clips       known to {:g} m; a fit weighs forces with it\n", capture.clip_noise);
  if (const auto& bars = capture.picture_frame)
    fmt::print("bars        {:g} m, hinged; shear from {:.4g} to {:.4g} degrees\n", bars->side,
               bars->shear.minCoeff() * 180 / std::numbers::pi,
               bars->shear.maxCoeff() * 180 / std::numbers::pi);
  if (capture.overhang) print_overhang(*capture.overhang);
  for (const MechanicalFixture& fixture : capture.fixtures) print_fixture(fixture);
  if (capture.geometry) {
    fmt::print("shape       {} points\n", read_geometry(capture).mesh.vertex_count());
  } else {
    fmt::print("shape       not measured\n");
  }
  fmt::print("truth       {}\n", capture.truth ? "declared; never read by a fit" : "none");
  fmt::print("ok\n");
}

nlohmann::json mechanical_json(const MechanicalEvaluation& evaluation) {
  nlohmann::json frames = nlohmann::json::array();
  for (const MechanicalDifference& frame : evaluation.frames) {
    nlohmann::json object = {{"frame", frame.frame},
                             {"converged", frame.converged},
                             {"net_force", json_number(frame.residual)}};
    add_differences(object, frame.force_count, frame.force_rms, frame.point_count, frame.distance,
                    frame.pose);
    if (evaluation.overhang) object["overhang_difference"] = json_number(frame.overhang);
    frames.push_back(object);
  }
  nlohmann::json object = {
      {"kind", "mechanical"}, {"frames", frames}, {"not_converged", evaluation.not_converged}};
  add_differences(object, evaluation.force_count, evaluation.force_rms, evaluation.point_count,
                  evaluation.distance, evaluation.pose);
  if (evaluation.overhang) object["overhang"] = overhang_json(*evaluation.overhang);
  if (evaluation.force_count > 0) {
    object["force_relative"] = json_number(evaluation.force_relative);
    object["force_largest"] = json_number(evaluation.largest_force);
  }
  return object;
}

std::string summary(const MechanicalEvaluation& evaluation) {
  std::string text;
  if (evaluation.force_count > 0)
    text =
        fmt::format("force {:.3g} N rms, {:.2f} % of the largest, {:.4g} N", evaluation.force_rms,
                    100 * evaluation.force_relative, evaluation.largest_force);
  if (evaluation.point_count > 0)
    text += fmt::format("{}distance mean {:.3f}, rms {:.3f}, max {:.2f} mm",
                        text.empty() ? "" : "; ", 1e3 * evaluation.distance.mean,
                        1e3 * evaluation.distance.rms, 1e3 * evaluation.distance.max);
  if (evaluation.pose.count > 0)
    text += fmt::format("{}pose {:.4f} mm, {:.3f} mrad rms", text.empty() ? "" : "; ",
                        1e3 * evaluation.pose.position_rms, 1e3 * evaluation.pose.rotation_rms);
  if (const auto& overhang = evaluation.overhang)
    text +=
        std::isfinite(overhang->computed)
            ? fmt::format("{}overhang {:.2f} mm, measured {:.2f} mm, difference {:.2f} mm",
                          text.empty() ? "" : "; ", 1e3 * overhang->computed,
                          1e3 * overhang->measured, 1e3 * (overhang->computed - overhang->measured))
            : fmt::format("{}no overhang at the angle, measured {:.2f} mm",
                          text.empty() ? "" : "; ", 1e3 * overhang->measured);
  return text.empty() ? "nothing was measured" : text;
}

void add_cost_options(CLI::App& command, MechanicalFitArguments& arguments) {
  command
      .add_option(
          "--residuals", arguments.residuals,
          "mechanical captures: what is compared; auto: forces between clips, points where "
          "one clip holds the cloth; stretch-points: as auto, and beside the forces of tests "
          "of stretch points, which with clip_noise say where the clips are; poses of clips "
          "that known forces pull and overhangs always are")
      ->check(CLI::IsMember({"auto", "forces", "points", "both", "stretch-points"}))
      ->capture_default_str();
  command
      .add_option("--force-noise", arguments.force_noise,
                  "mechanical captures: standard deviation of a force component, N")
      ->check(number_in(1e-9, 1e3))
      ->capture_default_str();
  command
      .add_option(
          "--point-noise", arguments.point_noise,
          "mechanical captures: standard deviation of a coordinate, m, also of a pulled clip "
          "in a capture without clip_noise")
      ->check(number_in(1e-9, 1))
      ->capture_default_str();
  command
      .add_option("--cord-friction", arguments.cord_friction,
                  "mechanical captures: the friction of the cords that pull the clips, one number "
                  "a capture, found with the fabric; auto: of captures with drive = \"cords\"; "
                  "fit: of all; none")
      ->check(CLI::IsMember({"auto", "fit", "none"}))
      ->capture_default_str();
}

const std::vector<std::string>& cost_option_names() {
  static const std::vector<std::string> names{"--residuals", "--force-noise", "--point-noise",
                                              "--cord-friction"};
  return names;
}

std::vector<std::shared_ptr<const MechanicalTrial>> prepare_tests(
    const MechanicalFitArguments& arguments) {
  std::vector<std::shared_ptr<const MechanicalTrial>> trials;
  for (const std::string& folder : arguments.captures)
    trials.push_back(prepare_mechanical(read_mechanical_capture(folder), arguments.options));
  return trials;
}

bool acts_at_rest(std::string_view name) {
  return !name.ends_with("_damping") && !name.starts_with("drag_");
}

std::vector<std::string> names_at_rest(const Fabric& fabric) {
  std::vector<std::string> names = fabric.value_names();
  std::erase_if(names, [](const std::string& name) { return !acts_at_rest(name); });
  return names;
}

MechanicalCostOptions cost_options(const MechanicalFitArguments& arguments) {
  MechanicalCostOptions cost;
  cost.residuals = mechanical_residuals_from_name(arguments.residuals);
  cost.cord_friction = cord_friction_from_name(arguments.cord_friction);
  cost.force_noise = arguments.force_noise;
  cost.point_noise = arguments.point_noise;
  return cost;
}

void add_cord_friction(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                       const std::vector<CordFrictionEstimate>& found, MechanicalFrames& frames) {
  for (const CordFrictionEstimate& friction : found)
    weft::add_cord_friction(*trials[friction.trial], friction.interval.value, least_clip_way,
                            frames[friction.trial]);
}

nlohmann::json cord_friction_json(const std::vector<CordFrictionEstimate>& found, std::size_t i) {
  for (const CordFrictionEstimate& friction : found)
    if (friction.trial == i)
      return {{"value", friction.interval.value},
              {"interval_lower", json_number(friction.interval.lower)},
              {"interval_upper", json_number(friction.interval.upper)},
              {"determined", friction.interval.determined}};
  return nullptr;
}

std::string cord_friction_lines(const std::vector<CordFrictionEstimate>& found) {
  std::string text;
  for (const CordFrictionEstimate& friction : found) {
    const ParameterInterval& p = friction.interval;
    const std::string certainty = p.determined ? fmt::format("{:.3g} to {:.3g} N", p.lower, p.upper)
                                               : "not determined by the data";
    text += fmt::format("{}: friction of the cords {:.3g} N, {}\n", p.name, p.value, certainty);
  }
  return text;
}

std::string complaints(const MechanicalEvaluation& evaluation) {
  std::string text;
  for (const MechanicalDifference& frame : evaluation.frames)
    if (!frame.converged)
      text += fmt::format("frame {}: no equilibrium, a net force of {:.2g} N is left\n",
                          frame.frame, frame.residual);
  return text;
}

}  // namespace weft::app
