#pragma once
/// From computed mechanical captures to what a report shows of them.
#include <memory>
#include <vector>

#include "weft/estimate/mechanical_fit.h"
#include "weft/report/mechanical_report.h"

namespace weft::app {

/// `frames` with derivatives where bands are wanted: of each trial all frames, as
/// simulate_mechanical() returns them. Bands are those of `intervals` and `correlation` (both of
/// the free parameters, in one order); parameters that are not determined do not widen them.
MechanicalReport report_of_mechanical(
    const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
    const std::vector<std::vector<MechanicalFrame>>& frames,
    const std::vector<MechanicalEvaluation>& evaluations, const Fabric& fabric,
    const std::vector<ParameterInterval>& intervals, const MatX& correlation);

}  // namespace weft::app
