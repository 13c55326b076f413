#pragma once
/// What the subcommands do with mechanical captures (kind = "mechanical").
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "options.h"
#include "weft/estimate/curve_fit.h"
#include "weft/estimate/mechanical_trial.h"

namespace weft::app {

/// How a mechanical capture is computed.
class MechanicalArguments {
 public:
  void add_to(CLI::App& command);
  MechanicalOptions options() const;
  /// Options of `command` that only mean something for mechanical captures.
  static const std::vector<std::string>& names();

 private:
  int cells_ = MechanicalOptions().cells;
};

/// Options of TrialArguments that only mean something for videos.
const std::vector<std::string>& video_option_names();

void check_mechanical(const std::string& folder);

/// JSON has no infinity: null for what is not finite.
nlohmann::json json_number(double value);
/// distance_mean, distance_rms, distance_max.
void add_distance(nlohmann::json& object, const SurfaceDistance& distance);

nlohmann::json mechanical_json(const MechanicalEvaluation& evaluation);
/// One line: force and distances over all frames.
std::string summary(const MechanicalEvaluation& evaluation);
/// Adds the friction of the cords to the computed forces of the captures that have it, so that they
/// are what was measured. `frames`: of each of `trials`.
void add_cord_friction(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                       const std::vector<CordFrictionEstimate>& found, MechanicalFrames& frames);
/// "cord_friction" of the entry of capture `i`: value and interval; null where none was fitted.
nlohmann::json cord_friction_json(const std::vector<CordFrictionEstimate>& found, std::size_t i);
/// One line a capture, for the terminal.
std::string cord_friction_lines(const std::vector<CordFrictionEstimate>& found);
/// Frames without equilibrium, one line each, for the terminal; empty where there are none.
std::string complaints(const MechanicalEvaluation& evaluation);

struct MechanicalFitArguments {
  std::vector<std::string> captures;
  std::string out;
  std::string initial;
  std::string model = "stvk";
  std::string start = "initial";
  std::string name;
  std::vector<std::string> include;  ///< optional terms
  std::vector<std::string> parameters;
  std::string residuals = "auto";
  double force_noise = 3e-3;
  double point_noise = 75e-6;
  std::string cord_friction = "auto";
  MeshError mesh_error = MeshError::included;
  std::uint64_t seed = 1;
  Existing existing = Existing::refuse;
  int threads = 0;
  MechanicalOptions options;
  std::optional<CurveFitOptions> curves;  ///< `parameters` are rows then
};
/// --residuals, --force-noise, --point-noise, --cord-friction, and their names: what is compared.
void add_cost_options(CLI::App& command, MechanicalFitArguments& arguments);
const std::vector<std::string>& cost_option_names();
/// Without priors.
MechanicalCostOptions cost_options(const MechanicalFitArguments& arguments);
/// Reads and prepares the captures.
std::vector<std::shared_ptr<const MechanicalTrial>> prepare_tests(
    const MechanicalFitArguments& arguments);
/// Parameters that act on cloth at rest: all values but damping and drag.
bool acts_at_rest(std::string_view name);
std::vector<std::string> names_at_rest(const Fabric& fabric);
void run_mechanical_fit(const MechanicalFitArguments& arguments);

/// In the output folder, what a fit that takes mechanical captures continues from.
inline constexpr const char* kMechanicalStoreName = "mechanical_evaluations.sqlite";
/// Opens it for a fit of this fit_fingerprint(), as this version of the program makes it, in the
/// place of an earlier fit where that is to be overwritten. Throws Error if it holds evaluations of
/// another.
std::shared_ptr<MechanicalStore> open_mechanical_store(const MechanicalFitArguments& arguments,
                                                       const std::string& fingerprint);

}  // namespace weft::app
