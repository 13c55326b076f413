#pragma once
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "weft/estimate/mechanical_candidate.h"
#include "weft/estimate/problem.h"

namespace weft {

/// A video that could be made: the swatch hangs by two clips, the second of which is moved to
/// and fro, from rest, its amplitude growing over the first half period.
struct CandidateExperiment {
  enum class Axis {
    across,  ///< horizontal, at right angles to the line of the clips
    along,   ///< the line of the clips
    up,
  };
  std::string name;          ///< empty: made of the values
  double separation = 0.75;  ///< of the clips, of their distance on the undeformed swatch; 0.1 to 1
  Axis axis = Axis::across;
  double amplitude = 0.06;  ///< m, 0 to 1; 0: the swatch hangs still
  double frequency = 1.2;   ///< Hz, 0.01 to 20
  int frames = 50;          ///< 1 to 10 000
};
/// "across", "along", "up".
std::string_view name_of(CandidateExperiment::Axis axis);

/// Values of experiments, for make_candidates().
struct CandidateFamily {
  std::vector<double> separations{0.6, 0.75, 0.9};
  std::vector<double> amplitudes{0, 0.06};
  std::vector<double> frequencies{1, 2};
  std::vector<CandidateExperiment::Axis> axes{CandidateExperiment::Axis::across};
  std::vector<int> frames{50};
};

/// What may be ranked side by side.
using Candidate = std::variant<CandidateExperiment, CandidateTest, CandidateCapture>;
const std::string& name_of(const Candidate& candidate);

/// All combinations; an amplitude of 0 once only for each separation and number of frames.
std::vector<Candidate> make_candidates(const CandidateFamily& family);
/// What is ranked where nothing else is asked for: default_tests(), or of a fabric of a motion
/// model (fabric.h) a family.
std::vector<Candidate> default_candidates(const Fabric& fabric, const CandidateFamily& family = {});

/// A file of candidates (docs/formats.md). Throws Error with file, line and key.
std::vector<Candidate> read_candidates(const std::filesystem::path& path);

/// The capture that the experiment would give: rig, swatch and frame rate of `like`, whose two
/// fixtures are the clips; the middle between them and the direction of their line at time 0 stay.
/// Throws Error unless `like` has exactly two fixtures, for values out of range, and for a motion
/// that would stretch the line between the clips by more than 10 %.
Capture experiment_capture(const Capture& like, const CandidateExperiment& experiment);

struct SuggestOptions {
  TrialOptions trial;            ///< of videos
  MechanicalOptions mechanical;  ///< of mechanical tests
  /// Whose intervals shall shrink; empty: all of the model.
  std::vector<std::string> targets;
  /// Fisher information that is there already (Uncertainty::information), scaled coordinates, a row
  /// for each parameter of the model; empty: none.
  MatX known;
  /// Noise of a frame of a video, rad^2: twice the variance of a pixel's residual times the number
  /// of pixels that count as one. 0: residuals of 0.1 rad rms, and a patch a sixteenth of the image
  /// wide (40 x 40 of 640 pixels, the width of a fold) counts as one.
  double noise = 0;
  /// Successive frames of a motion that count as one, >= 1. All of a swatch that hangs still do.
  int frames_per_sample = 5;
  double confidence = 0.9;  ///< of the intervals, (0, 1)
  int threads = 0;          ///< 0: all cores; the result does not depend on it
};

/// What an experiment would do for one parameter. Half widths in scaled coordinates, 1 being the
/// range of the search.
struct ExpectedInterval {
  std::string name, unit;
  double value = 0;
  double before = 0, after = 0;  ///< half widths
  double lower = 0, upper = 0;   ///< of the interval after it, in `unit`
};
struct Suggestion {
  Candidate experiment;
  std::vector<ExpectedInterval> parameters;  ///< all of the model
  /// Geometric mean over the targets of after / before: the smaller, the better. 1 where the
  /// simulation diverged.
  double remaining = 1;
  MatX information;     ///< of the experiment alone
  std::string failure;  ///< why it could not be simulated; empty
};
/// After each candidate: done, of how many. False stops; the candidates until then are ranked.
using SuggestObserver = std::function<bool(std::size_t done, std::size_t total)>;

/// Ranks experiments by how much they are expected to shrink the intervals of `fabric`'s
/// parameters, the best first.
///
/// A video is simulated with sensitivities at the fabric as known, and its fold and
/// silhouette residuals are linearized against its own rendered frames: no video is needed. With
/// H_k the Gauss-Newton matrix of frame k (the sum over its pixels of 2 dr dr^T), the Fisher
/// information is
///
///     I = sum over samples of (mean of H_k over the sample's frames) / noise.
///
/// Pixels are not independent, nor are frames: the filters blur, and what the model lacks covers a
/// fold and lasts. `noise` holds the patch of pixels that count as one, and a sample the frames
/// that do. A noise level that is wrong by a factor changes all expected widths by its root, but
/// not their order, unless `known` is large beside the experiments.
///
/// Of a mechanical test I is mechanical_information(), with the areal density of `like` where
/// neither specimen nor fabric state one: its residuals are independent of each other, with the
/// noise that it states.
///
/// To I and `known` comes what the range of the search says: that of a uniform distribution over
/// it, 12 on the diagonal. It keeps the intervals of what no experiment determines finite, at 0.45
/// of the range. The half width is the quantile of the normal distribution times the root of the
/// diagonal of the inverse. All is to first order about `fabric`: how far off the fabric may be,
/// and whether a fit would find it, is not in it. Throws Error, before any simulation, for
/// candidates that cannot be made: of videos as experiment_capture(), of tests as check().
std::vector<Suggestion> suggest_experiments(const Capture& like, const Fabric& fabric,
                                            const std::vector<Candidate>& candidates,
                                            const SuggestOptions& options,
                                            const SuggestObserver& observer = {});

}  // namespace weft
