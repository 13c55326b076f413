#pragma once
/// A scanned shape made ready to be computed: the mesh that is simulated, what is held of it and
/// where, and the descriptor by which simulation and scan are compared.
#include <memory>
#include <optional>
#include <vector>

#include "weft/capture/capture.h"
#include "weft/capture/scan_capture.h"
#include "weft/dynamics/held_equilibrium.h"
#include "weft/estimate/raw_scan.h"
#include "weft/objective/shape_descriptor.h"

namespace weft {

struct ScanOptions {
  /// Cells of the simulated grid across the shorter side of the swatch, 2 to 200; where bars that
  /// hold an area are all that holds the cloth, across the shortest free side, finer beside the
  /// bars (mechanical_trial.h). 0: the grid that was registered, which then must be one.
  int cells = 0;
  /// How its quads are split. Where all diagonals run alike, folds across them lock.
  GridPattern pattern = GridPattern::alternating;
  DescriptorKind descriptor = DescriptorKind::fourier;
  RawScanOptions raw{};  ///< of targets without a registered grid
};

/// One target.
///
/// Held: vertices in a clamp's region, each by the first clamp that has it. A bar is rigid: its
/// vertices are at the rigid motion of the flat region that is nearest to the scan's vertices in it
/// (least squares, Kabsch 1976), which averages their noise. Other clamps hold each vertex where
/// the scan has it. What is left of the noise is in `clamp_errors`.
struct ScanTrial {
  ScanTarget target;
  ScanShape shape;
  std::optional<ScanRegistration> registration;  ///< that gave `shape`, of a raw scan
  double areal_density = 0;                      ///< kg/m^2
  double grain_angle = 0;                        ///< rad
  double hem_width = 0;                          ///< m

  TriangleMesh mesh;          ///< simulated
  GridPattern pattern{};      ///< how its quads are split
  std::vector<int> clamp_of;  ///< a number a vertex, -1: free
  std::vector<char> held;
  Points start;  ///< m; at the scan, or where the target says, with the held vertices in place
  /// By how much the scan's noise leaves open where the held vertices are: a column for each
  /// independent error, one standard deviation of it, m; 3 vertices x errors. Of bars the errors of
  /// their poses, six each (of vertices on one line five), which bars that meet share; of other
  /// clamps those of the scan's vertices that they are held by, up to 256 of them: what is held by
  /// more is taken to be where it was seen.
  SparseMatrix clamp_errors;

  DescriptorGrid grid;    ///< where shapes are compared
  SparseMatrix sampling;  ///< its points from vertices of `mesh`; 3 points x 3 vertices
  Points measured;        ///< the scan at its points, m
  SparseMatrix at_scan;   ///< the scan's vertices from those of `mesh`
  std::shared_ptr<const ShapeDescriptor> simulated_descriptor, measured_descriptor;
};
/// One a target; raw ones are registered first (raw_scan.h). Throws Error for options out of range,
/// a grid that is none where one is needed, a clamp without a vertex and a cloth that is held
/// everywhere or nowhere.
std::vector<std::shared_ptr<const ScanTrial>> prepare_scan(const ScanCapture& capture,
                                                           const ScanOptions& options = {});
/// Of shapes at hand, in place of the files.
std::vector<std::shared_ptr<const ScanTrial>> prepare_scan(const ScanCapture& capture,
                                                           const std::vector<ScanShape>& shapes,
                                                           const ScanOptions& options = {});

/// The same on cells of half the width, each halved; compared at the same points, so that nothing
/// but the computed shape changes. Throws Error where they would be more than 200 across the
/// shorter side.
std::shared_ptr<const ScanTrial> refined(const ScanTrial& trial);

/// One target, computed.
struct ScanSimulation {
  HeldEquilibrium rest;
  Points forces;          ///< of each clamp on the cloth, N, 3 x clamps
  MatX force_derivative;  ///< 3 clamps x values of the fabric; empty if not asked for
};
/// All of them. Results do not depend on the number of threads. Throws Error for a fabric that the
/// solver does not take.
std::vector<ScanSimulation> simulate_scans(
    const std::vector<std::shared_ptr<const ScanTrial>>& trials, const EquilibriumSolver& solver,
    const Fabric& fabric, HeldDerivatives derivatives = HeldDerivatives::none, int threads = 0);

/// What moves of the held vertices do (held_response()), `moves` as there.
struct ScanResponse {
  MatX x;       ///< of the free vertices, m per unit, 3 vertices x moves; zero for the held ones
  MatX forces;  ///< of each clamp on the cloth, N per unit, 3 clamps x moves
};
ScanResponse response_of_scan(const ScanTrial& trial, const Fabric& fabric, const Points& x,
                              const MatX& moves);

/// How far a simulation is from the scan.
struct ScanDifference {
  bool converged = false;
  double residual = 0;       ///< N, largest net force on a free vertex
  SurfaceDistance distance;  ///< m, at the scan's vertices that were measured; NaN without any
  double within = 0;         ///< share of these that are nearer than `near`; NaN without any
  double near = 2.4e-3;      ///< m; the paper's section 5
  int point_count = 0;       ///< measured vertices
  VecX forces;               ///< simulated magnitudes, N, a number a clamp
  double force_rms = 0;      ///< N, over the measured ones
  int force_count = 0;
};
ScanDifference compare_scan(const ScanTrial& trial, const ScanSimulation& simulation);

}  // namespace weft
