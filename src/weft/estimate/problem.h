#pragma once
#include <memory>
#include <string>
#include <vector>

#include "weft/capture/capture.h"
#include "weft/dynamics/simulate.h"
#include "weft/fabric/fabric.h"
#include "weft/objective/fold_metric.h"

namespace weft {

/// How a capture is looked at and simulated; one set for all captures of a fit.
struct TrialOptions {
  int columns = 25, rows = 25;       ///< vertices of the simulated swatch
  AngleMapOptions angle_map;
  SimulationOptions simulation;
  RenderOptions render;
  double alpha = 0.1;                ///< weight of the silhouette (equation 8)
};

/// A capture made ready: scene with its start, and the features of each measured frame. Immutable, so
/// shared by all threads.
struct Trial {
  Capture capture;
  Scene scene;                          ///< frames first..last
  std::vector<FrameFeatures> features;  ///< one a scene frame
  std::string start_name;               ///< "measured surface", or the start shape that was chosen
  TrialOptions options;
  int first_frame = 0;                  ///< of the capture
};

/// Reads video and motion of frames first..last and prepares them. `fit` uses the fit frames;
/// evaluation uses all.
std::shared_ptr<const Trial> prepare_trial(const Capture& capture, int first, int last,
                                           const TrialOptions& options, int threads = 0);

/// The error of one fabric on one trial.
struct TrialEvaluation {
  std::vector<FrameError> frames;  ///< frames that were compared; fewer than asked if diverged
  bool diverged = false;
  std::string divergence;
  double wall_s = 0;
  /// Equations 8 and 9, per frame; infinity if diverged.
  double error = 0;
  double fold = 0;
  double silhouette = 0;
  /// error divided by the mean of the masked pixel count: comparable between captures.
  double error_per_mask_pixel = 0;
};

/// Simulates and compares the first `frame_count` frames of the trial (0: all). If `trajectory` is not
/// null it receives the simulated motion. Pure: the same for the same arguments on any thread.
TrialEvaluation evaluate(const Trial& trial, const Fabric& fabric, int frame_count = 0,
                         Trajectory* trajectory = nullptr);

/// What an optimizer sees: free parameters of a fabric in scaled coordinates [0, 1], and the sum of
/// the trials' errors.
class Problem {
 public:
  /// `free` names the parameters that are searched; the others stay at their value in `initial`.
  /// Throws Error for unknown names, none, or no trial.
  Problem(std::vector<std::shared_ptr<const Trial>> trials, Fabric initial,
          std::vector<std::string> free);
  int dimension() const { return static_cast<int>(free_.size()); }
  const std::vector<std::string>& free() const { return free_; }
  const std::vector<std::shared_ptr<const Trial>>& trials() const { return trials_; }
  const Fabric& initial() const { return initial_; }
  const ParameterInfo& info(int i) const;
  /// Scaled coordinates of a fabric's free parameters, and back (clamped to [0, 1] by the caller).
  VecX scaled(const Fabric& fabric) const;
  Fabric fabric(const VecX& scaled) const;

 private:
  std::vector<std::shared_ptr<const Trial>> trials_;
  Fabric initial_;
  std::vector<std::string> free_;
  std::vector<int> indices_;
};

}  // namespace weft
