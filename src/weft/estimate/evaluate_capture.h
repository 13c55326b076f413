#pragma once
#include <optional>
#include <vector>

#include "weft/estimate/problem.h"

namespace weft {

/// How well a fabric explains a capture: fit frames and later ones apart.
struct CaptureEvaluation {
  struct Frame {
    int frame = 0;  ///< of the capture
    FrameError error;
    double total = 0;                         ///< equation 8
    std::optional<SurfaceDistance> distance;  ///< m; where truth was asked for and exists
  };
  struct Part {
    int first = 0, last = 0;  ///< frames of the capture, inclusive
    double error = 0;         ///< per frame, averaged (equations 5, 6 and 8); infinity if the
                              ///< simulation diverged before the last of these frames
    double fold = 0;
    double silhouette = 0;
    double error_per_mask_pixel = 0;
    /// Over these frames: mean of the means, root of the mean square, largest; m.
    std::optional<SurfaceDistance> distance;
  };
  Part fit;
  std::optional<Part> validation;  ///< frames after the fit frames, where there are any
  std::vector<Frame> frames;       ///< of both parts; fewer if the simulation diverged
  bool diverged = false;
  std::string divergence;
  std::string start_name;
  double wall_s = 0;
};

/// Whether the capture's truth is opened, if it has one, and the distance to it measured. A fit
/// never does that.
enum class TruthDistance { left_out, included };

/// `trial` must hold the capture's fit frames and, for a validation part, later ones: prepare it
/// with prepare_trial(capture, capture.fit_first, capture.frame_count - 1, options).
CaptureEvaluation evaluate_capture(const Trial& trial, const Fabric& fabric, TruthDistance distance,
                                   int threads = 0, Trajectory* trajectory = nullptr);

}  // namespace weft
