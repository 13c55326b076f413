#pragma once
/// Registration of a regular grid to a scan by non-rigid iterated closest points.
#include <vector>

#include "weft/mesh/triangle_mesh.h"
#include "weft/registration/scan.h"

namespace weft {

/// The template: a rectangular swatch as a regular grid of vertices (make_swatch).
struct GridTemplate {
  double width = 0, height = 0;  ///< m, sides along u and v
  int columns = 0, rows = 0;     ///< vertices along u and v
  TriangleMesh mesh;

  int vertex(int column, int row) const { return row * columns + column; }
  double cell_u() const { return width / (columns - 1); }
  double cell_v() const { return height / (rows - 1); }
};
/// Throws Error unless width, height > 0 and columns, rows >= 3.
GridTemplate make_grid_template(double width, double height, int columns, int rows);

/// A point of the fabric that was found on the scan.
struct Landmark {
  Vec2 uv = Vec2::Zero();        ///< m
  Vec3 position = Vec3::Zero();  ///< m
  double weight = 1;             ///< of one that is sure
};

struct RegistrationOptions {
  /// m, > 0: how far the start may be from the scan. Steps begin with this reach; 0 takes 0.15 of
  /// the root of the swatch's area.
  double start_error = 0;
  /// m, > 0: features narrower than about 6 times this are smoothed away at the end; 0 takes half
  /// of a cell.
  double smoothing = 0;
  /// m, > 0: a strain e costs as much as a distance e times this between surface and scan; 0 takes
  /// half of the root of the swatch's area, or 0.1 of it where at least 16 landmarks fix the
  /// surface in itself.
  double isometry = 0;
  /// m, >= 0: points nearer than this keep at least a quarter of their pull, whatever the others'
  /// distances.
  double least_reach = 5e-4;
  /// rad: points whose plane is turned further than this from the surface have no pull.
  double largest_turn = 1.05;
  int threads = 0;
};

/// A grid on a scan. A point is an inlier if it pulls with more than 1 % of full weight.
struct ScanRegistration {
  Points x;        ///< 3 x vertices, m
  VecX distance;   ///< m, a vertex: rms distance of the inliers about it; NaN where there are none
  VecX weight;     ///< a vertex: 0 (no point of the scan about it) to 1 (as many as is usual)
  int points = 0;  ///< of the scan
  int inliers = 0;
  VecX residual;  ///< m, of the inliers: signed distance along the surface's normal
  double residual_rms = 0, residual_median = 0, residual_p95 = 0;  ///< m, of |residual|
  double reach = 0;  ///< m, of the last step: at this distance a point has a quarter of its pull
  double landmark_rms = 0;  ///< m; 0 without landmarks
  double strain_rms = 0;    ///< of the cells, along u and v; chords corrected for curvature
  /// m^4: what the registration minimizes, at a reach of half a cell, points without pull and
  /// fabric without points included: comparable between starts on one scan.
  double cost = 0;
  int rounds = 0;

  bool supported(int vertex) const { return weight[vertex] >= least_weight; }
  static constexpr double least_weight = 0.2;
};

/// A shape to begin with, and what of the scan is taken for cloth while the sheet is still far from
/// it.
struct RegistrationStart {
  /// How much of the fabric the scan shows. Of the whole of it, coarse steps draw the rim inwards,
  /// and vertices without points to the nearest point.
  enum class View { part, whole };
  Points x;                 ///< 3 x vertices, m
  std::vector<char> piece;  ///< a flag for each point of the scan; empty: all
  View view = View::part;
  double reach = 0;  ///< m, >= 0: how far this start may be off; 0: options.start_error
};

/// Lays the grid on the scan. Minimizes over the vertices x
///
///   sum_p a_p rho(n . (p - s(x)))  +  W sum_l w_l |s(uv_l) - p_l|^2  +  sum_b c^2 rho(o . x_b -
///   e_b)
///   + D^2 integral (e_uu^2 + e_vv^2 + 2 e_uv^2)  +  B^4 integral (x_uu^2 + x_vv^2 + 2 x_uv^2)
///
/// over the scan's points p (a_p: the area that one stands for; s: the nearest point of the grid, n
/// its normal: points project along the normal, as in Larionov et al. 2022, section 3.2), the
/// landmarks l, and the rim's vertices b, which are drawn, across the rim, to where the inliers end
/// (e_b). rho is the Geman-McClure function, whose weight is (1 + (r / reach)^2)^-2. e is the
/// strain of each cell, measured at its centre and corrected for what chords are shorter than arcs;
/// D is `isometry`. B is a length: features narrower than about 6 B are smoothed.
///
/// Nearest points, weights and planes are renewed before each Gauss-Newton step on the sparse
/// normal equations, while reach falls from `start_error` to 4 times the scatter of the inliers, B
/// from half of the reach to `smoothing`, and D rises to `isometry` (coarse to fine, Li et al.
/// 2008). Early steps also draw the rim to points beyond it.
///
/// `geometry`: of `scan` (scan_geometry). Throws Error for options out of
/// range, landmarks off the swatch, or a start of another size. Deterministic for every number of
/// threads.
ScanRegistration register_scan(const GridTemplate& grid, const Scan& scan,
                               const ScanGeometry& geometry, const RegistrationStart& start,
                               const std::vector<Landmark>& landmarks = {},
                               const RegistrationOptions& options = {});

/// The registration of least cost among those from several starts. Throws Error without a start.
ScanRegistration register_scan(const GridTemplate& grid, const Scan& scan,
                               const ScanGeometry& geometry,
                               const std::vector<RegistrationStart>& starts,
                               const std::vector<Landmark>& landmarks = {},
                               const RegistrationOptions& options = {});

/// Distances of points (3 x n, m) to a registered surface with curved cells: signed, along the
/// normal; NaN for points beyond the rim. n numbers, m.
VecX distances_to_surface(const GridTemplate& grid, const Points& x, const Points& points);

/// Where a registration may begin without a start shape: the flat grid in the plane of points, its
/// centre where their bounding rectangle has its own, u along `u_direction` and v along
/// `v_direction` as far as the plane allows (unit vectors; the sheet is turned and mirrored so that
/// the sum of the two cosines is largest). One start for each of the scan's up to three largest
/// pieces, one for the largest piece beside the plane that holds most points, as a table does, and
/// the first of these once more as a view of the whole.
/// Throws Error for fewer than 3 points on a surface.
std::vector<RegistrationStart> flat_starts(const GridTemplate& grid, const Scan& scan,
                                           const ScanGeometry& geometry, const Vec3& u_direction,
                                           const Vec3& v_direction);
/// The flat grid by the rotation and shift that bring at least 3 landmarks nearest to their
/// positions (Kabsch 1976). Throws Error for fewer, or if they are on one line.
Points flat_start(const GridTemplate& grid, const std::vector<Landmark>& landmarks);

}  // namespace weft
