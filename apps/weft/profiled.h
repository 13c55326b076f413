#pragma once
/// What `weft profile` looks at: a fabric beside the captures that it was fitted to.
#include <string>
#include <vector>

#include "mechanical.h"
#include "options.h"
#include "scan.h"
#include "weft/estimate/profile.h"

namespace weft::app {

/// A cost about an estimate, in scaled coordinates.
struct Profiled {
  std::vector<ParameterInfo> infos;
  VecX estimate;
  /// By derivatives there: of the data alone, without what the width of the cells does.
  std::vector<ParameterInterval> intervals;
  LinearizeFunction linearize;
  CostFunction cost;
  double dispersion = 0;  ///< of the cost, as the intervals take it
  double quantile = 0;    ///< half of such an interval over its standard deviation
  double least_step = 0;  ///< of a profile, scaled coordinate
};

/// Each throws Error for captures that it cannot read, and where the fabric cannot be computed.
Profiled profiled_videos(const std::vector<std::string>& captures, const Fabric& fabric,
                         const TrialArguments& trial);
/// `arguments`: captures, what is compared, cells, threads.
Profiled profiled_tests(const MechanicalFitArguments& arguments, const Fabric& fabric);
/// `arguments`: captures, options, solver, balance, threads.
Profiled profiled_scans(const ScanFitArguments& arguments, const Fabric& fabric);

}  // namespace weft::app
