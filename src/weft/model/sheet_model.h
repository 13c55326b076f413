#pragma once
#include <memory>
#include <vector>

#include "weft/model/bending.h"
#include "weft/model/block_pattern.h"
#include "weft/model/elastic_model.h"
#include "weft/model/elements.h"
#include "weft/model/friction.h"
#include "weft/model/lane_blocks.h"
#include "weft/model/sheet_law.h"
#include "weft/strain/triangle_shape.h"

namespace weft::detail {

using Mat32 = Eigen::Matrix<double, 3, 2>;

/// A continuous sheet: a membrane law on each triangle and a bending law on the curvature of each
/// bending element (bending.h), with energies linear in area.
///
/// Rim: no moment acts across a free edge. The energy of an element with edges on the rim is
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
  /// `fabric` has the parameters of the membrane first, then those of bending, then of friction.
  /// `mesh` is valid.
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

  int history_size() const override { return static_cast<int>(history_.size()); }
  VecX history() const override { return history_; }
  void set_history(const VecX& history) override;
  VecX next_history(const Points& x) const override;
  void add_history_derivative(const Points& x, const MatX& history_derivative,
                              MatX& derivative) const override;
  MatX next_history_derivative(const Points& x, const MatX& x_derivative,
                               const MatX& history_derivative) const override;

  /// Of a triangle or a bending element.
  struct ElementStrain {
    std::array<int, 3> vertices;  ///< a bending element's are its corner and that one's neighbours
    double area;                  ///< m^2
    double strain;                ///< of the Green strain, or curvature less that of the rim, 1/m
  };
  /// Of component 0 to 2 (strains) or 3 to 5 (curvatures) at x.
  std::vector<ElementStrain> element_strains(const Points& x, int component) const;

 private:
  struct Triangle {
    std::array<int, 3> vertices;
    std::array<int, 3> slots;
    TriangleShape<double> shape;
  };
  struct Plate {
    std::array<int, 6> vertices;
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
  /// The laws with friction, at triangle t and at plate p.
  SheetResponse membrane(std::size_t t, const Vec3& strain) const;
  Bent bend(std::size_t p, const Vec3& curvature) const;
  Vec3 membrane_strain(std::size_t t, const Points& x) const;

  // Friction counts the elements through, triangles and then plates. Component i of six acts on
  // strain i of the triangles or curvature i - 3 of the plates.
  std::size_t element_count() const { return triangles_.size() + plates_.size(); }
  bool acts_on(int i, std::size_t e) const { return (i < 3) == (e < triangles_.size()); }
  FrictionResponse rub(std::size_t e, int i, double strain) const;
  /// The strain or the curvature that friction acts on, and its derivative by the columns of x's.
  Vec3 rubbed_strain(std::size_t e, const Points& x) const;
  MatX strain_derivative(std::size_t e, const Points& x, const MatX& x_derivative) const;
  /// Adds the forces of a stress by that strain to rows of a derivative.
  void add_stress(std::size_t e, const Points& x, const Vec3& stress,
                  Eigen::Ref<VecX> column) const;
  /// `by_deformation`: derivative of the energy density by (w_u, w_v).
  void add_gradient(const Triangle& triangle, const Mat32& by_deformation, Points& gradient) const;
  void add_membrane(std::size_t t, const Points& x, HessianKind kind, Points& gradient,
                    double* values) const;
  /// The responses of a group's plates at its curvatures; `first`: the first of them.
  std::array<Bent, kLanes> bend(const BendingGroup& group, std::size_t first,
                                const TriangleCurvature<Lanes>& curvature) const;
  /// Of a group's energy by its curvatures: derivatives, and second ones.
  static std::array<Lanes, 3> moments(const BendingGroup& group,
                                      const std::array<Bent, kLanes>& bent);
  static SymmetricMatrix3<Lanes> stiffnesses(const BendingGroup& group,
                                             const std::array<Bent, kLanes>& bent,
                                             HessianKind kind);
  void add_bending(const BendingGroup& group, std::size_t first, const Points& x, HessianKind kind,
                   Points& gradient, BlockWriter& writer) const;
  /// Calls `visit` with each group of plates and the number of its first plate.
  template <class Visit>
  void for_each_group(const Visit& visit) const;

  TriangleMesh mesh_;
  Fabric fabric_;
  std::unique_ptr<SheetLaw> membrane_, bending_;
  BlockPattern pattern_;
  std::vector<Triangle> triangles_;
  std::vector<Plate> plates_;
  std::vector<BendingGroup> plate_groups_;  ///< the same, kLanes at a time

  static constexpr int kComponents = 6;
  static constexpr Eigen::Index kHistory = 6;  ///< of an element: three strains, three stresses
  std::vector<int> rubbing_;                   ///< components with friction, ascending
  std::array<Friction, kComponents> friction_;
  VecX history_;
};

/// The mesh with its material coordinates along weft and warp: turned by - `grain_angle`.
TriangleMesh along_the_threads(const TriangleMesh& mesh, double grain_angle);

}  // namespace weft::detail
