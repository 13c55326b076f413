#pragma once
/// A rig that needs no measured capture: the seven tests of Miguel et al. 2012, section 3.2, on a
/// square of cloth, computed, with the noise of section 3.3.
///
/// Cloth lies in the plane z = 0, u along x and v along y, gravity along -z. Bars are 5 mm deep.
/// Five tests are for fits:
/// - weft_stretch, warp_stretch: bars along two opposite edges move apart;
/// - shear: bars along the middle 80 % of each edge move outwards until the cloth is in tension
///   along both threads, so that it does not wrinkle, then turn as a four-bar linkage;
/// - weft_bend, warp_bend: a table, pushed back frame by frame, that holds all cloth above it; no
///   forces;
/// and two for evaluation:
/// - complex_shear: bars along the edges u = 0 and u = side slide along themselves in opposite
///   directions, and the cloth between them buckles;
/// - corner_pull: squares of 10 mm at the corners; one diagonal pair is pulled apart and let go,
///   then the other one.
///
/// How far: until the cloth between the bars, were it strained evenly, answers with
/// `largest_force` on a bar, but no further than `largest_strain` or `largest_shear`. Frames load
/// in equal steps and unload through the same ones, with a frame before and one after each turn.
///
/// With StretchDrive::known_forces the first bar of a stretch test is held and the other one, of 2
/// g, hangs in two cords from its ends over pulleys 0.5 m away at the height of the first bar.
/// Their tensions go in the same steps, without the one of no load, up to what the cloth would
/// answer with; where the bar is then is measured, no force is.
#include <span>
#include <string_view>

#include "weft/capture/mechanical_capture.h"
#include "weft/estimate/mechanical_trial.h"
#include "weft/fabric/fabric.h"

namespace weft {

enum class RigTest {
  weft_stretch,
  warp_stretch,
  shear,
  weft_bend,
  warp_bend,
  complex_shear,
  corner_pull
};
/// "stretch_weft", "stretch_warp", "shear", "bend_weft", "bend_warp", "complex_shear",
/// "corner_pull".
std::string_view name_of(RigTest test);
/// Throws Error for another name.
RigTest rig_test_from_name(std::string_view name);
std::span<const RigTest> rig_tests();      ///< all seven
std::span<const RigTest> rig_fit_tests();  ///< the first five

struct RigNoise {
  double points = 75e-6;  ///< m, standard deviation of a coordinate of a measured point; >= 0
  /// m, of a coordinate of a clip's position, and of the shift of the ends of a bar that its
  /// rotation makes; a clip is located by some dozens of points of its codes, 36 here. >= 0, at
  /// most 0.01. Captures state it.
  double clips = 75e-6 / 6;
  double forces = 3e-3;  ///< N, of a component; >= 0
  /// N, width of the loop that friction of the cords puts between loading and unloading; >= 0. A
  /// clip that moves reads half of it more along its way; so does one that has just turned, along
  /// the way that it will go. Above zero, captures with forces say that cords drive them.
  double cord_friction = 0.1;
};

/// How the stretch tests are driven.
enum class StretchDrive {
  known_ways,   ///< bars are moved, and their forces measured
  known_forces  ///< a bar is pulled, and its pose measured
};

struct RigOptions {
  static MechanicalOptions truth_mesh() {
    MechanicalOptions options;
    options.cells = 24;
    options.pattern = GridPattern::uniform;
    return options;
  }

  double side = 0.1;               ///< m, 0.05 to 1
  double largest_force = 10;       ///< N, > 0
  double largest_strain = 0.3;     ///< elongation, (0, 1]
  double largest_shear = 0.26;     ///< rad, (0, 0.5]
  double least_overhang = 0.02;    ///< m, of bend tests
  double largest_overhang = 0.08;  ///< m, above the least, at most side - 5 mm
  int steps = 8;  ///< frames from rest to the largest load, 1 to 1000; overhangs of a bend test
  StretchDrive stretch_drive = StretchDrive::known_ways;
  int loops = 1;         ///< loading and unloading, 1 to 100
  int point_lines = 31;  ///< measured points along each side, 2 to 400
  /// Of the truth: with all quads split alike, so not the mesh of a fit.
  MechanicalOptions mesh = truth_mesh();
  RigNoise noise;
  std::uint64_t seed = 1;
  int threads = 0;
};

/// What a rig would be told to do with this fabric: clips frame by frame, no measured forces, no
/// shape; loaded clips where they would be, were the cloth strained evenly and without weight. The
/// fabric has an areal density. Throws Error for a fabric without, of a model without components
/// along the threads ("stvk" and those with weft_stretch have them), and options out of range.
MechanicalCapture rig_layout(RigTest test, const Fabric& fabric, const RigOptions& options = {});

struct RigMeasurement {
  MechanicalCapture capture;
  MeasuredGeometry geometry;
  /// Before the noise: what the clips' forces were, one matrix a fixture, 3 x frames, N.
  std::vector<Points> true_forces;
  /// The same of the poses of all clips, by fixture and frame.
  std::vector<std::vector<Clip>> true_clips;
};
/// The layout, computed and measured. Deterministic whatever the number of threads. Throws Error
/// where a frame has no equilibrium. Frames of equal clips are computed once unless the fabric has
/// internal friction.
RigMeasurement simulate_rig(RigTest test, const Fabric& fabric, const RigOptions& options = {});

/// The same as a capture folder, with the fabric as the note on the truth; returns what
/// read_mechanical_capture reads back.
MechanicalCapture make_rig_capture(const std::filesystem::path& folder, RigTest test,
                                   const Fabric& fabric, const RigOptions& options = {});

}  // namespace weft
