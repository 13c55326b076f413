#pragma once
/// Capture folders of kind "scan" with known truth: experiments that are computed on a mesh finer
/// than a fit's, seen with noise, as registered grids or as clouds of points.
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "weft/capture/scan_capture.h"
#include "weft/estimate/scan_synthetic.h"
#include "weft/registration/scan.h"

namespace weft {

enum class SyntheticScanForm {
  registered,  ///< grids, with (u, v)
  clouds,      ///< points, and where the clamps have the fabric
};

/// How a surface is seen.
struct CloudOptions {
  int points = 20000;      ///< on the cloth, evenly over (u, v), >= 100
  double noise = 2e-4;     ///< m, normal, of each coordinate, >= 0
  double outliers = 0.02;  ///< share of the points that lie anywhere in the box about the cloth,
                           ///< 5 cm wider than it on each side; 0 to 0.5
  double hole = 0;         ///< m, radius in (u, v) of a hole about (0.6 width, 0.45 height), >= 0
  std::uint64_t seed = 1;
};
/// Points of a deformed mesh over [0, width] x [0, height], m. Throws Error for options out of
/// range and for a hole that leaves no points.
Scan sample_cloud(const TriangleMesh& mesh, const Points& x, double width, double height,
                  const CloudOptions& options = {});

struct SyntheticScanOptions {
  double width = 0.15, height = 0.15;  ///< m, 0.01 to 10
  double areal_density = 0.2;          ///< kg/m^2
  int registered_cells = 24;           ///< of the grid that is written, across the shorter side
  int refinement = 2;                  ///< cells of the truth in each of them, along each axis
  double noise = 2e-4;                 ///< m, of a coordinate; 0: a perfect scan
  double force_noise = 0.01;           ///< N; 0: perfect forces
  SyntheticScanForm form = SyntheticScanForm::registered;
  CloudOptions cloud;  ///< its points, outliers and hole
  std::uint64_t seed = 1;
};

/// An experiment by its name, on a swatch of width x height (m):
///
///   frame:DEGREES            picture_frame, -60 to 60
///   stretch-u:STRAIN         edge_stretch, 0 to 0.5; stretch-v
///   corners:LEFT,RIGHT[,S]   corner_weights, kg, 0 to 10; separation S 0.2 to 1, 0.95 if not given
///   edge-u:WEIGHT            edge_weight, kg, 0 to 10, clamps a tenth of the side deep; edge-v
///   ledge-u:SUPPORT          ledge, m, above 0 and below the side; ledge-v
///
/// Borders of clamps are put on lines `cell` apart (along u, v), m, at least one from the rim: a
/// grid of these cells, or of parts of them, then holds the clamp as it is. Throws Error for
/// anything else.
ScanExperiment scan_experiment(const std::string& text, double width, double height,
                               const Vec2& cell);
/// The four targets of Larionov et al. 2022, section 5, as weft's studies have them.
const std::vector<std::string>& default_scan_experiments();

/// Writes DIR/capture.toml, the scans and truth/fabric.toml; returns what reads back. Shapes are of
/// the static solver on a uniform grid of `registered_cells` times `refinement` cells; grids hold
/// every vertex of it that they share. Noise that is 0 is stated as 1e-6 m and 1e-4 N. A cloud has
/// as landmarks its clamps: 9 points along each of their sides, with the noise of the cloud. Throws
/// Error for options out of range, a fabric that the static solver does not take, and an experiment
/// without equilibrium.
ScanCapture make_synthetic_scans(const std::filesystem::path& folder, const Fabric& fabric,
                                 const std::vector<std::string>& experiments,
                                 const SyntheticScanOptions& options = {});

}  // namespace weft
