#pragma once
#include "weft/dynamics/xpbd_system.h"

namespace weft::xpbd {

/// A motion by XPBD as it is usual: each step of length h is x <- x + h v, v <- v + h a before, a
/// number of sweeps from multipliers of zero, and v <- the change of x over h after. Implicit Euler
/// where the sweeps converge, and softer than it should be where they do not; it damps. Laws of the
/// constraints must have been made for the same h.
class Motion {
 public:
  /// From where `system` is, at rest. `acceleration` (m/s^2) acts on all that is not pinned. Keeps
  /// a reference to the system.
  Motion(System& system, const Vec3& acceleration);

  /// `substeps` steps of `step` s with `sweeps` each, all 1 or more.
  void advance(double step, int substeps, int sweeps);
  /// m/s, 3 x vertices of the mesh.
  Points velocities() const { return system_.by_mesh(v_); }

 private:
  System& system_;
  Vec3 acceleration_;
  Records v_, before_;
};

}  // namespace weft::xpbd
