#pragma once
/// The drape test after Cusick (ISO 9073-9): a disc of fabric held flat between two smaller discs,
/// whose free ring hangs down in folds.
#include <cstdint>
#include <vector>

#include "weft/dynamics/clips.h"
#include "weft/fabric/fabric.h"

namespace weft {

struct DrapeTest {
  double radius = 0.15;   ///< m, of the specimen
  double support = 0.09;  ///< m, of the discs that hold it; below radius
};

/// Share of the free ring that its shadow covers, 0 to 1: (shadow - support) / (specimen -
/// support).
double drape_coefficient(double shadow_area, const DrapeTest& test = {});

/// What the shadow of a draped specimen says.
struct DrapeShadow {
  double area = 0;         ///< m^2
  double coefficient = 0;  ///< drape_coefficient
  int lobes = 0;           ///< folds, see count_lobes
  VecX outline;            ///< m, furthest shadow from the centre by direction, 1 degree apart
};
/// Maxima of a closed outline (radius by direction) that rise at least `prominence` (m) above the
/// higher of the minima beside them.
int count_lobes(const VecX& outline, double prominence = 3e-3);
/// Of the triangles' projection along z. Where folds overlap they count once.
DrapeShadow shadow_of(const TriangleMesh& mesh, const Points& x, const DrapeTest& test = {});
/// Of a picture from above; the shadow's centroid is its centre. Throws Error for an empty one and
/// `pixel` (m) not above 0.
DrapeShadow shadow_of(const Mask& mask, double pixel, const DrapeTest& test = {});

struct DrapeOptions {
  DrapeTest test;
  int rings = 10;              ///< cells between the support and the rim, 3 to 100
  int sectors = 96;            ///< cells around, 24 to 720, even
  double perturbation = 2e-3;  ///< m, height of the folds that the start has at the rim, >= 0
  std::uint64_t seed = 1;      ///< of the start
  StaticOptions statics;
};

struct DrapeShape {
  TriangleMesh mesh;  ///< the free ring and a strip inside the support
  Points x;           ///< m, z up, the support at z = 0
  DrapeShadow shadow;
  double residual = 0;  ///< N
  bool converged = false;
};
/// An equilibrium of the free ring under its weight. A drape has many: the start is flat but for
/// random folds (2 to 12 of them, amplitudes and phases from the seed), so that seeds give a
/// sample. The cloth does not touch itself. Throws Error for options out of range, and for a fabric
/// that is no elastic model, or one of springs.
DrapeShape simulate_drape(const Fabric& fabric, double areal_density,
                          const DrapeOptions& options = {});
/// With the seeds options.seed, options.seed + 1 ...; several at once.
std::vector<DrapeShape> sample_drapes(const Fabric& fabric, double areal_density, int count,
                                      const DrapeOptions& options = {}, int threads = 0);

}  // namespace weft
