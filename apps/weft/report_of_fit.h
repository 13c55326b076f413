#pragma once
/// From what a fit found to what a report shows.
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "options.h"
#include "weft/estimate/evaluate_capture.h"
#include "weft/estimate/fit.h"
#include "weft/estimate/mesh_error.h"
#include "weft/estimate/residual_intervals.h"
#include "weft/estimate/uncertainty.h"
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

/// Title, fabric and how it was made, of a fit to captures at rest.
Report report_of_rest(const Fabric& fabric, const std::vector<std::string>& captures,
                      std::uint64_t seed, int threads);
/// Those of the file --initial; none where it is not given.
std::vector<ParameterPrior> priors_of(const std::string& initial);
/// What a fit to captures at rest says of priors: beside the parameters that were searched, and
/// what they add to the error, nothing without an effect (weight 0).
void add_priors(const std::vector<ParameterPrior>& priors, const Fabric& fabric, double weight,
                double error, Report& report);
/// One line for the terminal; empty without priors.
std::string prior_line(const Report& report, double weight);
/// The ends that an interval has, for the terminal.
std::string ends_in_words(const ReportParameter& parameter);
std::string ends_in_words(const ParameterInterval& interval);
/// Interval, or what else is known, of a parameter that was searched, for the terminal.
std::string certainty_text(const ParameterInterval& interval);
/// A value that is not searched: neither free nor at a bound.
ReportParameter held_parameter(const ParameterInfo& info, const Fabric& fabric, double initial);
/// Interval and bounds of a parameter that is `factor` times what was searched.
void add_interval(const ParameterInterval& interval, double factor, ReportParameter& parameter);
/// Of a fit to captures at rest, whose searched parameters have these intervals; nothing where it
/// is not known.
std::optional<ReportCertainty> report_certainty(const ResidualCertainty& certainty,
                                                const std::vector<ParameterInterval>& intervals);
/// Of `count` "frames" or "targets" whose derivatives are not exact; nothing for none.
void add_inexact_remark(int count, const std::string& of_what, Report& report);

/// What the intervals of a fit to captures at rest hold, for the settings of its report.
std::string interval_contents(MeshError asked, const MeshShift& mesh);
/// Why what the width of the cells does is not known; nothing where it is or was not asked for.
void add_mesh_remark(const MeshShift& mesh, Report& report);
/// `mesh_shift` of result.json, by name: the value on cells of half the width over that at
/// `scaled`, less 1; for parameters that are searched linearly the difference. Empty where the
/// shift was left out, null where it is not known.
nlohmann::json mesh_shift_json(const std::vector<ParameterInfo>& infos, const VecX& scaled,
                               const MeshShift& mesh);

/// Measured and simulated frames and their angle maps, for the report's slider. Reads the video.
/// On up to `threads` threads (0: all cores).
CapturePictures pictures_of(const Trial& trial, const Trajectory& trajectory, int threads);

/// Makes the folder of a fit that keeps its evaluations in the files `stores` (SQLite). A run that
/// was killed has its evaluations but no result, one that was stopped has the result until then;
/// both continue. Throws Error as prepare_output_folder does for the result of another run, and
/// where there is nothing to extend.
void prepare_fit_folder(const std::filesystem::path& out, const std::vector<std::string>& stores,
                        Existing existing);
/// Removes the result and the stores of an earlier fit, for one that overwrites it (none for one
/// that extends it): once all that the user gave has been checked.
void remove_earlier_fit(const std::filesystem::path& out, const std::vector<std::string>& stores);

}  // namespace weft::app
