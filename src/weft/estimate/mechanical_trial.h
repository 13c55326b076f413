#pragma once
/// A mechanical capture made ready to be computed: meshes whose grid lines lie on the clips'
/// borders, the clips at each frame, and where the measured points lie on the mesh.
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "weft/capture/capture.h"
#include "weft/capture/mechanical_capture.h"
#include "weft/dynamics/held_equilibrium.h"
#include "weft/estimate/isolated_strain.h"
#include "weft/fabric/fabric.h"

namespace weft {

struct MechanicalOptions {
  /// Cells of the grid across the shortest free side of the cloth (of the swatch, and of what is
  /// left between clips or beside one), 2 to 200; more where they are finer at a clip. Along the
  /// other side cells are at most twice as wide.
  int cells = 16;
  GridPattern pattern = GridPattern::alternating;  ///< how the quads are split
  StaticOptions statics = static_solver_options();
};

/// Frames in which the clips hold the same regions: one mesh, whose grid lines lie on the borders
/// of the clips.
///
/// At a clip the cloth bends and strains most: cells are a quarter as wide there, and grow by a
/// tenth of the distance. Where a clip reaches across the whole swatch its border has a second line
/// beside it, inside the clip, close to it: the bend at a line belongs to half of the cells on both
/// of its sides (bending.h), of which none should lie in the clip.
///
/// In a picture frame cells are of equal size.
struct MechanicalStage {
  TriangleMesh mesh;
  std::vector<int> frames;
  /// Of measured points, from vertices: 3 points x 3 vertices.
  SparseMatrix points;
  std::vector<char> point_held;  ///< flags of the measured points in a clip
};

struct MechanicalTrial {
  MechanicalCapture capture;
  std::optional<MeasuredGeometry> geometry;
  MechanicalOptions options;
  std::vector<MechanicalStage> stages;
  std::vector<int> stage_of_frame;
  IsolatedStrain isolated_strain;
};
/// Reads the measured shape, where there is one. Throws Error for options out of range, and where
/// the clips do not fit on the mesh.
std::shared_ptr<const MechanicalTrial> prepare_mechanical(const MechanicalCapture& capture,
                                                          const MechanicalOptions& options = {});
/// With `geometry` as the measured shape, or none, whatever files the capture names.
std::shared_ptr<const MechanicalTrial> prepare_mechanical(const MechanicalCapture& capture,
                                                          std::optional<MeasuredGeometry> geometry,
                                                          const MechanicalOptions& options = {});
/// The same on cells of half the width. Throws Error where these would be more than may be.
std::shared_ptr<const MechanicalTrial> refined(const MechanicalTrial& trial);
/// The same on half as many cells along a side, for a search that is far from its end; none where
/// one would have fewer than eight.
std::vector<std::shared_ptr<const MechanicalTrial>> on_half_the_cells(
    std::vector<std::shared_ptr<const MechanicalTrial>> trials);

/// One frame, computed.
struct MechanicalFrame {
  int frame = 0;
  bool converged = false;
  double residual = 0;  ///< N, largest net force on a free vertex
  int iterations = 0;
  Points x;               ///< of the stage's mesh, m
  Points forces;          ///< of the clips on the cloth, or of a crosshead, 3 x fixtures, N
  Points torques;         ///< about the clips' positions, 3 x fixtures, N m
  Points points;          ///< at the measured points, m; no columns without a measured shape
  MatX point_derivative;  ///< 3 points x parameters; empty if not asked for
  MatX force_derivative;  ///< 3 fixtures x parameters; empty if not asked for
  /// As of clip_pose_sensitivities(), with loaded clips following: their columns are zero. Empty if
  /// not asked for.
  MatX pose_derivative;
  /// Of the measured points, 3 points x 6 fixtures; empty if not asked for, without a measured
  /// shape and with loaded clips.
  MatX points_by_poses;
  std::vector<Clip> clips;  ///< one a fixture; loaded ones as found; of a picture frame as captured
  /// Of loaded clips, zero for others, moves (clip_poses.h): 6 fixtures x parameters, and by the
  /// poses of held clips 6 fixtures x 6 fixtures; empty if not asked for, and without loaded clips.
  MatX clip_derivative, clips_by_poses;
  /// m, of an overhang test: where the strip reaches its angle (computed_overhang.h). No number for
  /// other tests, and where there is none.
  double overhang = std::numeric_limits<double>::quiet_NaN();
  VecX overhang_derivative;  ///< by the parameters; empty if not asked for
  bool inexact = false;      ///< derivatives of a matrix that had to be made positive definite
};

/// All: by the parameters. Poses: of the forces and of loaded clips, by the poses of the clips.
enum class MechanicalDerivatives { none, all, poses };

/// Of each trial all frames.
using MechanicalFrames = std::vector<std::vector<MechanicalFrame>>;

/// Of each trial and frame the moves (clip_poses.h) of its clips from where they are captured to
/// where they are, 6 a fixture; empty: none.
using ClipMoves = std::vector<std::vector<VecX>>;

/// All frames of all trials with `fabric`. With `near`, each starts from the shape that it has
/// there: from the equilibrium of a similar fabric in the same trials, or, where it did not
/// converge, from a start like any other. Otherwise a frame with a measured shape starts
/// from it; otherwise the first starts between the clips (blend_of_clips) and each later one where
/// the one before ended, moved along with the clips. A frame without equilibrium holds what was
/// reached. Internal friction goes along from frame to frame, from flat before the first; where the
/// clips hold other regions than before, and so on another mesh, it starts from flat again.
///
/// In a picture frame all vertices are where the bars have them in an even shear, at which sheets
/// are at rest on any mesh: flat, as threads are that the clamps keep taut. Other equilibria, those
/// with wrinkles, are not looked for. The force is the derivative of the energy by the way of the
/// crosshead.
///
/// The frames of an overhang test, one a reading, are the same: the strip at the mean of what was
/// read, and the overhang at which it reaches the angle of the test.
///
/// `moves`: of clips between which cloth hangs; null: none.
///
/// Results do not depend on the number of threads. Throws Error where the model refuses the values.
MechanicalFrames simulate_mechanical(
    const std::vector<std::shared_ptr<const MechanicalTrial>>& trials, const Fabric& fabric,
    MechanicalDerivatives derivatives = MechanicalDerivatives::none, int threads = 0,
    const MechanicalFrames* near = nullptr, const ClipMoves* moves = nullptr);

/// Shapes of `from` at the vertices of other meshes of the same captures: starts, not converged.
MechanicalFrames starts_between(const std::vector<std::shared_ptr<const MechanicalTrial>>& trials,
                                const MechanicalFrames& from,
                                const std::vector<std::shared_ptr<const MechanicalTrial>>& to);

/// How far loaded clips are from where they were measured to be: root mean squares of the length of
/// the shift and of the turn.
struct PoseDistance {
  double position_rms = 0;  ///< m
  double rotation_rms = 0;  ///< rad
  int count = 0;            ///< clips, in as many frames
};

/// How far a frame's forces, shape and loaded clips are from the measured ones.
struct MechanicalDifference {
  int frame = 0;
  bool converged = false;
  double residual = 0;       ///< N
  double force_rms = 0;      ///< N, over the measured components
  double force_max = 0;      ///< N, largest difference of a component
  int force_count = 0;       ///< measured components
  SurfaceDistance distance;  ///< m, over the measured points outside the clips
  int point_count = 0;       ///< of these
  PoseDistance pose;
  /// m, of an overhang test: computed less this reading; no number for other tests.
  double overhang = std::numeric_limits<double>::quiet_NaN();
};
/// How far the computed overhang is from the readings of a test.
struct OverhangDifference {
  double measured = 0;  ///< m, mean of the readings
  double computed = 0;  ///< m; no number without one
  double rms = 0;       ///< m, of computed less measured over the readings
};
struct MechanicalEvaluation {
  std::vector<MechanicalDifference> frames;
  double largest_force = 0;   ///< N, of the measured ones: largest length of a clip's force
  double force_rms = 0;       ///< N, over all frames
  double force_relative = 0;  ///< force_rms / largest_force; 0 where nothing was measured
  int force_count = 0;
  SurfaceDistance distance;  ///< over all frames: mean of all, root of mean square, largest
  int point_count = 0;
  PoseDistance pose;                           ///< over all frames
  std::optional<OverhangDifference> overhang;  ///< of an overhang test
  int not_converged = 0;                       ///< frames
};
MechanicalEvaluation compare_mechanical(const MechanicalTrial& trial,
                                        const std::vector<MechanicalFrame>& frames);

}  // namespace weft
