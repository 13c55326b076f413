#pragma once
/// Raw scans of a capture, registered: a fit takes them beside grids that came registered.
#include "weft/capture/scan_capture.h"
#include "weft/registration/nonrigid_icp.h"

namespace weft {

struct RawScanOptions {
  int cells = 24;  ///< of the grid that is laid on the scan, across the shorter side, 2 to 400
  int threads = 0;
};

struct RegisteredScan {
  /// Weights are those of the registration, 0 where the scan has no points.
  ScanShape shape;
  ScanRegistration registration;
};

/// Lays a grid on the raw scan of a target that has no grid. Landmarks of the target that lie in
/// one of its clamps hold the sheet, and it also starts from cloth that hangs by them
/// (hung_start.h) under the target's gravity. Without three landmarks off a line the flat starts
/// lie along the target's axes. Throws Error for a file that is no scan, one without points on a
/// surface or of another size than the swatch (check_scan_extent), one on which no vertex of the
/// grid is supported, a landmark off the swatch and options out of range.
RegisteredScan register_raw_scan(const ScanCapture& capture, const ScanTarget& target,
                                 const RawScanOptions& options = {});

}  // namespace weft
