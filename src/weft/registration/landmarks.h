#pragma once
/// Landmarks from what is printed on the fabric: it is looked at over (u, v), through a
/// registration that may still slide.
#include <functional>
#include <vector>

#include "weft/optics/pinhole.h"
#include "weft/registration/nonrigid_icp.h"

namespace weft {

/// What the fabric shows over (u, v): texel (row i, column j) is the middle of u from j to j + 1, v
/// from i to i + 1, times `texel`.
struct FabricImage {
  Image grey;        ///< 0 to 1
  Mask seen;         ///< 1 where the fabric was seen
  double texel = 0;  ///< m
};

/// From the colours of a scan: each texel is the mean of the nearest four points, weighted by
/// distance, where one is nearer than twice their usual distance. Throws Error for a scan without
/// colours or a texel that is not above 0 m.
FabricImage unwrap_scan(const GridTemplate& grid, const Points& x, const Scan& scan, double texel);

/// From a picture of the surface: bilinear, where the surface is in front of itself, and turned to
/// the camera by less than 75 degrees. `picture`: grey, continuous image coordinates as everywhere.
FabricImage unwrap_picture(const GridTemplate& grid, const Points& x, const Image& picture,
                           const Pinhole& camera, double texel);

/// Lines stamped on the fabric, darker than it, at u = origin.x() + i pitch and v = origin.y() + j
/// pitch.
struct StampedGrid {
  double pitch = 0;            ///< m
  Vec2 origin = Vec2::Zero();  ///< m, in [0, pitch)
};

/// The crossings of a stamped grid. Where a dark line along u meets one along v (both within about
/// 15 degrees of their direction), found to a fraction of a texel. Crossings are numbered from one
/// to the next, so that the registration may slide by more than a pitch from place to place; of the
/// whole, the number is taken that moves the median crossing least: it must be right to half a
/// pitch. Those nearer than 0.3 pitches to the rim are left out, and those more than 0.15
/// pitches off the middle of their neighbours. Landmarks are where the crossings
/// lie on the registered surface. Throws Error unless the pitch is at least 6 texels and the origin
/// in range.
std::vector<Landmark> find_stamped_grid(const GridTemplate& grid, const Points& x,
                                        const FabricImage& image, const StampedGrid& stamp);

/// How far a pattern has moved over the fabric, from a reference: at the material point `uv` of the
/// reference is what the image shows at uv + shift.
struct TextureShift {
  Vec2 uv = Vec2::Zero();     ///< m
  Vec2 shift = Vec2::Zero();  ///< m
  double score = 0;           ///< normalized correlation, -1 to 1
};
struct TextureTracking {
  double spacing = 0.04;       ///< m, between the points that are tracked
  double window = 0.04;        ///< m, side of the pattern that is compared
  double reach = 0.02;         ///< m, largest shift along u and v
  double least_score = 0.7;    ///< below it nothing is said
  Vec2 offset = Vec2::Zero();  ///< m, of the points, to have others
};
/// Block matching by normalized correlation with a parabola through the best shift. Points whose
/// best shift is at the reach, or whose window is seen to less than 80 %, are left out.
std::vector<TextureShift> track_texture(const FabricImage& reference, const FabricImage& image,
                                        const TextureTracking& tracking = {});
/// The landmarks that undo the shifts: where the registered surface has uv + shift.
std::vector<Landmark> landmarks_of(const GridTemplate& grid, const Points& x,
                                   const std::vector<TextureShift>& shifts);

/// Registers again, twice, with landmarks that bring what `look` shows of the fabric to where
/// `reference` has it. `look`: what the fabric shows through a registration of this scan. Where
/// options.isometry is 0, 0.1 of the root of the swatch's area is taken: lengths still even out
/// what single landmarks say. `landmarks`: how many the last round had.
ScanRegistration follow_print(const GridTemplate& grid, const Scan& scan,
                              const ScanGeometry& geometry, ScanRegistration registration,
                              const FabricImage& reference,
                              const std::function<FabricImage(const Points&)>& look,
                              const RegistrationOptions& options, const TextureTracking& tracking,
                              std::size_t& landmarks);

}  // namespace weft
