#pragma once
/// What the subcommands do with scans (kind = "scan").
#include <CLI/App.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "options.h"
#include "weft/estimate/scan_fit.h"

namespace weft::app {

/// How a scan is computed and compared.
class ScanArguments {
 public:
  void add_to(CLI::App& command);
  /// `command`: whose --cells, an option of mechanical captures too, counts where it was given.
  ScanOptions options(const CLI::App& command, int threads) const;
  std::shared_ptr<const EquilibriumSolver> solver() const;
  /// Of the evaluations that tell what the width of the cells does: the static solver, as XPBD
  /// takes long on fine meshes; null where it is solver() already.
  std::shared_ptr<const EquilibriumSolver> mesh_solver() const;
  /// Options that only mean something for scans.
  static const std::vector<std::string>& names();

 private:
  std::string descriptor_ = "fourier";
  int registered_cells_ = RawScanOptions().cells;
  std::string solver_ = "static";
  std::string pattern_ = "alternating";
};

/// How raw scans were registered: a line each, and as JSON (an object; null for a target that came
/// registered).
std::string registration_summary(const ScanTrial& trial);
nlohmann::json registration_json(const ScanTrial& trial);

void check_scan(const std::string& folder);
/// Throws Error for --registered-cells where no target of the captures is a raw scan.
void check_registered_cells(const CLI::App& command, const std::vector<ScanCapture>& captures);
void evaluate_scan(const ScanCapture& capture, const std::string& fabric,
                   const ScanOptions& options, const EquilibriumSolver& solver, bool json,
                   int threads);

/// Of each target its differences.
nlohmann::json scan_json(const std::vector<std::shared_ptr<const ScanTrial>>& trials,
                         const std::vector<ScanDifference>& differences);
/// A line a target.
std::string scan_summary(const ScanTrial& trial, const ScanDifference& difference);

struct ScanFitArguments {
  std::vector<std::string> captures;
  std::string out, model, initial, name;
  std::vector<std::string> include;     ///< optional terms
  std::vector<std::string> parameters;  ///< empty: default_scan_parameters()
  std::string schedule = "together";
  std::string balance = "residual";
  int rounds = ScanFitOptions().rounds;
  int random_starts = ScanFitOptions().random_starts;
  MeshError mesh_error = MeshError::included;
  std::uint64_t seed = 1;
  Existing existing = Existing::refuse;
  int threads = 0;
  ScanOptions options;
  std::shared_ptr<const EquilibriumSolver> solver;
  std::shared_ptr<const EquilibriumSolver> mesh_solver;  ///< as in ScanFitOptions

  void add_to(CLI::App& command);
  /// --balance alone.
  void add_balance_to(CLI::App& command);
  static const std::vector<std::string>& names();
};
/// Reads and prepares the captures: their targets.
std::vector<std::shared_ptr<const ScanTrial>> prepare_scans(const ScanFitArguments& arguments);
void run_scan_fit(const ScanFitArguments& arguments);

}  // namespace weft::app
