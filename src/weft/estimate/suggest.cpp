#include "weft/estimate/suggest.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/base/toml_reader.h"
#include "weft/capture/capture_checks.h"
#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/synthetic.h"
#include "weft/estimate/uncertainty.h"

namespace weft {
namespace {

using Axis = CandidateExperiment::Axis;

constexpr Range kSeparation{0.1, 1}, kAmplitude{0, 1}, kFrequency{0.01, 20};
constexpr int kMostFrames = 10000;
/// Of the line between the clips, as captures are checked.
constexpr double kLargestStretch = 1.1;
/// 1 / variance of a uniform distribution over a range of length 1.
constexpr double kRangeInformation = 12;
constexpr double kDefaultResidual = 0.1;       // rad
constexpr double kDefaultPatch = 1.0 / 16;     // of the image's width
constexpr double kManyDegreesOfFreedom = 1e9;  // the normal distribution

constexpr std::string_view kAxisNames[] = {"across", "along", "up"};

std::string words_of(const CandidateExperiment& e) {
  if (e.amplitude == 0)
    return fmt::format("still, clips {:g} apart, {} frames", e.separation, e.frames);
  return fmt::format("{} {:g} m at {:g} Hz, clips {:g} apart, {} frames", name_of(e.axis),
                     e.amplitude, e.frequency, e.separation, e.frames);
}

void check(const CandidateExperiment& e) {
  const auto require = [&](double value, Range valid, const char* key) {
    check_experiment_value(e.name, key, value, valid);
  };
  require(e.separation, kSeparation, "separation");
  require(e.amplitude, kAmplitude, "amplitude");
  require(e.frequency, kFrequency, "frequency");
  require(e.frames, {1, kMostFrames}, "frames");
}

/// Along `direction`, m.
Motion oscillation(const Vec3& rest, const Vec3& direction, const CandidateExperiment& e,
                   double frame_rate) {
  const int per_frame = 4, count = per_frame * (e.frames - 1) + 2;
  std::vector<double> times;
  Points positions(3, count);
  for (int i = 0; i < count; ++i) {
    const double time = i / (per_frame * frame_rate);
    const double phase = 2 * std::numbers::pi * e.frequency * time;
    const double ramp = std::min(1.0, phase / std::numbers::pi);
    times.push_back(time);
    positions.col(i) =
        rest + e.amplitude * ramp * ramp * (3 - 2 * ramp) * std::sin(phase) * direction;
  }
  return Motion(std::move(times), std::move(positions));
}

Vec3 unit_axis(Axis axis, const Vec3& line, const Vec3& gravity) {
  if (axis == Axis::along) return line;
  const Vec3 up = -gravity.normalized();
  return axis == Axis::up ? up : Vec3(up.cross(line).normalized());
}

Candidate named(Candidate candidate) {
  std::visit(
      [](auto& experiment) {
        if (experiment.name.empty()) experiment.name = words_of(experiment);
      },
      candidate);
  return candidate;
}

class Suggester {
 public:
  Suggester(const Capture& like, const Fabric& fabric, const SuggestOptions& options)
      : like_(like), fabric_(fabric), options_(options), names_(fabric.value_names()) {
    const auto n = static_cast<Eigen::Index>(names_.size());
    known_ = kRangeInformation * MatX::Identity(n, n);
    if (options.known.size() > 0) {
      if (options.known.rows() != n || options.known.cols() != n)
        throw Error("suggest: the known information must have a row for each parameter");
      known_ += options.known;
    }
    for (const std::string& name : options.targets) fabric.value_index(name);  // throws
    if (!(options.noise >= 0)) throw Error("suggest: noise must not be negative");
    if (options.frames_per_sample < 1) throw Error("suggest: frames_per_sample must be at least 1");
    if (!(options.confidence > 0 && options.confidence < 1))
      throw Error(fmt::format("confidence is {:g}, must be in (0, 1)", options.confidence));
    quantile_ = student_quantile(0.5 + 0.5 * options.confidence, kManyDegreesOfFreedom);
  }

  /// Throws Error for one that cannot be made.
  void check(const Candidate& candidate) const {
    std::visit([this](const auto& experiment) { check_one(experiment); }, candidate);
  }

  Suggestion suggest(const Candidate& candidate) const {
    Suggestion result;
    result.experiment = named(candidate);
    result.information = MatX::Zero(known_.rows(), known_.cols());
    try {
      result.information =
          std::visit([this](const auto& experiment) { return information(experiment); }, candidate);
    } catch (const Error& error) {
      result.failure = error.what();
    }
    expect(result);
    return result;
  }

 private:
  void check_one(const CandidateExperiment& experiment) const {
    experiment_capture(like_, experiment);
  }
  void check_one(const auto& test) const { weft::check(test); }

  MatX information(const auto& test) const {
    MechanicalInformationOptions options;
    options.mechanical = options_.mechanical;
    options.areal_density = like_.areal_density;
    options.threads = options_.threads;
    return mechanical_information(test, fabric_, options);
  }

  MatX information(const CandidateExperiment& experiment) const {
    const Capture capture = experiment_capture(like_, experiment);
    SyntheticOptions truth;
    truth.columns = options_.trial.columns;
    truth.rows = options_.trial.rows;
    truth.pattern = GridPattern::alternating;
    truth.simulation = options_.trial.simulation;
    truth.render = options_.trial.render;
    truth.with_noise = false;
    truth.threads = options_.threads;
    const auto trial = simulate_trial(capture, fabric_, options_.trial, truth);
    const Problem problem({trial}, fabric_, names_);
    LinearizationOptions how;
    how.threads = options_.threads;
    const ProblemLinearization found = linearize(problem, problem.scaled(fabric_), how);
    if (found.evaluation.diverged) throw Error("the simulation diverged");
    const double noise = options_.noise > 0 ? options_.noise : default_noise(capture);
    const int frames = static_cast<int>(found.parts.size());
    const int together = experiment.amplitude == 0 ? frames : options_.frames_per_sample;
    MatX sum = MatX::Zero(known_.rows(), known_.cols());
    for (const CostPart& part : found.parts) {
      const int sample = part.frame / together;
      const int length = std::min(together, frames - sample * together);
      // A last sample that is shorter counts by its share.
      const double share = experiment.amplitude == 0 ? 1 : double(length) / together;
      sum += share / length / (noise * part.factor) * part.hessian;
    }
    return sum;
  }

  static double default_noise(const Capture& capture) {
    const double patch = kDefaultPatch * capture.rig.width;
    return 2 * kDefaultResidual * kDefaultResidual * patch * patch;
  }

  VecX half_widths(const MatX& information) const {
    return quantile_ * inverse(information).diagonal().cwiseSqrt();
  }

  void expect(Suggestion& result) const {
    const VecX before = half_widths(known_), after = half_widths(known_ + result.information);
    double sum = 0;
    int targets = 0;
    for (Eigen::Index i = 0; i < before.size(); ++i) {
      const ParameterInfo info = fabric_.info(static_cast<int>(i));
      const double value = fabric_.values[i], scaled = to_scaled(info, value);
      ExpectedInterval p{std::string(info.name), std::string(info.unit), value, before[i],
                         after[i]};
      p.lower = std::max(0.0, from_scaled(info, scaled - after[i]));
      p.upper = from_scaled(info, scaled + after[i]);
      result.parameters.push_back(p);
      const auto& names = options_.targets;
      if (!names.empty() && std::find(names.begin(), names.end(), p.name) == names.end()) continue;
      sum += std::log(after[i] / before[i]);
      ++targets;
    }
    result.remaining = result.failure.empty() ? std::exp(sum / targets) : 1;
  }

  const Capture& like_;
  const Fabric& fabric_;
  const SuggestOptions& options_;
  std::vector<std::string> names_;
  MatX known_;
  double quantile_ = 0;
};

}  // namespace

std::string_view name_of(Axis axis) { return kAxisNames[static_cast<std::size_t>(axis)]; }

const std::string& name_of(const Candidate& candidate) {
  return std::visit([](const auto& experiment) -> const std::string& { return experiment.name; },
                    candidate);
}

std::vector<Candidate> make_candidates(const CandidateFamily& family) {
  std::vector<Candidate> candidates;
  for (const int frames : family.frames) {
    for (const double separation : family.separations) {
      for (const double amplitude : family.amplitudes) {
        if (amplitude == 0) {
          candidates.push_back(
              named(CandidateExperiment{"", separation, Axis::across, 0, 1, frames}));
          continue;
        }
        for (const double frequency : family.frequencies)
          for (const Axis axis : family.axes)
            candidates.push_back(
                named(CandidateExperiment{"", separation, axis, amplitude, frequency, frames}));
      }
    }
  }
  return candidates;
}

std::vector<Candidate> default_candidates(const Fabric& fabric, const CandidateFamily& family) {
  if (fabric.model.starts_with("baraff-witkin")) return make_candidates(family);
  const std::vector<CandidateTest> tests = default_tests();
  return {tests.begin(), tests.end()};
}

namespace {

CandidateExperiment read_video(const TomlTable& table) {
  CandidateExperiment e;
  e.separation = table.number("separation", kSeparation);
  e.amplitude = table.number("amplitude", kAmplitude);
  e.frequency = table.optional_number("frequency", kFrequency).value_or(e.frequency);
  e.frames = table.optional_integer("frames", 1, kMostFrames).value_or(e.frames);
  const std::string axis =
      table.optional_choice("axis", {"across", "along", "up"}).value_or("across");
  e.axis = axis == "along" ? Axis::along : axis == "up" ? Axis::up : Axis::across;
  e.name = table.optional_string("name").value_or(words_of(e));
  table.finish();
  return e;
}

}  // namespace

std::vector<Candidate> read_candidates(const std::filesystem::path& path) {
  const TomlTable file = TomlTable::parse_file(path);
  file.choice("format", {"weft-experiments"});
  file.integer("version", 1, 1);
  std::vector<Candidate> candidates;
  for (const TomlTable& table : file.tables("experiment")) {
    if (table.has("test"))
      candidates.emplace_back(read_candidate_test(table));
    else if (table.has("capture"))
      candidates.emplace_back(read_candidate_capture(table));
    else
      candidates.emplace_back(read_video(table));
  }
  file.finish();
  if (candidates.empty()) throw error_at(file.where("experiment"), "there is no [[experiment]]");
  return candidates;
}

Capture experiment_capture(const Capture& like, const CandidateExperiment& experiment) {
  check(experiment);
  if (like.fixtures.size() != 2)
    throw Error(fmt::format("{}: has {} fixtures; experiments are made with two clips", like.name,
                            like.fixtures.size()));
  const Vec3 left = like.fixtures[0].motion.position(0),
             right = like.fixtures[1].motion.position(0);
  const Vec3 line = (right - left).normalized(), middle = 0.5 * (left + right);
  const double length = (like.fixtures[1].at - like.fixtures[0].at).norm();
  const double apart = experiment.separation * length;
  const double reach = experiment.axis == Axis::along ? apart + experiment.amplitude
                                                      : std::hypot(apart, experiment.amplitude);
  if (reach > kLargestStretch * length)
    throw Error(fmt::format(
        "experiment \"{}\": the clips would come {:.3g} m apart, the swatch is {:.3g} m between "
        "them; less separation or amplitude is needed",
        experiment.name, reach, length));
  const double closest = experiment.axis == Axis::along ? apart - experiment.amplitude : apart;
  if (closest < kLeastDistance * length)
    throw Error(fmt::format(
        "experiment \"{}\": the clips would come within {:.3g} m of each other or pass, must stay "
        "{:.3g} m apart; less amplitude along the line between them is needed",
        experiment.name, closest, kLeastDistance * length));
  Capture capture = like;
  capture.name = experiment.name;
  capture.frame_count = experiment.frames;
  capture.fit_first = 0;
  capture.fit_last = experiment.frames - 1;
  capture.truth.reset();
  capture.video.clear();
  capture.fixtures[0].motion = Motion::fixed(middle - 0.5 * apart * line);
  capture.fixtures[1].motion =
      oscillation(middle + 0.5 * apart * line, unit_axis(experiment.axis, line, like.gravity),
                  experiment, like.frame_rate);
  return capture;
}

std::vector<Suggestion> suggest_experiments(const Capture& like, const Fabric& fabric,
                                            const std::vector<Candidate>& candidates,
                                            const SuggestOptions& options,
                                            const SuggestObserver& observer) {
  const Suggester suggester(like, fabric, options);
  for (const Candidate& candidate : candidates) suggester.check(candidate);
  std::vector<Suggestion> suggestions;
  for (const Candidate& candidate : candidates) {
    suggestions.push_back(suggester.suggest(candidate));
    if (observer && !observer(suggestions.size(), candidates.size())) break;
  }
  std::stable_sort(
      suggestions.begin(), suggestions.end(),
      [](const Suggestion& a, const Suggestion& b) { return a.remaining < b.remaining; });
  return suggestions;
}

}  // namespace weft
