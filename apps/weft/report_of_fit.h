#pragma once
/// From what a fit found to what a report shows.
#include <memory>
#include <string>
#include <vector>

#include "weft/estimate/evaluate_capture.h"
#include "weft/estimate/fit.h"
#include "weft/report/pictures.h"
#include "weft/report/report.h"

namespace weft::app {

/// Everything but title, command and settings, which the caller knows. `evaluations` are of the
/// estimate on each capture, all frames, without truth.
Report report_of_fit(const Problem& problem, const FitResult& fit,
                     const std::vector<CaptureEvaluation>& evaluations);

/// The parts of a report that `weft variability` shows too.
ReportParameter report_parameter(const ParameterInfo& info, const Fabric& fabric,
                                 const PerturbationCurve* curve);
ReportPerturbation report_perturbation(const PerturbationCurve& curve);

/// Measured and simulated frames and their angle maps, for the report's slider. Reads the video.
CapturePictures pictures_of(const Trial& trial, const Trajectory& trajectory);

}  // namespace weft::app
