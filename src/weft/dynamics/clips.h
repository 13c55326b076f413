#pragma once
/// Cloth held by rigid clips, at rest: equilibrium, the forces of the clips, and the derivatives of
/// both by the parameters of the material (Miguel et al. 2012, section 5.1, equations 7 and 8).
#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "weft/dynamics/static_potential.h"
#include "weft/model/elastic_model.h"

namespace weft {

class StaticSystem;

/// A rectangle of the undeformed swatch, (u, v), m.
struct MaterialRectangle {
  Vec2 lower{0, 0}, upper{0, 0};

  Vec2 center() const { return 0.5 * (lower + upper); }
  /// Closed, and wider by 1e-7 m for coordinates that were rounded.
  bool contains(const Vec2& uv) const;
  /// 0 inside, m.
  double distance(const Vec2& uv) const;
  bool operator==(const MaterialRectangle&) const = default;
};

/// A clip at one moment. What it holds is flat and undeformed: the cloth at (u, v) is at
/// position + rotation (u - u_c, v - v_c, 0), with (u_c, v_c) the centre of the region.
struct Clip {
  MaterialRectangle region;
  Vec3 position{0, 0, 0};  ///< of the region's centre, m
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();

  Vec3 place(const Vec2& uv) const;
};

/// Which clip holds a vertex: its index, or -1 where none does. Throws Error for a vertex in two
/// clips, and for a clip with fewer than two vertices (it would be a hinge).
std::vector<int> clip_of_vertices(const TriangleMesh& mesh, const std::vector<Clip>& clips);

/// Between the clips, where each of them would have the point, weighted by the inverse square of
/// its distance on the undeformed swatch: a start where no shape is known. 3 x points.
Points blend_of_clips(const MaterialPoints& material, const std::vector<Clip>& clips);

/// An elastic model with lumped masses under gravity. Keeps a reference to the model.
class HeavyCloth : public StaticPotential {
 public:
  /// `areal_density` kg/m^2, `gravity` m/s^2. Throws Error unless the density is above 0 and
  /// finite.
  HeavyCloth(const ElasticModel& model, double areal_density, const Vec3& gravity);

  double value(const Points& x) const override;
  void gradient(const Points& x, Points& gradient) const override;
  void hessian(const Points& x, HessianKind kind, Points& gradient,
               SparseMatrix& hessian) const override;
  const SparseMatrix& hessian_pattern() const override { return model_.hessian_pattern(); }
  const VecX& masses() const override { return masses_; }
  const TriangleMesh& mesh() const override { return model_.mesh(); }
  const ElasticModel& model() const { return model_; }
  const Vec3& gravity() const { return gravity_; }  ///< m/s^2

 private:
  const ElasticModel& model_;
  VecX masses_;
  Vec3 gravity_;
};

struct ClipEquilibrium {
  Points x;
  /// Force and torque (about the clip's position) that each clip exerts on the cloth, which include
  /// what carries the weight of the cloth in the clip: 3 x clips, N and N m.
  Points forces, torques;
  double residual = 0;  ///< N, largest net force on a free vertex
  int iterations = 0;
  bool converged = false;
};
struct ClipSensitivities {
  MatX x;       ///< 3 vertices x parameters, m per unit
  MatX forces;  ///< 3 clips x parameters, N per unit
  /// The Hessian was not positive definite; it was made so by multiples of the mass matrix.
  bool inexact = false;
};

/// By the clips' poses, of each clip three columns for its position (per m) and three for a
/// rotation vector about it, in world axes (per rad).
struct ClipPoseSensitivities {
  MatX x;       ///< 3 vertices x 6 clips, the moves of the vertices in the clips among them
  MatX forces;  ///< 3 clips x 6 clips
};

/// For the `like` of cloths with the same mesh, kind of model and clips. Throws Error as
/// clip_of_vertices().
std::unique_ptr<StaticSystem> system_between_clips(const HeavyCloth& cloth,
                                                   const std::vector<Clip>& clips);

/// Cloth between clips, whose matrices are factorized once for an equilibrium and its derivatives.
/// Keeps a reference to the cloth, which must not change between the calls.
class ClippedCloth {
 public:
  /// `like`: null, or as in StaticSystem.
  ClippedCloth(const HeavyCloth& cloth, std::vector<Clip> clips,
               const StaticSystem* like = nullptr);
  ~ClippedCloth();

  /// As the functions below.
  ClipEquilibrium solve(Points start, const StaticOptions& options = {});
  ClipSensitivities sensitivities(const Points& x, const MatX& history_derivative = {});
  ClipPoseSensitivities pose_sensitivities(const Points& x);

 private:
  const HeavyCloth& cloth_;
  std::vector<Clip> clips_;
  std::vector<int> clip_of_;
  std::unique_ptr<StaticSystem> system_;
};

/// A stable equilibrium near `start`, 3 x vertices, with the clips' vertices where the clips are.
/// Without convergence, what was reached.
ClipEquilibrium solve_clips(const HeavyCloth& cloth, const std::vector<Clip>& clips, Points start,
                            const StaticOptions& options = {});

/// Derivatives of an equilibrium `x` by all parameters of the model, by the implicit function
/// theorem with the exact Hessian K = [K_ff K_fc; K_cf K_cc] of free and clamped vertices and the
/// derivative g' of the gradient by the parameters:
///
///     dx_f = -K_ff^-1 g'_f,      dF = sum over the clip's vertices of (g'_c + K_cf dx_f).
///
/// `history_derivative`: of the model's history (elastic_model.h), a column a parameter; empty
/// where it does not depend on them.
ClipSensitivities clip_sensitivities(const HeavyCloth& cloth, const std::vector<Clip>& clips,
                                     const Points& x, const MatX& history_derivative = {});

/// Derivatives of an equilibrium `x` and the clips' forces by the clips' poses. With the moves d of
/// the vertices in the clips
///
///     dx_f = -K_ff^-1 K_fc d,
///     dF = sum over the clip's vertices of (K_cc - K_cf K_ff^-1 K_fc) d.
ClipPoseSensitivities clip_pose_sensitivities(const HeavyCloth& cloth,
                                              const std::vector<Clip>& clips, const Points& x);

}  // namespace weft
