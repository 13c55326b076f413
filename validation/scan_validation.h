#pragma once
/// What the parts of weft_validate_scan share.
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "source_lattice.h"
#include "weft/estimate/scan_fit.h"
#include "weft/estimate/scan_synthetic.h"

namespace weft {

struct Arguments {
  std::vector<std::string> parts;
  int cells = 24, fine = 64;
  double force_noise = 0.01;                        ///< N, of the part "noise"
  std::uint64_t seed = 1;                           ///< of its noise
  GridPattern pattern = GridPattern::alternating;   ///< of the fit
  GridPattern fine_pattern = GridPattern::uniform;  ///< of what makes the targets
  DescriptorKind descriptor = DescriptorKind::fourier;
  validation::SourceSurface surface = validation::SourceSurface::shown;
  std::filesystem::path out;  ///< captures are kept here
  std::filesystem::path data;
  std::vector<std::string> fabrics;  ///< empty: all
  bool search_twist = false;         ///< twist_stiffness of the part "captures", beside bend's
  std::string thread_model = "baraff-witkin-diagonals";
  ScanFitOptions fit;
  std::string solver = "static";
  /// Of the fits whose intervals are shown.
  ScanFitOptions with_mesh_error() const {
    ScanFitOptions options = fit;
    options.mesh_error = MeshError::included;
    if (solver != "static") options.mesh_solver = make_static_solver();
    return options;
  }
  std::shared_ptr<const EquilibriumSolver> make_solver() const {
    if (solver == "xpbd") return make_xpbd_solver();
    return make_static_solver();
  }
  bool has(const std::string& part) const {
    return std::find(parts.begin(), parts.end(), part) != parts.end();
  }
};

/// Errors against the truth, unless it is null, and intervals, of the noise alone and with what the
/// width of the cells does.
void print_fit(const ScanProblem& problem, const ScanFitResult& fit, const Fabric* truth);
void print_targets(const ScanProblem& problem, const Fabric& fabric, const char* name);

/// Frames of mechanical captures as scans with magnitudes of force.
void mechanical_scans(const Arguments& arguments);
/// Shapes at rest of the true surfaces of video captures.
void capture_scans(const Arguments& arguments);

/// Which descriptor separates materials from states, and fits from other states with each.
void descriptors(const Arguments& arguments);

}  // namespace weft
