#pragma once
/// The constraints of a sheet (xpbd.h) on a mesh.
#include "weft/dynamics/xpbd_system.h"

namespace weft::xpbd {

class SheetSystem {
 public:
  /// Valid arguments. Masses are lumped; `pinned` have none that moves. The step is 1 s until it is
  /// set.
  SheetSystem(const TriangleMesh& mesh, const OrthotropicSheet& sheet,
              const std::vector<int>& pinned, const XpbdOptions& options);

  /// Compliances of a step of this length, s.
  void set_step(double step);
  System& system() { return system_; }
  const System& system() const { return system_; }

 private:
  OrthotropicSheet sheet_;
  System system_;
  PackedConstraints<GreenTriangle>* membrane_ = nullptr;
  PackedConstraints<DihedralHinge>* hinges_ = nullptr;  // one of the two
  PackedConstraints<TriangleBend>* curvatures_ = nullptr;
};

}  // namespace weft::xpbd
