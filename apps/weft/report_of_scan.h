#pragma once
#include <memory>
#include <vector>

#include "weft/estimate/scan_fit.h"
#include "weft/report/mechanical_report.h"

namespace weft::app {

/// The targets of a fit to scans as a report shows them, one a test: how far forces and shape are
/// from the measured ones, both shapes, the forces of the clamps, and how raw scans were
/// registered.
MechanicalReport report_of_scan(const std::vector<ScanCapture>& captures,
                                const std::vector<std::shared_ptr<const ScanTrial>>& trials,
                                const std::vector<ScanSimulation>& simulations,
                                const std::vector<ScanDifference>& differences);

/// E_u, E_v, mu, nu and b of the estimate, with the intervals that those of what was searched give
/// to first order, of all but nu in their logarithm; without intervals where they depend on what
/// the data do not determine. Empty for another model than "stvk".
std::vector<ReportModulus> report_moduli(const ScanProblem& problem, const ScanFitResult& fit);

}  // namespace weft::app
