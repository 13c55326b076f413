#pragma once
#include <memory>
#include <vector>

#include "weft/model/bending.h"
#include "weft/model/block_pattern.h"
#include "weft/model/elastic_model.h"
#include "weft/model/sheet_law.h"
#include "weft/strain/triangle_shape.h"

namespace weft::detail {

using Mat32 = Eigen::Matrix<double, 3, 2>;

/// A continuous sheet: a membrane law on each triangle and a bending law on the curvature of each
/// triangle (bending.h), with energies linear in area.
///
/// Rim: no moment acts across a free edge. The energy of a triangle with edges on the rim is
/// minimized over the angles there, with the bending law itself, so that the edge of a plate with
/// Poisson effect curls.
///
/// Projected Hessian of the membrane, with S = [[N_uu, N_uv], [N_uv, N_vv]] and B the derivative of
/// the strains by (w_u, w_v): the exact one is B C B^T + S x I. Across the plane of the triangle it
/// is S, whose negative part (compression that would buckle) is cut off. In the plane the exact
/// matrix is kept where it is positive definite, and C and S without their negative parts
/// elsewhere. Of bending, the product of the gradients is kept.
class SheetModel final : public ElasticModel {
 public:
  /// `fabric` has the parameters of the membrane first, then those of bending. `mesh` is valid.
  SheetModel(const TriangleMesh& mesh, const Fabric& fabric, double grain_angle,
             std::unique_ptr<SheetLaw> membrane, std::unique_ptr<SheetLaw> bending);

  const TriangleMesh& mesh() const override { return mesh_; }
  const VecX& parameters() const override { return fabric_.values; }
  void set_parameters(const VecX& values) override;

  double energy(const Points& x) const override;
  void gradient(const Points& x, Points& gradient) const override;
  void hessian(const Points& x, HessianKind kind, Points& gradient,
               SparseMatrix& hessian) const override;
  const SparseMatrix& hessian_pattern() const override { return pattern_.matrix(); }
  void parameter_derivative(const Points& x, MatX& derivative) const override;

 private:
  struct Triangle {
    std::array<int, 3> vertices;
    std::array<int, 3> slots;
    TriangleShape<double> shape;
  };
  struct Plate {
    std::array<int, 6> vertices;
    std::array<int, 15> slots;
    CurvatureMap<double> map;
    double area;
    bool on_rim;
    Mat3 rim;  ///< projects onto the curvatures that angles on the rim can make
  };
  /// A plate element with the angles on the rim where they cost least.
  struct Bent {
    Vec3 strain;             ///< the curvature then
    Mat3 projection;         ///< what the settling of the angles makes of a change of stress
    SheetResponse response;  ///< with the derivatives by the other angles' curvature
  };

  Bent bend(const Plate& plate, const Vec3& curvature) const;
  /// `by_deformation`: derivative of the energy density by (w_u, w_v).
  void add_gradient(const Triangle& triangle, const Mat32& by_deformation, Points& gradient) const;
  void add_gradient(const Plate& plate, const TriangleCurvature<double>& curvature,
                    const Vec3& moment, Points& gradient) const;
  void add_hessian(const Triangle& triangle, const Points& x, HessianKind kind, Points& gradient,
                   double* values) const;
  void add_hessian(const Plate& plate, const Points& x, HessianKind kind, Points& gradient,
                   double* values) const;

  TriangleMesh mesh_;
  Fabric fabric_;
  std::unique_ptr<SheetLaw> membrane_, bending_;
  BlockPattern pattern_;
  std::vector<Triangle> triangles_;
  std::vector<Plate> plates_;
};

/// The mesh with its material coordinates along weft and warp: turned by - `grain_angle`.
TriangleMesh along_the_threads(const TriangleMesh& mesh, double grain_angle);

}  // namespace weft::detail
