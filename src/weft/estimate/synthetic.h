#pragma once
#include <filesystem>

#include "weft/capture/capture.h"
#include "weft/dynamics/simulate.h"
#include "weft/estimate/problem.h"
#include "weft/fabric/fabric.h"
#include "weft/optics/render.h"

namespace weft {

/// A rig and a swatch held by its two top corners, that needs no measured capture: a camera in
/// front and a projector above it to the left, as Bhat 2003, section 7, describes the set-up.
struct LayoutOptions {
  double width = 0.5, height = 0.5;           ///< swatch, m
  double areal_density = 0.2;                 ///< kg/m^2
  double separation = 0.75;                   ///< of the corners, of the width; (0.1, 1]
  int image_width = 640, image_height = 480;  ///< px
  double stripe_period = 0.018;               ///< m on the swatch, about
  double frame_rate = 30;
  int frame_count = 50;
  int fit_frames = 50;  ///< the first ones
  /// The waving test: the right corner moves back and forth, starting from rest. 0: static test.
  double wave_amplitude = 0.06;  ///< m
  double wave_frequency = 1.2;   ///< Hz
};
Capture make_layout(const LayoutOptions& options = {});

/// How the truth is made: on another mesh and with finer time steps than a fit uses, and with
/// noise, so that recovering the parameters is not a comparison of a program with itself.
struct SyntheticOptions {
  static SimulationOptions with_steps_per_frame(int steps) {
    SimulationOptions options;
    options.steps_per_frame = steps;
    return options;
  }

  int columns = 37, rows = 37;
  GridPattern pattern = GridPattern::uniform;
  SimulationOptions simulation = with_steps_per_frame(16);
  RenderOptions render;
  SensorNoise noise;
  bool with_noise = true;
  bool as_images = true;  ///< numbered PNG; otherwise H.264
  int start_shape = 0;    ///< index into generic_starts()
  std::uint64_t seed = 1;
  int threads = 0;
};
/// Simulates `fabric` in `layout` (its rig, swatch, motion and frames; its video and truth are
/// ignored), renders what the camera sees, adds noise and writes a capture folder with the truth.
/// Returns what read_capture reads back. Throws Error if the simulation diverges.
Capture make_synthetic_capture(const std::filesystem::path& folder, const Capture& layout,
                               const Fabric& fabric, const SyntheticOptions& options = {});

/// The trial that prepare_trial() would make of the fit frames of such a capture, without its files
/// and with the true first frame (at the same (u, v)) as the start of the motion: for studies in
/// which the surface of the first frame is not the question. Throws Error if the simulation
/// diverges and for a grid or frames out of range.
std::shared_ptr<const Trial> simulate_trial(const Capture& layout, const Fabric& fabric,
                                            const TrialOptions& options,
                                            const SyntheticOptions& truth = {});

}  // namespace weft
