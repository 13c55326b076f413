#include "report_of_mechanical.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <set>

#include "mechanical.h"
#include "weft/estimate/computed_overhang.h"
#include "weft/estimate/mechanical_strains.h"

namespace weft::app {
namespace {

/// Half the interval of something that depends on the fabric, from its derivative.
class Spread {
 public:
  Spread(const Fabric& fabric, const std::vector<ParameterInterval>& intervals,
         const MatX& correlation)
      : half_widths_(static_cast<Eigen::Index>(intervals.size())) {
    const auto n = half_widths_.size();
    for (Eigen::Index i = 0; i < n; ++i) {
      const ParameterInterval& interval = intervals[static_cast<std::size_t>(i)];
      const int index = fabric.value_index(interval.name);
      indices_.push_back(index);
      const ParameterInfo info = fabric.info(index);
      constexpr double kStep = 1e-6;
      const double scaled = to_scaled(info, interval.value);
      const double slope =
          (from_scaled(info, scaled + kStep) - from_scaled(info, scaled - kStep)) / (2 * kStep);
      half_widths_[i] = interval.bounded() ? slope * interval.half_width : 0;
    }
    correlation_ = MatX::Identity(n, n);
    for (Eigen::Index i = 0; i < n; ++i)
      for (Eigen::Index j = 0; j < n; ++j)
        if (i != j && correlation.rows() == n && std::isfinite(correlation(i, j)))
          correlation_(i, j) = correlation(i, j);
  }

  bool known() const { return half_widths_.size() > 0 && half_widths_.maxCoeff() > 0; }
  /// `derivative` by all of the fabric's values.
  double operator()(const Eigen::Ref<const VecX>& derivative) const {
    const VecX part = derivative(indices_).cwiseProduct(half_widths_);
    return std::sqrt(std::max(0.0, part.dot(correlation_ * part)));
  }

 private:
  std::vector<int> indices_;
  VecX half_widths_;
  MatX correlation_;
};

ReportDistance report_distance(const SurfaceDistance& d) { return {d.mean, d.rms, d.max}; }

/// Unit vector of the largest measured force of a clip; zero where none is known.
Vec3 main_direction(const MechanicalFixture& fixture) {
  Vec3 direction = Vec3::Zero();
  for (Eigen::Index k = 0; k < fixture.forces.cols(); ++k) {
    const Vec3 force = fixture.forces.col(k);
    const Vec3 known = force.array().isNaN().select(Vec3::Zero(), force);
    if (known.norm() > direction.norm()) direction = known;
  }
  return direction.norm() > 0 ? Vec3(direction.normalized()) : direction;
}

/// Of the crosshead of a picture frame, or of a clip as report_clip says, m.
std::vector<double> ways_of(const MechanicalCapture& capture, std::size_t index) {
  std::vector<double> ways;
  if (const auto& bars = capture.picture_frame) {
    for (const double shear : bars->shear)
      ways.push_back(std::abs(frame_displacement(bars->side, shear) -
                              frame_displacement(bars->side, bars->shear[0])));
    return ways;
  }
  const MechanicalFixture &fixture = capture.fixtures[index], &first = capture.fixtures.front();
  for (std::size_t k = 0; k < fixture.frames.size(); ++k) {
    Vec3 way = fixture.frames[k].position - fixture.frames.front().position;
    if (index > 0) way -= first.frames[k].position - first.frames.front().position;
    ways.push_back(way.norm());
  }
  return ways;
}

ReportClip report_clip(const MechanicalTrial& trial, std::size_t index,
                       const std::vector<MechanicalFrame>& frames, const Spread& spread) {
  const MechanicalFixture& fixture = trial.capture.fixtures[index];
  ReportClip clip;
  clip.name = fixture.name;
  clip.moved = ways_of(trial.capture, index);
  if (fixture.forces.cols() == 0) return clip;
  const Vec3 direction = main_direction(fixture);
  for (const MechanicalFrame& frame : frames) {
    const Vec3 measured = fixture.forces.col(frame.frame);
    const Vec3 part = measured.array().isNaN().select(Vec3::Zero(), direction);
    const auto at = static_cast<Eigen::Index>(index);
    const double computed =
        frame.converged ? part.dot(frame.forces.col(at)) : std::numeric_limits<double>::quiet_NaN();
    clip.measured.push_back(part.isZero() ? std::numeric_limits<double>::quiet_NaN()
                                          : part.dot(part.cwiseEqual(0).select(part, measured)));
    clip.computed.push_back(computed);
    if (!spread.known() || frame.force_derivative.size() == 0) continue;
    const double half = spread(frame.force_derivative.middleRows(3 * at, 3).transpose() * part);
    clip.lower.push_back(computed - half);
    clip.upper.push_back(computed + half);
  }
  if (clip.lower.size() != clip.computed.size()) clip.lower.clear(), clip.upper.clear();
  return clip;
}

/// The force of cords and weight on a clip, N.
Vec3 force_of(const ClipLoad& load, const Clip& clip, const Vec3& gravity) {
  return -potential_of(load, clip, gravity).gradient.head<3>();
}

ReportLoadedClip report_loaded(const MechanicalTrial& trial, std::size_t index,
                               const std::vector<MechanicalFrame>& frames, const Spread& spread) {
  const MechanicalCapture& capture = trial.capture;
  const MechanicalFixture& fixture = capture.fixtures[index];
  ReportLoadedClip clip;
  clip.name = fixture.name;
  Vec3 largest = Vec3::Zero();
  for (const MechanicalFrame& frame : frames) {
    const Vec3 force =
        force_of(*fixture.load(frame.frame), fixture.frames[static_cast<std::size_t>(frame.frame)],
                 capture.gravity);
    clip.force.push_back(force.norm());
    if (force.norm() > largest.norm()) largest = force;
  }
  const Vec3 direction = largest.norm() > 0 ? Vec3(largest.normalized()) : Vec3::UnitX();
  const Vec3 from = fixture.frames.front().position;
  for (const MechanicalFrame& frame : frames) {
    const auto at = static_cast<std::size_t>(frame.frame);
    clip.measured.push_back(direction.dot(fixture.frames[at].position - from));
    const double computed = frame.converged ? direction.dot(frame.clips[index].position - from)
                                            : std::numeric_limits<double>::quiet_NaN();
    clip.computed.push_back(computed);
    if (!spread.known() || frame.clip_derivative.size() == 0) continue;
    const auto row = 6 * static_cast<Eigen::Index>(index);
    const double half = spread(frame.clip_derivative.middleRows(row, 3).transpose() * direction);
    clip.lower.push_back(computed - half);
    clip.upper.push_back(computed + half);
  }
  if (clip.lower.size() != clip.computed.size()) clip.lower.clear(), clip.upper.clear();
  return clip;
}

constexpr double kLeftOut = 0.005;  // of the area, at either end of a histogram

/// Whether a strain occurs: less than this is rounding.
bool occurs(MaterialTest test, double lower, double upper) {
  const double least = is_bend(test) ? 1e-4 : 1e-8;  // 1/m, 1
  return upper - lower > least;
}

ReportHistogram report_histogram(MaterialTest test, const StrainSample& sample) {
  constexpr int kBins = 40;
  ReportHistogram histogram;
  histogram.name = material_test_name(test);
  histogram.unit = is_bend(test) ? "1/m" : "";
  histogram.lower = quantile(sample, kLeftOut);
  histogram.upper = quantile(sample, 1 - kLeftOut);
  if (!occurs(test, histogram.lower, histogram.upper)) return histogram;
  histogram.share.assign(kBins, 0);
  double total = 0;
  for (std::size_t i = 0; i < sample.value.size(); ++i) {
    const double t =
        (sample.value[i] - histogram.lower) / (histogram.upper - histogram.lower) * kBins;
    if (t < 0 || t > kBins) continue;
    histogram.share[std::min<std::size_t>(static_cast<std::size_t>(t), kBins - 1)] +=
        sample.area[i];
    total += sample.area[i];
  }
  for (double& share : histogram.share) share /= total;
  return histogram;
}

bool has_springs(const Fabric& fabric) { return fabric.model == "springs"; }

/// Side of a square of the mean area of the cells, m.
double mean_cell(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials) {
  double area = 0;
  int triangles = 0;
  for (const auto& trial : trials) {
    for (const MechanicalStage& stage : trial->stages) {
      area += vertex_areas(stage.mesh).sum();
      triangles += stage.mesh.triangle_count();
    }
  }
  return triangles > 0 ? std::sqrt(2 * area / triangles) : 0;
}

std::string springs_remark(double cell) {
  return fmt::format(
      "The bend of springs depends on the cells of the mesh: here they are {:.2g} mm wide, the "
      "mean of the fit's, and turn against each other by up to a right angle.",
      1e3 * cell);
}

/// First, last, and the one with the largest force, or where no force was measured the middle one.
std::set<int> shown_frames(const MechanicalCapture& capture) {
  int most = capture.frame_count / 2;
  double largest = 0;
  for (const MechanicalFixture& fixture : capture.fixtures) {
    for (Eigen::Index k = 0; k < fixture.forces.cols(); ++k) {
      const double force = fixture.forces.col(k).norm();
      if (!(force > largest)) continue;
      largest = force;
      most = static_cast<int>(k);
    }
  }
  return {0, most, capture.frame_count - 1};
}

void add_shapes(const MechanicalTrial& trial, const std::vector<MechanicalFrame>& frames,
                ReportMechanical& report) {
  if (!trial.geometry) return;
  const MeasuredGeometry& geometry = *trial.geometry;
  ShapeView view;
  if (trial.capture.gravity.norm() > 0) view.up = -trial.capture.gravity.normalized();
  view.lower = Vec3::Constant(kInfinity);
  view.upper = -view.lower;
  std::vector<VecX> residuals;
  std::vector<double> sorted;
  for (const MechanicalFrame& frame : frames) {
    const Points& measured = geometry.frames[static_cast<std::size_t>(frame.frame)];
    view.lower = view.lower.cwiseMin(measured.rowwise().minCoeff());
    view.upper = view.upper.cwiseMax(measured.rowwise().maxCoeff());
    residuals.push_back((frame.points - measured).colwise().norm().transpose());
    sorted.insert(sorted.end(), residuals.back().begin(), residuals.back().end());
  }
  std::ranges::sort(sorted);
  // A few buckled corners do not set the scale.
  report.full_distance = std::max(sorted[sorted.size() * 99 / 100], 1e-6);
  for (const int k : shown_frames(trial.capture)) {
    const auto at = static_cast<std::size_t>(k);
    report.shapes.push_back(
        {k, encode_png(shape_picture(geometry.mesh, geometry.frames[at], {}, 1, view)),
         encode_png(shape_picture(geometry.mesh, frames[at].points, residuals[at],
                                  report.full_distance, view))});
  }
}

ReportOverhang report_overhang(const MechanicalTrial& trial, const MechanicalFrame& frame,
                               const Spread& spread) {
  ReportOverhang report = report_of_overhang(trial, frame);
  if (spread.known() && frame.overhang_derivative.size() > 0) {
    const double half = spread(frame.overhang_derivative);
    report.lower = frame.overhang - half;
    report.upper = frame.overhang + half;
  }
  return report;
}

ReportMechanical report_capture(const MechanicalTrial& trial,
                                const std::vector<MechanicalFrame>& frames,
                                const MechanicalEvaluation& evaluation,
                                const StrainSamples& samples, const Spread& spread) {
  const MechanicalCapture& capture = trial.capture;
  ReportMechanical report;
  report.name = capture.name;
  report.description = capture.description;
  report.folder = capture.folder.string();
  report.width = capture.width;
  report.height = capture.height;
  report.areal_density = capture.areal_density;
  report.grain_angle = capture.grain_angle;
  report.point_count = trial.geometry ? trial.geometry->mesh.vertex_count() : 0;
  report.force_rms = evaluation.force_rms;
  report.force_relative = evaluation.force_relative;
  report.force_largest = evaluation.largest_force;
  report.force_count = evaluation.force_count;
  if (evaluation.point_count > 0) report.distance = report_distance(evaluation.distance);
  for (const MechanicalDifference& d : evaluation.frames) {
    ReportMechanicalFrame& frame = report.frames.emplace_back();
    frame.index = d.frame;
    frame.converged = d.converged;
    if (d.force_count > 0) frame.force_rms = d.force_rms;
    if (d.point_count > 0) frame.distance = report_distance(d.distance);
  }
  for (std::size_t i = 0; i < capture.fixtures.size(); ++i)
    report.clips.push_back(report_clip(trial, i, frames, spread));
  for (std::size_t i = 0; i < capture.fixtures.size(); ++i)
    if (capture.fixtures[i].loaded())
      report.loaded.push_back(report_loaded(trial, i, frames, spread));
  if (evaluation.pose.count > 0)
    report.pose = ReportPose{evaluation.pose.position_rms, evaluation.pose.rotation_rms};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ReportHistogram histogram = report_histogram(kMaterialTests[i], samples[i]);
    if (!histogram.share.empty()) report.strains.push_back(std::move(histogram));
  }
  add_shapes(trial, frames, report);
  if (capture.overhang) report.overhang = report_overhang(trial, frames.front(), spread);
  return report;
}

constexpr double kMostTurn = std::numbers::pi / 2;  // of cells with springs, rad
constexpr int kSamples = 41;                        // of a response, or of one branch of its cycle

/// Whether friction acts in a test; the diagonal bends both threads.
bool rubs(const Fabric& fabric, MaterialTest test) {
  const auto has = [&](const std::string& component) {
    const std::string name = component + "_friction";
    return std::ranges::any_of(model_parameters(fabric.model), [&](const ParameterInfo& info) {
      return info.name == name && fabric.value_count(name) > 0;
    });
  };
  std::string component(material_test_name(test));
  std::ranges::replace(component, ' ', '_');
  return has(component) ||
         (test == MaterialTest::diagonal_bend && (has("weft_bend") || has("warp_bend")));
}

/// From rest to `upper`, to `lower`, and to `upper` again; close to each other after a turn, where
/// the stress changes fastest.
void add_cycle(double lower, double upper, ReportResponse& out) {
  double from = 0;
  out.strain.push_back(from);
  for (const double to : {upper, lower, upper}) {
    if (to == from) continue;
    if (out.strain.size() > 1) out.turns.push_back(out.strain.size() - 1);
    for (int i = 1; i < kSamples; ++i) {
      const double t = static_cast<double>(i) / (kSamples - 1);
      out.strain.push_back(from + (to - from) * t * t);
    }
    from = to;
  }
}

/// Over the strains that occur in any capture: from `lower` <= 0 to `upper` >= 0. `cell`: side of
/// the cells of the meshes, m.
ReportResponse report_response(const Fabric& fabric, MaterialTest test, double lower, double upper,
                               double cell, const Spread& spread) {
  ReportResponse out;
  out.name = material_test_name(test);
  out.strain_unit = is_bend(test) ? "1/m" : "";
  out.stress_unit = is_bend(test) ? "N" : "N/m";
  MaterialResponseOptions options;
  if (has_springs(fabric)) options.cell = cell;
  if (has_springs(fabric) && is_bend(test)) {
    lower = std::max(lower, -kMostTurn / cell);
    upper = std::min(upper, kMostTurn / cell);
  }
  if (rubs(fabric, test)) {
    options.path = StrainPath::continued;
    add_cycle(lower, upper, out);
  } else {
    for (int i = 0; i < kSamples; ++i)
      out.strain.push_back(lower + (upper - lower) * i / (kSamples - 1));
  }
  const MaterialResponse response = material_response(fabric, test, out.strain, options);
  out.stress.assign(response.stress.begin(), response.stress.end());
  if (!spread.known()) return out;
  for (Eigen::Index i = 0; i < response.stress.size(); ++i) {
    const double half = spread(response.derivative.row(i).transpose());
    out.lower.push_back(response.stress[i] - half);
    out.upper.push_back(response.stress[i] + half);
  }
  return out;
}

// What a fit is warned of.
constexpr double kMuchError = 10;
constexpr double kMuchForce = 0.03;       // of the largest
constexpr double kMuchDistance = 5;       // times the noise of a point
constexpr double kMuchOverhang = 3;       // times the deviation of a reading
constexpr double kMuchOffset = 0.05;      // of the largest force
constexpr double kNotDisplaced = 1e-3;    // of the largest displacement
constexpr double kLeastDisplaced = 1e-3;  // of the distance of the clips, or rad
constexpr double kStiffest = 1e5;         // N/m

/// Empty where the model explains the capture.
std::string mismatch(const MechanicalCapture& capture, const MechanicalEvaluation& evaluation,
                     double point_noise) {
  const double pose_noise = capture.clip_noise > 0 ? capture.clip_noise : point_noise;
  const bool pose = evaluation.pose.position_rms > kMuchDistance * pose_noise;
  const bool force = evaluation.force_relative > kMuchForce,
             shape = evaluation.point_count > 0 &&
                     evaluation.distance.rms > kMuchDistance * point_noise;
  const bool overhang = capture.overhang &&
                        !(evaluation.overhang->rms <= kMuchOverhang * capture.overhang->deviation);
  if (!force && !shape && !pose && !overhang) return {};
  return "the model does not explain it: " + summary(evaluation) + ".";
}

/// How far two clips are from where they hold the cloth undeformed, over their distance, or the
/// shear of a picture frame, frame by frame; empty for other captures.
std::vector<double> displacements(const MechanicalCapture& capture) {
  std::vector<double> ways;
  if (capture.picture_frame) {
    for (const double shear : capture.picture_frame->shear) ways.push_back(std::abs(shear));
    return ways;
  }
  if (capture.fixtures.size() != 2) return {};
  for (int frame = 0; frame < capture.frame_count; ++frame) {
    const std::vector<Clip> clips = capture.clips(frame);
    const Vec2 flat = clips[1].region.center() - clips[0].region.center();
    const Vec3 there = clips[0].position + clips[0].rotation * Vec3(flat.x(), flat.y(), 0);
    ways.push_back((clips[1].position - there).norm() / flat.norm());
  }
  return ways;
}

/// The largest measured force of a clip at a frame, N, of the components that are known.
double largest_force(const MechanicalCapture& capture, std::size_t frame) {
  double largest = 0;
  for (const MechanicalFixture& fixture : capture.fixtures) {
    if (fixture.forces.cols() == 0) continue;
    const Vec3 force = fixture.forces.col(static_cast<Eigen::Index>(frame));
    largest = std::max(largest, force.array().isNaN().select(Vec3::Zero(), force).norm());
  }
  return largest;
}

/// Of the first frame, before anything rubbed; with gravity or cords forces need no displacement.
std::string offset(const MechanicalCapture& capture, const std::vector<double>& ways) {
  if (ways.empty() || capture.drive == ClipDrive::cords || !capture.gravity.isZero() ||
      capture.has_loaded())
    return {};
  if (ways.front() > kNotDisplaced * std::ranges::max(ways)) return {};
  double most = 0;
  for (std::size_t k = 0; k < ways.size(); ++k) most = std::max(most, largest_force(capture, k));
  const double here = largest_force(capture, 0);
  if (!(here > kMuchOffset * most)) return {};
  return fmt::format(
      "at its first frame, without a displacement, the force is {:.3g} N, {:.0f} % of the largest: "
      "an offset of the gauge, or a preload.",
      here, 100 * here / most);
}

std::string little_displacement(const MechanicalCapture& capture, const std::vector<double>& ways) {
  if (ways.empty() || std::ranges::max(ways) > kLeastDisplaced) return {};
  return fmt::format(
      "the largest {} is {:.2g}: is the unit right?",
      capture.picture_frame ? "shear angle (rad)" : "displacement over the distance of the clips",
      std::ranges::max(ways));
}

bool is_stretch_stiffness(const ReportParameter& p) {
  if (p.name.find("friction") != std::string::npos || p.unit != "N/m") return false;
  for (const char* row :
       {"weft_stretch", "warp_stretch", "stretch_stiffness", "membrane_uu", "membrane_vv"})
    if (p.name.starts_with(row)) return true;
  return false;
}

/// For a plot, not to compute with.
nlohmann::json rounded(const std::vector<double>& values) {
  nlohmann::json list = nlohmann::json::array();
  for (const double value : values)
    list.push_back(json_number(std::strtod(fmt::format("{:.6g}", value).c_str(), nullptr)));
  return list;
}

void add_band(const std::vector<double>& lower, const std::vector<double>& upper,
              nlohmann::json& object) {
  if (lower.empty()) return;
  object["lower"] = rounded(lower);
  object["upper"] = rounded(upper);
}

}  // namespace

ReportOverhang report_of_overhang(const MechanicalTrial& trial, const MechanicalFrame& frame) {
  const OverhangTest& test = *trial.capture.overhang;
  ReportOverhang report{test.angle, test.deviation, {}, frame.overhang, {}, {}, {}, {}};
  report.measured.assign(test.lengths.begin(), test.lengths.end());
  const MaterialPoints line = middle_line(trial.capture, trial.stages.front().mesh, frame.x);
  report.x.assign(line.row(0).begin(), line.row(0).end());
  report.z.assign(line.row(1).begin(), line.row(1).end());
  return report;
}

MechanicalReport report_of_mechanical(
    const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
    const std::vector<std::vector<MechanicalFrame>>& frames,
    const std::vector<MechanicalEvaluation>& evaluations, const Fabric& fabric,
    const std::vector<ParameterInterval>& intervals, const MatX& correlation,
    const std::vector<CordFrictionEstimate>& cord_friction) {
  const Spread spread(fabric, intervals, correlation);
  MechanicalReport report;
  std::array<double, kMaterialTests.size()> lower{}, upper{};
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const auto samples = strain_samples(*trials[i], frames[i]);
    for (std::size_t k = 0; k < samples.size(); ++k) {
      lower[k] = std::min(lower[k], quantile(samples[k], kLeftOut));
      upper[k] = std::max(upper[k], quantile(samples[k], 1 - kLeftOut));
    }
    report.captures.push_back(
        report_capture(*trials[i], frames[i], evaluations[i], samples, spread));
  }
  for (const CordFrictionEstimate& friction : cord_friction) {
    const ParameterInterval& p = friction.interval;
    report.captures[friction.trial].cord_friction =
        ReportCordFriction{p.value, p.lower, p.upper, p.determined};
  }
  const double cell = mean_cell(trials);
  if (has_springs(fabric)) report.response_remark = springs_remark(cell);
  for (std::size_t k = 0; k < kMaterialTests.size(); ++k)
    if (occurs(kMaterialTests[k], lower[k], upper[k]))
      report.responses.push_back(
          report_response(fabric, kMaterialTests[k], lower[k], upper[k], cell, spread));
  return report;
}

void add_match_remarks(const std::vector<MechanicalCapture>& captures,
                       const std::vector<MechanicalEvaluation>& evaluations, double point_noise,
                       Report& report) {
  for (std::size_t i = 0; i < captures.size(); ++i) {
    const std::string& name = captures[i].name;
    const auto add = [&](const std::string& problem) {
      if (!problem.empty()) report.remarks.push_back(fmt::format("{}: {}", name, problem));
    };
    if (report.error > kMuchError) add(mismatch(captures[i], evaluations[i], point_noise));
    const std::vector<double> ways = displacements(captures[i]);
    add(offset(captures[i], ways));
    add(little_displacement(captures[i], ways));
  }
  for (const ReportParameter& p : report.parameters)
    if (p.free && is_stretch_stiffness(p) && p.value > kStiffest)
      report.remarks.push_back(
          fmt::format("{} is {:.3g} N/m, more than that of cloth: are the units of forces, "
                      "displacements and the specimen right?",
                      p.name, p.value));
}

void add_series(const ReportMechanical& capture, nlohmann::json& entry) {
  nlohmann::json clips = nlohmann::json::array();
  for (const ReportClip& clip : capture.clips) {
    nlohmann::json object = {{"name", clip.name}, {"way", rounded(clip.moved)}};
    if (!clip.measured.empty()) {
      object["measured"] = rounded(clip.measured);
      object["computed"] = rounded(clip.computed);
    }
    add_band(clip.lower, clip.upper, object);
    clips.push_back(object);
  }
  entry["clips"] = clips;
  if (!capture.loaded.empty()) {
    nlohmann::json loaded = nlohmann::json::array();
    for (const ReportLoadedClip& clip : capture.loaded) {
      nlohmann::json object = {{"name", clip.name},
                               {"force", rounded(clip.force)},
                               {"measured", rounded(clip.measured)},
                               {"computed", rounded(clip.computed)}};
      add_band(clip.lower, clip.upper, object);
      loaded.push_back(object);
    }
    entry["loaded_clips"] = loaded;
  }
  if (const auto& overhang = capture.overhang) {
    entry["overhang"]["lower"] = overhang->lower ? json_number(*overhang->lower) : nullptr;
    entry["overhang"]["upper"] = overhang->upper ? json_number(*overhang->upper) : nullptr;
    entry["overhang"]["x"] = rounded(overhang->x);
    entry["overhang"]["z"] = rounded(overhang->z);
  }
  nlohmann::json strains = nlohmann::json::array();
  for (const ReportHistogram& histogram : capture.strains)
    strains.push_back({{"name", histogram.name},
                       {"unit", histogram.unit},
                       {"lower", histogram.lower},
                       {"upper", histogram.upper},
                       {"share", rounded(histogram.share)}});
  entry["strains"] = strains;
}

nlohmann::json responses_json(const std::vector<ReportResponse>& responses) {
  nlohmann::json list = nlohmann::json::array();
  for (const ReportResponse& response : responses) {
    nlohmann::json object = {{"name", response.name},
                             {"strain_unit", response.strain_unit},
                             {"stress_unit", response.stress_unit},
                             {"strain", rounded(response.strain)},
                             {"stress", rounded(response.stress)}};
    add_band(response.lower, response.upper, object);
    if (!response.turns.empty()) object["turns"] = response.turns;
    list.push_back(object);
  }
  return list;
}

}  // namespace weft::app
