#pragma once
/// Experiments on a swatch whose scans are computed: picture frame, stretch, weights on corners or
/// on an edge, drape from a ledge (Larionov et al. 2022, sections 4.2 and 5).
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "weft/capture/scan_capture.h"
#include "weft/dynamics/simulate.h"
#include "weft/fabric/fabric.h"

namespace weft {

/// A clamp of an experiment: put somewhere, or hung with a weight.
struct ExperimentClamp {
  ScanClamp clamp;
  /// Where the fabric at (u, v) is; empty: the clamp is free and pulled.
  std::function<Vec3(const Vec2& uv)> place;
  Vec3 pull{0, 0, 0};  ///< N, on a free clamp; its magnitude is what is measured
};

struct ScanExperiment {
  std::string name;
  std::vector<ExperimentClamp> clamps;
  std::function<Vec3(const Vec2& uv)> start;  ///< where the cloth starts
  double perturbation = 0;                    ///< m, normal, of every free coordinate of the start
  Vec3 gravity{0, 0, -9.81};
};

enum class ScanAxis { u, v };

/// A swatch whose four edges are held by rigid bars that are hinged at the corners and turned by
/// `shear` (rad) in the horizontal plane: (u, v) is at (u + v sin shear, v cos shear, 0).
ScanExperiment picture_frame(double width, double height, double shear, double perturbation = 0);
/// Two opposite edges pulled apart by `strain` in the horizontal plane.
ScanExperiment edge_stretch(double width, double height, ScanAxis axis, double strain,
                            double perturbation = 0);
/// Hung by point clamps at the two corners at v = 0, `separation` times their distance apart, with
/// weights (kg) at the two corners at v = height. u is horizontal, v down.
ScanExperiment corner_weights(double width, double height, double separation, double left,
                              double right);
/// Hung by a bar along the edge at v = 0 (ScanAxis::v) or u = 0, `depth` deep, with a bar of
/// `weight` kg, as deep, on the opposite one.
ScanExperiment edge_weight(double width, double height, ScanAxis axis, double depth, double weight);
/// Lies flat on a table up to `support` (m) along the axis and hangs over its edge.
ScanExperiment ledge(double width, double height, ScanAxis axis, double support);

struct ScanSynthesis {
  double areal_density = 0.2;        ///< kg/m^2
  double noise = 0;                  ///< m, normal, added to each coordinate of the scan; >= 0
  double stated_noise = 2e-4;        ///< m; what the capture says
  double force_noise = 0;            ///< N, normal, added to each force; >= 0
  double stated_force_noise = 0.01;  ///< N
  std::uint64_t seed = 1;
  StaticOptions statics;
};

struct SynthesizedScan {
  ScanTarget target;  ///< without files
  ScanShape shape;
  Points exact;  ///< without noise, m
  bool converged = false;
  double residual = 0;  ///< N
};
/// On `mesh`, whose (u, v) the experiment's clamps are stated in, with the static solver. A free
/// bar is kept from bending and stretching by stiff springs between its neighbouring vertices (it
/// gives by less than 1e-4 of its length under 10 N). Throws Error for a clamp without vertices.
SynthesizedScan synthesize_scan(const ScanExperiment& experiment, const TriangleMesh& mesh,
                                const Fabric& fabric, const ScanSynthesis& options = {});

}  // namespace weft
