#pragma once
/// Starts of a registration that sag: cloth hung by what is known to hold it.
#include <vector>

#include "weft/registration/nonrigid_icp.h"

namespace weft {

struct HungStartOptions {
  Vec3 gravity{0, 0, -9.81};  ///< m/s^2, not zero
  int cells = 24;             ///< of the sheet that sags, across the shorter side, 4 to 100
  int threads = 0;
};

/// Shapes of a plausible cloth (moduli 200 N/m, shear 40 N/m, flexural rigidity 5e-6 N m, 0.2
/// kg/m^2) that hangs by `held`, points of the fabric at known places: at rest from the flat sheet
/// through them, bulged to either side, and with 1 to 3 folds across (flat_sheet and generic_starts
/// of stripe_surface.h), those that come to rest alike once. With one held point the sheet hangs in
/// the vertical plane in which the scan's points spread most, either way round. All of the scan
/// counts as cloth in the coarse steps (RegistrationStart::piece is empty), which begin with a
/// reach of 0.06 of the root of the swatch's area: wider ones smooth away what hangs. To be given
/// with `held` among the landmarks, and beside other starts (flat_starts). Throws Error without a
/// held point, for one off the swatch and for options out of range.
std::vector<RegistrationStart> hung_starts(const GridTemplate& grid, const Scan& scan,
                                           const ScanGeometry& geometry,
                                           const std::vector<Landmark>& held,
                                           const HungStartOptions& options = {});

}  // namespace weft
