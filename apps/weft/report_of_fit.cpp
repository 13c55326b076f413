#include "report_of_fit.h"

#include <fmt/ranges.h>

#include <algorithm>

#include "command_line.h"
#include "weft/base/error.h"
#include "weft/base/files.h"
#include "weft/base/parallel.h"
#include "weft/fabric/prior.h"
#include "weft/report/result.h"

namespace weft::app {
namespace {

const PerturbationCurve* curve_of(const FitResult& fit, std::string_view name) {
  const auto found = std::find_if(fit.variability.begin(), fit.variability.end(),
                                  [&](const PerturbationCurve& c) { return c.name == name; });
  return found == fit.variability.end() ? nullptr : &*found;
}

ReportCapture capture_of(const Trial& trial, const CaptureEvaluation& evaluation) {
  const Capture& capture = trial.capture;
  ReportCapture c;
  c.name = capture.name;
  c.description = capture.description;
  c.folder = capture.folder.string();
  c.width = capture.width;
  c.height = capture.height;
  c.areal_density = capture.areal_density;
  c.hem_width = capture.hem_width;
  c.frame_rate = capture.frame_rate;
  c.frame_count = capture.frame_count;
  c.fit_first = capture.fit_first;
  c.fit_last = capture.fit_last;
  c.columns = trial.options.columns;
  c.rows = trial.options.rows;
  c.start = trial.start_name;
  c.start_measured = trial.start_name == "measured surface";
  for (const CaptureEvaluation::Frame& frame : evaluation.frames) {
    ReportFrame f;
    f.index = frame.frame;
    f.time = frame.frame / capture.frame_rate;
    f.validation = frame.frame > capture.fit_last;
    f.error = frame.total;
    f.fold = frame.error.fold;
    f.silhouette = frame.error.silhouette;
    c.frames.push_back(f);
  }
  return c;
}

/// Of the value itself: curves are there only where a variability was computed.
ReportParameter::Bound bound_of(const ParameterInfo& info, double value) {
  const double scaled = to_scaled(info, value);
  if (scaled < at_bound_distance) return ReportParameter::Bound::lower;
  if (scaled > 1 - at_bound_distance) return ReportParameter::Bound::upper;
  return ReportParameter::Bound::none;
}

}  // namespace

ReportParameter report_parameter(const ParameterInfo& info, const Fabric& fabric,
                                 const PerturbationCurve* curve) {
  ReportParameter p;
  p.name = info.name;
  p.unit = info.unit;
  p.meaning = info.meaning;
  p.value = fabric.value(info.name);
  p.lower = info.lower;
  p.upper = info.upper;
  p.initial = p.value;
  p.scale = info.scale == Scale::logarithmic   ? ReportParameter::Scale::logarithmic
            : info.scale == Scale::shifted_log ? ReportParameter::Scale::shifted_logarithmic
                                               : ReportParameter::Scale::linear;
  if (curve) {
    p.variability_percent = curve->variability_percent;
    p.determined = curve->determined;
  }
  p.at_bound = bound_of(info, p.value);
  return p;
}

Report report_of_rest(const Fabric& fabric, const std::vector<std::string>& captures,
                      std::uint64_t seed, int threads) {
  Report report;
  report.title = fmt::format("Fit of {}", fmt::join(captures, ", "));
  report.fabric = fabric.name;
  report.model = fabric.model;
  report.program_version = WEFT_VERSION;
  report.command = command_line();
  report.created = now();
  report.seed = seed;
  report.threads = threads ? threads : hardware_threads();
  return report;
}

std::vector<ParameterPrior> priors_of(const std::string& initial) {
  return initial.empty() ? std::vector<ParameterPrior>() : find_priors(initial);
}

void add_priors(const std::vector<ParameterPrior>& priors, const Fabric& fabric, double weight,
                double error, Report& report) {
  if (!(weight > 0)) return;
  report.prior_error = error;
  for (const ParameterPrior& prior : priors) {
    const int first = fabric.first_value(prior.parameter),
              end = first + fabric.value_count(prior.parameter);
    for (int i = first; i < end; ++i)
      for (ReportParameter& p : report.parameters) {
        if (!p.free || p.name != fabric.info(i).name) continue;
        p.prior_median = prior.median;
        p.prior_factor = prior.factor;
      }
  }
}

std::string prior_line(const Report& report, double weight) {
  if (!report.prior_error) return {};
  return fmt::format("the priors add {:.3g} to the error, with weight {:.3g}\n",
                     *report.prior_error, weight);
}

std::string ends_in_words(const ReportParameter& parameter) {
  return interval_in_words(parameter, [](double value) { return fmt::format("{:.4g}", value); });
}

std::string ends_in_words(const ParameterInterval& interval) {
  ReportParameter p;
  add_interval(interval, 1, p);
  return ends_in_words(p);
}

std::string certainty_text(const ParameterInterval& interval) {
  std::string ends = ends_in_words(interval);
  if (interval.determined) return ends;
  const std::string open = "not determined by the data";
  return interval.by_prior ? ends + ", of its prior: " + open : open + ", " + ends;
}

ReportParameter held_parameter(const ParameterInfo& info, const Fabric& fabric, double initial) {
  ReportParameter p = report_parameter(info, fabric, nullptr);
  p.initial = initial;
  p.free = false;
  p.at_bound = ReportParameter::Bound::none;
  return p;
}

void add_interval(const ParameterInterval& interval, double factor, ReportParameter& parameter) {
  parameter.determined = interval.determined;
  parameter.interval_lower = factor * interval.lower;
  parameter.interval_upper = factor * interval.upper;
  if (interval.at_lower) parameter.at_bound = ReportParameter::Bound::lower;
  if (interval.at_upper) parameter.at_bound = ReportParameter::Bound::upper;
}

std::optional<ReportCertainty> report_certainty(const ResidualCertainty& certainty,
                                                const std::vector<ParameterInterval>& intervals) {
  if (certainty.parts == 0) return std::nullopt;
  ReportCertainty report;
  report.confidence = certainty.confidence;
  report.clusters = static_cast<int>(certainty.parts);
  report.condition = certainty.condition;
  report.noise = 2;  // twice the variance of residuals over their noise
  report.dispersion = certainty.dispersion;
  report.overdispersion = certainty.overdispersion;
  report.left_out = "each frame, shape or piece of a single shape";
  for (const ParameterInterval& interval : intervals) report.parameters.push_back(interval.name);
  report.correlation = certainty.correlation;
  report.covariance = certainty.covariance;
  report.information = certainty.information;
  report.slope = certainty.slope;
  return report;
}

void add_inexact_remark(int count, const std::string& of_what, Report& report) {
  if (count <= 0) return;
  report.remarks.push_back(
      fmt::format("In {} {} the shape is at the limit of stability: the intervals rest on "
                  "derivatives that are not exact there.",
                  count, of_what));
}

std::string interval_contents(MeshError asked, const MeshShift& mesh) {
  if (asked == MeshError::left_out) return "noise";
  return std::string(mesh.unknown.empty() ? noise_and_mesh : "noise (the mesh's error is unknown)");
}

void add_mesh_remark(const MeshShift& mesh, Report& report) {
  if (mesh.unknown.empty()) return;
  report.remarks.push_back(fmt::format(
      "The intervals leave out what the width of the cells does, which is not known: {}.",
      mesh.unknown));
}

nlohmann::json mesh_shift_json(const std::vector<ParameterInfo>& infos, const VecX& scaled,
                               const MeshShift& mesh) {
  if (!mesh.unknown.empty()) return nullptr;
  nlohmann::json shifts = nlohmann::json::object();
  for (Eigen::Index i = 0; i < mesh.shift.size(); ++i) {
    const ParameterInfo& info = infos[static_cast<std::size_t>(i)];
    const double value = from_scaled(info, scaled[i]);
    const double finer = from_scaled(info, scaled[i] + mesh.shift[i]);
    shifts[std::string(info.name)] =
        info.scale == Scale::logarithmic ? finer / value - 1 : finer - value;
  }
  return shifts;
}

ReportPerturbation report_perturbation(const PerturbationCurve& curve) {
  return {curve.name,
          curve.relative,
          curve.error,
          {curve.quadratic[0], curve.quadratic[1], curve.quadratic[2]}};
}

CapturePictures pictures_of(const Trial& trial, const Trajectory& trajectory, int threads) {
  const auto first = static_cast<std::size_t>(trial.first_frame);
  // A simulation that diverged has fewer frames than the video.
  const std::size_t end = std::min(first + trial.features.size(), trajectory.frames.size());
  CapturePictures pictures;
  pictures.capture = trial.capture.name;
  if (end <= first) return pictures;
  const std::vector<Image> measured =
      read_video(trial.capture, trial.first_frame, static_cast<int>(end) - 1);
  std::vector<Mask> silhouettes;
  for (const FrameFeatures& features : trial.features) silhouettes.push_back(features.silhouette);
  FramePicturesOptions options;
  options.crop = bounding_box(silhouettes, 12);
  pictures.frames.resize(end - first);
  parallel_for(end - first, threads, [&](std::size_t i) {
    const SimulatedFrame simulated = look_at(trial, trajectory.frames[first + i]);
    FrameView view;
    view.frame = static_cast<int>(first + i);
    view.measured = measured[i];
    view.simulated = simulated.image.intensity;
    view.features = trial.features[i];
    view.simulated_angles = simulated.angles;
    view.simulated_silhouette = simulated.image.silhouette;
    pictures.frames[i] = make_frame_pictures(view, options);
  });
  return pictures;
}

Report report_of_fit(const Problem& problem, const FitResult& fit,
                     const std::vector<CaptureEvaluation>& evaluations) {
  Report report;
  report.fabric = fit.fabric.name;
  report.model = fit.fabric.model;
  report.program_version = WEFT_VERSION;
  report.seed = fit.seed;
  report.stopped = fit.stopped;
  report.remarks = fit.remarks;
  report.error_initial = fit.initial.error;
  report.error = fit.final.error;
  if (problem.has_prior()) report.prior_error = fit.prior_error;
  report.error_meaning = "per frame and masked pixel, mean over captures";
  report.evaluations = fit.evaluations;
  report.diverged = fit.diverged;
  report.wall_s = fit.wall_s;
  for (int i = 0; i < fit.fabric.values.size(); ++i) {
    const ParameterInfo info = fit.fabric.info(i);
    ReportParameter p = report_parameter(info, fit.fabric, curve_of(fit, info.name));
    p.initial = fit.start_fabric.value(info.name);
    p.free = problem.index_of(info.name) >= 0;
    for (const ParameterPrior& prior : problem.priors()) {
      if (prior.parameter != info.name) continue;
      p.prior_median = prior.median;
      p.prior_factor = prior.factor;
    }
    if (!p.free) p.at_bound = ReportParameter::Bound::none;
    report.parameters.push_back(p);
  }
  for (std::size_t i = 0; i < evaluations.size(); ++i) {
    report.captures.push_back(capture_of(*problem.trials()[i], evaluations[i]));
  }
  for (const FitStep& step : fit.history) {
    report.history.push_back(
        {step.evaluation, step.phase, step.error, step.best, step.temperature});
  }
  for (const SearchEnd& end : fit.searches) {
    ReportSearch& search = report.searches.emplace_back();
    search.seed = end.seed;
    search.error = end.error;
    search.evaluations = end.evaluations;
    search.kept = end.fabric.values == fit.fabric.values;
    search.values.assign(end.fabric.values.begin(), end.fabric.values.end());
  }
  for (const PerturbationCurve& curve : fit.variability) {
    report.perturbations.push_back(report_perturbation(curve));
  }
  return report;
}

namespace {

/// Whether the folder holds what a fit that was stopped left there: it may continue.
bool holds_stopped_fit(const std::filesystem::path& out, const std::vector<std::string>& stores) {
  const auto exists = [&](const std::string& name) {
    std::error_code ignored;
    return std::filesystem::exists(out / name, ignored);
  };
  if (!exists("result.json") || !std::ranges::all_of(stores, exists)) return false;
  try {
    return read_result(out / "result.json").stopped;
  } catch (const Error&) {
    return false;  // not written by a fit
  }
}

}  // namespace

void prepare_fit_folder(const std::filesystem::path& out, const std::vector<std::string>& stores,
                        Existing existing) {
  if (existing == Existing::extend) {
    for (const std::string& store : stores)
      if (!path_exists(out / store))
        throw Error(fmt::format("--extend: {} holds no {} of an earlier run", out.string(), store));
  }
  std::vector<std::string> results;
  if (existing == Existing::refuse && !holds_stopped_fit(out, stores))
    results.emplace_back("result.json");
  prepare_output_folder(out, results, existing);
}

void remove_earlier_fit(const std::filesystem::path& out, const std::vector<std::string>& stores) {
  for (const std::string name : {"result.json", "fabric.toml", "report.html"}) {
    remove_file(out / name);
  }
  remove_results(out, R"(registered_\d+(\.obj|_weights\.csv)|start_\d+\.obj)");
  // SQLite would read a log that a killed run left into the new store.
  for (const std::string& store : stores) {
    for (const std::string ending : {"", "-wal", "-shm"}) {
      remove_file(out / (store + ending));
    }
  }
}

}  // namespace weft::app
