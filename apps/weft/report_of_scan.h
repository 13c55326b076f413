#pragma once
#include <memory>
#include <vector>

#include "weft/estimate/scan_trial.h"
#include "weft/report/mechanical_report.h"

namespace weft::app {

/// The targets of a fit to scans as a report shows them, one a test: how far forces and shape are
/// from the measured ones, and both shapes.
MechanicalReport report_of_scan(const std::vector<ScanCapture>& captures,
                                const std::vector<std::shared_ptr<const ScanTrial>>& trials,
                                const std::vector<ScanSimulation>& simulations,
                                const std::vector<ScanDifference>& differences);

}  // namespace weft::app
