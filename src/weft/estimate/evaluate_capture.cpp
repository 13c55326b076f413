#include "weft/estimate/evaluate_capture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "weft/base/error.h"
#include "weft/base/parallel.h"

namespace weft {
namespace {

using Frame = CaptureEvaluation::Frame;
using Part = CaptureEvaluation::Part;

SurfaceDistance summarize(const std::vector<const Frame*>& frames) {
  SurfaceDistance sum;
  for (const Frame* frame : frames) {
    sum.mean += frame->distance->mean;
    sum.rms += frame->distance->rms * frame->distance->rms;
    sum.max = std::max(sum.max, frame->distance->max);
  }
  sum.mean /= double(frames.size());
  sum.rms = std::sqrt(sum.rms / double(frames.size()));
  return sum;
}

/// The frames first..last of the capture.
Part summarize(const std::vector<Frame>& all, int first, int last, double alpha) {
  Part part;
  part.first = first;
  part.last = last;
  std::vector<const Frame*> frames;
  for (const Frame& frame : all)
    if (frame.frame >= first && frame.frame <= last) frames.push_back(&frame);
  if (static_cast<int>(frames.size()) < last - first + 1) {
    part.error = part.fold = part.silhouette = part.error_per_mask_pixel = kInfinity;
  } else {
    double mask_pixels = 0;
    for (const Frame* frame : frames) {
      part.fold += frame->error.fold;
      part.silhouette += frame->error.silhouette;
      mask_pixels += frame->error.mask_pixels;
    }
    const auto count = double(frames.size());
    part.fold /= count;
    part.silhouette /= count;
    part.error = part.fold + alpha * part.silhouette;
    part.error_per_mask_pixel = part.error / std::max(1.0, mask_pixels / count);
  }
  if (!frames.empty() && frames.front()->distance) part.distance = summarize(frames);
  return part;
}

}  // namespace

CaptureEvaluation evaluate_capture(const Trial& trial, const Fabric& fabric, TruthDistance distance,
                                   int threads, Trajectory* trajectory) {
  const Capture& capture = trial.capture;
  const int last = trial.first_frame + trial.frame_count() - 1;
  if (trial.first_frame > capture.fit_first || last < capture.fit_last)
    throw Error(fmt::format("{}: the trial has frames {} to {}, the fit frames are {} to {}",
                            capture.name, trial.first_frame, last, capture.fit_first,
                            capture.fit_last));
  Trajectory motion;
  const TrialEvaluation evaluation = evaluate(trial, fabric, 0, &motion, threads);
  CaptureEvaluation result;
  result.diverged = evaluation.diverged;
  result.divergence = evaluation.divergence;
  result.start_name = trial.start_name;
  result.wall_s = evaluation.wall_s;
  for (std::size_t i = 0; i < evaluation.frames.size(); ++i) {
    Frame& frame = result.frames.emplace_back();
    frame.frame = trial.first_frame + static_cast<int>(i);
    frame.error = evaluation.frames[i];
    frame.total = frame.error.total(trial.options.alpha);
  }
  if (distance == TruthDistance::included && capture.truth) {
    const TruthSurface truth = read_truth(capture);
    parallel_for(result.frames.size(), threads, [&](std::size_t i) {
      Frame& frame = result.frames[i];
      frame.distance =
          distance_to_truth(trial.scene.mesh, motion.frames[static_cast<std::size_t>(frame.frame)],
                            truth, frame.frame);
    });
  }
  const double alpha = trial.options.alpha;
  result.fit = summarize(result.frames, capture.fit_first, capture.fit_last, alpha);
  if (last > capture.fit_last)
    result.validation = summarize(result.frames, capture.fit_last + 1, last, alpha);
  if (trajectory) *trajectory = std::move(motion);
  return result;
}

}  // namespace weft
