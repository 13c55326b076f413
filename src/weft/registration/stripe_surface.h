#pragma once
#include <string>
#include <vector>

#include "weft/dynamics/scene.h"
#include "weft/fabric/fabric.h"
#include "weft/optics/render.h"
#include "weft/vision/angle_map.h"

namespace weft {

/// Points of the surface where the stripes of one frame were decoded: one a stripe edge and image
/// column.
struct StripePoints {
  MatX pixel;       ///< 2 x n, continuous image coordinates: x at column centres, y sub-pixel
  Points position;  ///< 3 x n, m: where the camera ray meets the plane of light of that edge
  /// Camera depth in m at pixel centres between neighbouring edges of a column (projector rows
  /// interpolated linearly in y), 0 elsewhere; rows x columns of the image.
  Image depth;
};

struct StripeDecodeOptions {
  /// Steepest surface whose stripes are connected: change of depth along the view over distance
  /// across it, from 1 (45 degrees) up. Steeper steps are taken for occlusions.
  double steepest_slope = 4.5;
};

/// Triangulates the stripes of a frame.
///
/// Edges are found along image columns (stripe_edges.h). Which stripe an edge belongs to is
/// counted, not guessed from depth: an edge continues on the next column where both the light above
/// and the light below it are connected, and the next edge of the other kind on a column is half a
/// period on. Edges that such steps connect at slopes of at most 1.5 form smooth pieces; each piece
/// is then shifted by whole periods, the piece with the most support first. Support comes from the
/// fixtures, whose positions at the first frame time are known, and from steps of at most
/// `steepest_slope` to pieces that are placed already, each with weight 1 / (1 + slope^2). Pieces
/// where the cloth cannot be (further from a fixture than the fabric reaches with 10 % of stretch),
/// outside the projector's image, of fewer than 8 edges or without support are left out. The rims
/// of shadows look like stripe edges and may remain: expect a per cent or two of outliers.
///
/// The stripes must run across the image columns rather than along them, and have a period of at
/// least 4 px in the image. `intensity`: linear light; `silhouette`: the cloth, of the same size
/// (throws Error otherwise); `scene`: fixtures, mesh and first frame time are used.
StripePoints decode_stripes(const Image& intensity, const Mask& silhouette, const Rig& rig,
                            const Scene& scene, const StripeDecodeOptions& options = {});

struct SurfaceFit {
  Points x;  ///< 3 x vertices of scene.mesh
  /// Other surfaces that explain the points, by their energy: what the camera does not see is left
  /// to the sheet. At most 24; none is within 0.5 mm (mean) of x or of another of the same sheet.
  /// Empty unless asked for.
  std::vector<Points> others;
  Eigen::VectorXi support;     ///< decoded points within 5 mm of the surface, counted at the vertex
                               ///< nearest to each; 0: placed by the cloth model alone
  double residual_median = 0;  ///< m, decoded points to the fitted surface
  double residual_p95 = 0;     ///< m
  int points = 0;              ///< decoded points
  /// False: fewer than 200 points, or a median residual above 3 mm, or less than 80 % of the points
  /// where the fitted surface is seen; x is then a guess.
  bool usable = false;
  std::string note;  ///< why not
};

struct SurfaceFitOptions {
  bool others = false;  ///< whether to search for them: four times as long
  int threads = 1;      ///< 0: all cores; the result does not depend on it
};

/// Fits the swatch mesh of `scene` to the decoded points and the silhouette, with its fixtures
/// where they are at the first frame time: the start for settling.
///
/// Minimizes elastic and gravity energy of the swatch (ClothModel), plus springs from each point to
/// the triangle that its pixel sees, along the surface's normal, from each pixel of the
/// silhouette's rim to the nearest rim of the mesh, across the rim, and into the silhouette for
/// vertices that project outside it. Closest points and robust weights (1 + (r / s)^2)^-2 are
/// renewed every two Newton steps, while s falls from 100 to 5 mm, bending from a length (B /
/// weight per area)^(1/3) of 60 to 15 mm, and in-plane stiffness rises from 10 to 250 times the
/// weight of the swatch per width. Points fix the surface along its normal; along itself it is
/// placed by its rim and by being nearly inextensible. Begun from the flat sheet and four generic
/// shapes, pulled to the points at once, and from two of them left to sag before the points pull.
/// The one that has the least energy (elastic, and misfit) while bending is still stiff goes on.
///
/// SurfaceFit::others: from the end of least energy ways out are tried until none lowers it by 2 %
/// (six times at most): bending stiffened again to lengths of 30 to 120 mm, with the points pulling
/// as before or loosely; and strips of 5 and 7.5 % of the swatch along each rim folded over to the
/// other side, in depth, as the camera does not see on which side they hang. That is done with a
/// sheet whose bending length is 15 mm at last, and once more from its best four ends with one of 8
/// mm.
///
/// Stiffnesses are those of a generic fabric of the scene's areal density: nothing is assumed about
/// the fabric's parameters. Throws Error if the scene has no fixtures.
SurfaceFit fit_surface(const StripePoints& points, const Mask& silhouette, const Rig& rig,
                       const Scene& scene, const SurfaceFitOptions& options = {});

/// A surface, and how well it explains the points.
struct RefinedSurface {
  Points x;
  double energy = 0;  ///< J: elastic, and robust misfit
};

/// The last stages of fit_surface() again, from each of `from`, with a sheet of this fabric in
/// place of the generic one, and the same ways out from the best. Where folds are deep that is
/// nearer to the true surface, and settles less far from where it is. At most 12, the least energy
/// first.
std::vector<RefinedSurface> refine_surfaces(const StripePoints& points, const Mask& silhouette,
                                            const Rig& rig, const Scene& scene,
                                            const Fabric& fabric, const std::vector<Points>& from,
                                            int threads = 1);

/// Start shapes for when there is no usable frame: the sheet bulged to either side, and folded
/// alternately. Named, for the report.
struct StartShape {
  std::string name;
  Points x;
};
std::vector<StartShape> generic_starts(const Scene& scene);

}  // namespace weft
