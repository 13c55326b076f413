#pragma once
/// From computed mechanical captures to what a report shows of them.
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "weft/estimate/mechanical_fit.h"
#include "weft/report/mechanical_report.h"
#include "weft/report/report.h"

namespace weft::app {

/// `frames` with derivatives where bands are wanted: of each trial all frames, as
/// simulate_mechanical() returns them. Bands are those of `intervals` and `correlation` (both of
/// the free parameters, in one order); parameters that are not determined do not widen them.
/// `cord_friction`: what was found of the trials, may be none; the frames' forces have it.
MechanicalReport report_of_mechanical(
    const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
    const std::vector<std::vector<MechanicalFrame>>& frames,
    const std::vector<MechanicalEvaluation>& evaluations, const Fabric& fabric,
    const std::vector<ParameterInterval>& intervals, const MatX& correlation,
    const std::vector<CordFrictionEstimate>& cord_friction);

/// Of the capture of an overhang test, without an interval.
ReportOverhang report_of_overhang(const MechanicalTrial& trial, const MechanicalFrame& frame);

/// Adds what is to be read before the numbers of `report`, a fit to these captures: those that the
/// model does not explain (an error above 10 with forces off by 3 % of the largest, or shapes by
/// five times `point_noise`, m, or overhangs by three times their deviation), forces where the
/// clips are not displaced, displacements of less than 0.1 % and stretch stiffness above 1e5 N/m.
void add_match_remarks(const std::vector<MechanicalCapture>& captures,
                       const std::vector<MechanicalEvaluation>& evaluations, double point_noise,
                       Report& report);

/// The series of a capture's plots for its entry in result.json: `clips`, `strains` and, of an
/// overhang test, more of `overhang`. Numbers are
/// rounded to six digits; null where there is none.
void add_series(const ReportMechanical& capture, nlohmann::json& entry);
/// `responses` of result.json, one entry a curve.
nlohmann::json responses_json(const std::vector<ReportResponse>& responses);

}  // namespace weft::app
