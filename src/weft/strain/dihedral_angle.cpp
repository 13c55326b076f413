#include "weft/strain/dihedral_angle.h"

namespace weft {

HingeStrain dihedral_angle_strain(const Vec3& x0, const Vec3& x1, const Vec3& x2, const Vec3& x3) {
  const auto angle = dihedral_angle(to_vector3(x0), to_vector3(x1), to_vector3(x2), to_vector3(x3));
  const auto g = angle.gradient();
  const HingeHessian<double> h = hinge_hessian(angle, 1.0);
  const Mat3 zero = Mat3::Zero();
  const Mat3 blocks[4][4] = {{to_eigen(h.b00.full()), zero, zero, zero},
                             {to_eigen(h.b10), to_eigen(h.b11.full()), zero, zero},
                             {to_eigen(h.b20), to_eigen(h.b21), to_eigen(h.b22.full()), zero},
                             {to_eigen(h.b30), to_eigen(h.b31), zero, to_eigen(h.b33.full())}};
  HingeStrain out;
  out.value = angle.value;
  for (int i = 0; i < 4; ++i) {
    out.gradient.segment<3>(3 * i) = to_eigen(g[static_cast<std::size_t>(i)]);
    for (int j = 0; j <= i; ++j) {
      out.hessian.block<3, 3>(3 * i, 3 * j) = blocks[i][j];
      out.hessian.block<3, 3>(3 * j, 3 * i) = blocks[i][j].transpose();
    }
  }
  return out;
}

}  // namespace weft
