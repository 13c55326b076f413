#pragma once
/// Cloth between rigid clips of which some are not held: cords pull them with known forces, and
/// they are where cloth, cords and weight are in balance (Miguel et al. 2012, section 3.2).
#include <memory>
#include <optional>
#include <vector>

#include "weft/dynamics/clip_poses.h"

namespace weft {

/// A cord that is tied to a clip and pulls with a known force.
struct Cord {
  Vec3 at{0, 0, 0};  ///< where it is tied, m, in the clip's frame, from the region's centre
  /// N, in the world's axes: of a constant direction, as of a weight; not of a cord to a pulley.
  Vec3 force{0, 0, 0};
  std::optional<Vec3> pulley;  ///< m, where the cord runs to
  double tension = 0;          ///< N, of a cord to a pulley; >= 0
};

/// What acts on a clip beside the cloth.
struct ClipLoad {
  std::vector<Cord> cords;
  double mass = 0;  ///< of the clip itself, kg, at its position; >= 0
};

/// Potential of a load, to second order in a move of the clip (clip_poses.h): with the point c = p
/// + R at of each cord -F c, or T |c - pulley|, and -m g p of the mass.
struct LoadPotential {
  double value = 0;              ///< J
  Vec6 gradient = Vec6::Zero();  ///< N and N m; less this: the force and torque of the load
  Mat6 hessian = Mat6::Zero();   ///< of a move exp([turn]) about world axes
};
LoadPotential potential_of(const ClipLoad& load, const Clip& clip, const Vec3& gravity);

struct LoadedEquilibrium {
  /// Converged: also the clips. Residual: also of these, the largest net force, or net torque over
  /// half of the longer side.
  ClipEquilibrium cloth;
  std::vector<Clip> clips;  ///< all: where held ones are and loaded ones were found
};

struct LoadedSensitivities {
  MatX x;       ///< 3 vertices x parameters, m per unit
  MatX forces;  ///< 3 clips x parameters, N per unit
  /// 6 clips x parameters, moves (m and rad) per unit; zero for clips that are held.
  MatX poses;
  bool inexact = false;  ///< a matrix had to be made positive definite
};

/// By the poses of the clips that are held; columns of the others are zero.
struct LoadedPoseSensitivities {
  MatX forces;  ///< 3 clips x 6 clips, as clip_pose_sensitivities()
  MatX poses;   ///< 6 clips x 6 clips: moves of the loaded clips; rows of held ones are zero
};

/// Minimizes over the poses q of the loaded clips the reduced energy
///
///     P(q) = min over x of E(x; q) + potentials of the loads.
///
/// Its gradient is the net force and torque on these clips; its Hessian
///
///     M^T (K_cc - K_cf K_ff^-1 K_fc) M + sum over vertices (g r^T + r g^T) / 2 - (g r) I
///
/// and those of the loads: M the moves of the vertices by the clips', g the force that holds a
/// vertex and r its arm, in the block of the turns. Newton steps in a trust region on P, of which
/// negative curvature is taken as positive, so that it goes down; the Hessian serves as long as it
/// lowers the net forces fivefold a step. Turns are weighed by half of the clip's longer side.
///
/// Keeps a reference to the cloth, which must not change between the calls.
class LoadedCloth {
 public:
  /// `loads`: one a clip; none for a clip that is held where `clips` has it. `like`: null, or as in
  /// StaticSystem. Throws Error as clip_of_vertices(), and where no clip is held, or none is
  /// loaded.
  LoadedCloth(const HeavyCloth& cloth, std::vector<Clip> clips,
              std::vector<std::optional<ClipLoad>> loads, const StaticSystem* like = nullptr);
  ~LoadedCloth();

  /// Where the loaded clips are in `x`, 3 x vertices; held ones stay.
  std::vector<Clip> clips_of_shape(const Points& x) const;

  /// A stable equilibrium near `start` (3 x vertices) and the poses `from` of the loaded clips (of
  /// held ones those of the constructor count). Ends where the net force on every loaded clip is
  /// below options.force_tolerance, or cannot be lowered and is below 100 times that, as the cloth
  /// leaves some of its own on many vertices. Without convergence, what was reached.
  LoadedEquilibrium solve(Points start, const std::vector<Clip>& from,
                          const StaticOptions& options = {});

  /// Derivatives of an equilibrium by all parameters of the model, by the implicit function
  /// theorem twice: of the cloth with the clips held as clip_sensitivities() has them, and of the
  /// poses with the net forces R, dq = -(dR/dq)^-1 dR/dparameters. `history_derivative` as there.
  LoadedSensitivities sensitivities(const LoadedEquilibrium& found,
                                    const MatX& history_derivative = {});
  LoadedPoseSensitivities pose_sensitivities(const LoadedEquilibrium& found);

 private:
  struct Place;
  struct Stiffness;
  Place place_at(std::vector<Clip> clips, Points start, const StaticOptions& options);
  Stiffness stiffness_at(const Place& place);
  Place place_of(const LoadedEquilibrium& found) const;
  VecX scales() const;
  Place moved(const Place& here, const Stiffness& stiffness, const VecX& move,
              const StaticOptions& options);
  bool step(const Stiffness& stiffness, const StaticOptions& options, double& radius, Place& here);
  bool escape(const Stiffness& stiffness, const StaticOptions& options, Place& here);
  double least_half() const;
  MatX of_all_clips(const MatX& moves) const;
  MatX net_forces(const MatX& of_vertices, const Points& x, const std::vector<Clip>& clips) const;

  const HeavyCloth& cloth_;
  std::vector<Clip> clips_;
  std::vector<std::optional<ClipLoad>> loads_;
  std::vector<int> clip_of_;
  std::vector<std::size_t> loaded_;  ///< clips with loads
  std::unique_ptr<StaticSystem> system_;
};

}  // namespace weft
