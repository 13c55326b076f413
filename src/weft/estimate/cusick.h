#pragma once
/// The drape test after Cusick (ISO 9073-9): a disc of fabric held flat between two smaller discs,
/// whose free ring hangs down in folds.
#include <cstdint>
#include <optional>
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
/// Of a picture from above; the shadow's centroid is its centre. Throws Error for an empty one,
/// `pixel` (m) not above 0, and a coefficient outside [0, 1] by more than the rim's pixels can do.
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

/// Of several drapes of one fabric.
struct DrapeStatistics {
  struct Number {
    double mean = 0;
    double deviation = 0;  ///< standard deviation of one drape; NaN for fewer than two
  };
  Number coefficient, lobes;
  int count = 0, not_converged = 0;  ///< drapes; of these, without equilibrium
};
/// Throws Error for no drapes.
DrapeStatistics drape_statistics(const std::vector<DrapeShape>& drapes);

/// Drapes of fabrics that differ in their bend.
struct DrapePoint {
  double bend = 0;  ///< any measure of it that increases
  DrapeStatistics drapes;
};
/// Where the mean coefficient is the one that is asked for: linear in it between the first two
/// neighbours, by increasing bend, of which the second one's is not below; beyond the points along
/// the line of the last two, or of the first. Throws Error for fewer than two points.
DrapePoint drape_at(const std::vector<DrapePoint>& points, double coefficient);

struct DrapeFitOptions {
  DrapeOptions drape;
  int starts = 6;  ///< drapes of each fabric, with the same seeds for all, 2 or more
  /// Standard deviation of the measured coefficient, >= 0. None: it is that of a single drape,
  /// which scatters as the simulated ones do.
  std::optional<double> deviation;
  double confidence = 0.9;  ///< of the interval, in (0, 1)
  int threads = 0;
};
struct DrapeFit {
  enum class Reach {
    inside,
    below,  ///< the fabric at the limp end of the range has a larger coefficient
    above   ///< at the stiff end a smaller one
  };
  Reach reach = Reach::inside;  ///< of the range, for the measured coefficient
  Fabric fabric;                ///< of the estimate, or at that end
  double factor = 1;            ///< of all constants of bend, of those of the fabric given
  /// Of the interval; 0 and infinity where its end is beyond the range.
  double lower = 0, upper = kInfinity;
  DrapeStatistics drapes;          ///< of the fabric found
  std::vector<DrapePoint> points;  ///< all that were simulated; bend is log(factor)
};
/// The factor of all constants of bend ("N m": stiffnesses, not friction) with which the mean
/// simulated coefficient is the measured one: bracketed from 1 in steps of 4, then narrowed until
/// the mean is within 0.001 or the factor within 2 %. With the same starts everywhere the mean
/// changes little between near factors; where folds come or go it jumps, and the factor of the jump
/// is found.
///
/// The range is that of the largest constant; smaller ones that would leave their own stay at its
/// end. It ends earlier where more than half of the drapes of a limper fabric have no equilibrium,
/// or do not hang lower: the cells are too wide for its folds.
///
/// The interval: where the mean is the measured coefficient less and more than
///
///     t sqrt(s^2 / n + m^2),
///
/// with the deviation s of the n drapes at the estimate, m that of the measured coefficient (s
/// where none is stated) and Student's t with n - 1 degrees of freedom; to a tenth of it. Errors
/// of the mesh and of the model are not in it.
///
/// Throws Error for a coefficient outside (0, 1), options out of range, and as simulate_drape().
DrapeFit fit_drape(const Fabric& fabric, double areal_density, double coefficient,
                   const DrapeFitOptions& options = {});

}  // namespace weft
