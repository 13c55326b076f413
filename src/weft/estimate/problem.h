#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "weft/capture/capture.h"
#include "weft/dynamics/simulate.h"
#include "weft/estimate/least_squares.h"
#include "weft/fabric/fabric.h"
#include "weft/fabric/prior.h"
#include "weft/objective/fold_metric.h"

namespace weft {

/// How a capture is looked at and simulated; one set for all captures of a fit.
struct TrialOptions {
  int columns = 41, rows = 41;  ///< vertices of the simulated swatch, 2 to 1000
  AngleMapOptions angle_map;
  SimulationOptions simulation;
  RenderOptions render;
  double alpha = 0.1;  ///< weight of the silhouette (equation 8), >= 0
};

/// A capture made ready: scene with its start, and the features of each measured frame. Immutable,
/// so shared by all threads.
struct Trial {
  Capture capture;
  /// From frame 0 of the capture, where it hangs at rest, to the last frame that is compared.
  Scene scene;
  /// One a compared frame: features[i] belongs to scene frame first_frame + i. The strength of the
  /// angle maps, which the comparison does not use, is not kept (0 x 0).
  std::vector<FrameFeatures> features;
  std::string start_name;     ///< "measured surface", or the start shape that was chosen
  std::string start_note;     ///< why the measured surface was not usable; may be empty
  double start_residual = 0;  ///< m, median distance of decoded points to the measured surface
  /// Further surfaces that explain frame 0 (SurfaceFit::others), for with_start_for().
  std::vector<Points> other_starts;
  TrialOptions options;
  int first_frame = 0;  ///< of the capture; frames before it are simulated, not compared
  int frame_count() const { return static_cast<int>(features.size()); }
};

/// Reads video and motion of frames first..last and prepares them. `fit` uses the fit frames;
/// evaluation uses all. Throws Error for frames outside the video and what read_video throws.
///
/// Settling starts at the surface measured in frame 0 (decode_stripes, fit_surface). If that is not
/// usable each generic start settles under the default fabric, and the one with the smallest error
/// in the first compared frame is taken and named.
///
/// With `cache_folder` the features and the start are kept there, in one file for each different
/// combination of video, capture.toml values and options (docs/formats.md); a file that is damaged
/// or of another version is made again. The folder is created; a folder that cannot be written is
/// an Error. The trial is the same, bit by bit, with and without the cache.
std::shared_ptr<const Trial> prepare_trial(const Capture& capture, int first, int last,
                                           const TrialOptions& options, int threads = 0,
                                           const std::filesystem::path& cache_folder = {});

/// The error of one fabric on one trial.
struct TrialEvaluation {
  std::vector<FrameError> frames;  ///< frames that were compared; fewer than asked if diverged
  bool diverged = false;
  std::string divergence;
  double wall_s = 0;
  double simulation_s = 0;  ///< part of wall_s
  /// Equations 8 and 9, per frame; infinity if diverged.
  double error = 0;
  double fold = 0;
  double silhouette = 0;
  /// error divided by the mean of the masked pixel count: comparable between captures. The count is
  /// that of the measured frames, so it is the same for all fabrics; at least 1.
  double error_per_mask_pixel = 0;
};

/// Simulates and compares the first `frame_count` compared frames of the trial (0: all). If
/// `trajectory` is not null it receives the simulated motion, from frame 0. Pure: the same for the
/// same arguments on any thread and for any number of `threads` (0: all cores), which share the
/// rendering and comparing of frames.
TrialEvaluation evaluate(const Trial& trial, const Fabric& fabric, int frame_count = 0,
                         Trajectory* trajectory = nullptr, int threads = 1);

/// Renders and filters one simulated shape as the trial's camera sees it: for reports.
struct SimulatedFrame {
  RenderedFrame image;
  AngleMap angles;
};
SimulatedFrame look_at(const Trial& trial, const Points& x);

/// The error of one fabric on all trials of a problem.
struct ProblemEvaluation {
  /// What a search minimizes: the mean over the trials of error_per_mask_pixel, rad^2; infinity if
  /// a simulation diverged. Divided by the masked pixels of each trial, a capture with a larger
  /// image or more folds weighs no more than another, and a long one no more than a short one. For
  /// a single trial it is the paper's error times a constant, so the minimum is the paper's.
  double error = 0;
  /// Means over the trials of the errors per frame (equations 5, 6 and 8): the paper's numbers.
  double error_per_frame = 0, fold = 0, silhouette = 0;
  bool diverged = false;
  double wall_s = 0;
};
/// A stand-in for simulating and comparing (another program, a test); frame_count as in evaluate().
/// Must be pure; called from several threads at once.
using Evaluator = std::function<ProblemEvaluation(const Fabric& fabric, int frame_count)>;

/// Data besides the trials, as minus the logarithm of their likelihood without its constant: a
/// function of the free parameters in scaled coordinates. Pure; called from several threads.
struct OtherData {
  std::function<double(const VecX& scaled)> cost;  ///< infinity where it cannot be computed
  std::function<QuadraticModel(const VecX& scaled)> linearize;
};

/// What an optimizer sees: free parameters of a fabric in scaled coordinates [0, 1], and the sum of
/// the trials' errors.
class Problem {
 public:
  /// `free` names the parameters that are searched; the others stay at their value in `initial`.
  /// A prior of a parameter that is not free has no effect. `other` has both functions or none.
  /// Throws Error for unknown names, a name
  /// listed twice, none, or no trial.
  Problem(std::vector<std::shared_ptr<const Trial>> trials, Fabric initial,
          std::vector<std::string> free, Evaluator evaluator = {},
          std::vector<ParameterPrior> priors = {}, OtherData other = {});
  /// The same with other trials: of the same captures, say, with other starts.
  Problem with_trials(std::vector<std::shared_ptr<const Trial>> trials) const;
  int dimension() const { return static_cast<int>(free_.size()); }
  const std::vector<std::string>& free() const { return free_; }
  const std::vector<std::shared_ptr<const Trial>>& trials() const { return trials_; }
  const Fabric& initial() const { return initial_; }
  /// Name, unit and range of free parameter i; the range is that of the initial fabric.
  const ParameterInfo& info(int i) const { return infos_[static_cast<std::size_t>(i)]; }
  /// Position of a parameter among the free ones, -1 if it is not free.
  int index_of(std::string_view parameter) const;
  /// Scaled coordinates of a fabric's free parameters, and back (clamped to [0, 1] by the caller).
  VecX scaled(const Fabric& fabric) const;
  Fabric fabric(const VecX& scaled) const;
  /// What is known before the data. It is no part of ProblemEvaluation::error nor of
  /// ProblemCost::cost, which are of the data alone: a fit adds it to them with a weight, the noise
  /// level that makes the data's cost a logarithm of a likelihood (cluster_dispersion()).
  const std::vector<ParameterPrior>& priors() const { return priors_; }
  /// Mean in scaled coordinates, and 1 / variance, 0 where there is no prior.
  const VecX& prior_mean() const { return prior_mean_; }
  const VecX& prior_precision() const { return prior_precision_; }
  const OtherData& other() const { return other_; }
  /// Is there anything besides the trials' data?
  bool has_prior() const { return !priors_.empty() || other_.cost; }
  /// What is known besides the trials, sum (scaled - mean)^2 precision / 2 and the other data's
  /// cost: minus the logarithm of a density, without its constant; times `weight`. 0 where nothing
  /// is known or the weight is 0.
  double prior_cost(const VecX& scaled, double weight = 1) const;
  /// The same with gradient and Gauss-Newton matrix, for the weight 1; these two do not have the
  /// other data's part where its cost is infinite.
  QuadraticModel prior_model(const VecX& scaled) const;
  /// Identifies the trials and their options by content: two problems with the same fingerprint
  /// give the same error for the same fabric. 16 hexadecimal digits.
  const std::string& fingerprint() const { return fingerprint_; }
  const Evaluator& evaluator() const { return evaluator_; }  ///< empty: simulate and compare

 private:
  std::vector<std::shared_ptr<const Trial>> trials_;
  Fabric initial_;
  std::vector<std::string> free_;
  std::vector<int> indices_;
  std::vector<ParameterInfo> infos_;
  std::vector<ParameterPrior> priors_;
  OtherData other_;
  VecX prior_mean_, prior_precision_;
  std::string fingerprint_;
  Evaluator evaluator_;
};

/// Of the problem's own evaluator, if it has one. For a trial with fewer frames than `frame_count`
/// all its frames count. `threads` as for a trial.
ProblemEvaluation evaluate(const Problem& problem, const Fabric& fabric, int frame_count = 0,
                           int threads = 1);

}  // namespace weft
