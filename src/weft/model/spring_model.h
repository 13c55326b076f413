#pragma once
/// Springs between the vertices of a regular grid (Miguel 2012, section 4.1).
///
/// The strain of a spring is its relative elongation, c = l / l_0 - 1 (equation 1); its energy is
/// the area that it stands for times the integral of k(c) c. Springs:
/// - weft_stretch, warp_stretch: the edges along weft and warp; each triangle's area counts once
///   for both;
/// - shear: both diagonals of each cell, also where the mesh has only one of them as an edge. With
///   the diagonal at an angle phi to the weft their weight is 1 / (2 sin^2 phi cos^2 phi) of the
///   cell's area each, so that the parameter is the shear stiffness A66. Diagonals resist stretch
///   too: on square cells a linear fabric has A11 = weft_stretch + shear, A12 = shear, A22 =
///   warp_stretch + shear in the small-strain limit. No choice of springs is without it.
/// - weft_bend, warp_bend, diagonal_bend: between the two neighbours of a vertex that lie opposite
///   to each other along weft, warp and both diagonals (ring 2); where cells are not of equal size
///   those of diagonals do not pass through the vertex, and are straight at rest all the same.
///
/// Ring-2 springs are no plate. Bent to the curvature kappa the chord over two edges of length h is
/// shorter by (kappa h)^2 / 8, so that the energy goes with kappa^4 h^4: a flat sheet has no
/// bending stiffness, the stiffness of a bent one depends on the mesh, and ring-2 springs add to
/// the stretch stiffness. This is what the paper's springs are ("the highest fitting residual for
/// bending", section 6); parameters of bend hold on the mesh that they were found on.
///
/// Internal friction (friction.h) acts on the elongation of each spring, of shear springs on that
/// over sin phi cos phi, which is the shear of a small strain: amplitude and scale are those of the
/// shear stress and the shear then. The elongation of the second ring goes with the square of the
/// curvature, and does not turn its sign with it: its friction opens no loop through a flat sheet.
#include <array>
#include <vector>

#include "weft/model/block_pattern.h"
#include "weft/model/elastic_model.h"
#include "weft/model/friction.h"

namespace weft::detail {

class SpringModel final : public ElasticModel {
 public:
  /// Throws Error unless the mesh, turned to the threads, is made of right-angled triangles with
  /// legs along weft and warp. `mesh` is valid.
  SpringModel(const TriangleMesh& mesh, const Fabric& fabric, double grain_angle);

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

  struct Spring {
    int a, b;  ///< a < b
    int component;
    double length;  ///< m, at rest
    double area;    ///< m^2
    double strain;  ///< that friction acts on, over the relative elongation
    int slot;       ///< of block (b, a)
  };
  const std::vector<Spring>& springs() const { return springs_; }

 private:
  struct Reach {
    double length;      ///< m
    double elongation;  ///< relative
    Vec3 direction;     ///< from a to b; zero where the length is
  };
  static Reach reach(const Spring& spring, const Points& x);
  /// Of spring i, by its relative elongation, per area.
  StiffnessCurve::Response respond(std::size_t i, double elongation) const;
  bool rubs(const Spring& spring) const {
    return friction_column_[static_cast<std::size_t>(spring.component)] >= 0;
  }
  /// Of spring i, by the strain that friction acts on, per area over the square of Spring::strain.
  FrictionResponse rub(std::size_t i, double elongation) const;
  /// Adds to a column the forces of spring i under a stress by its elongation.
  void add_stress(std::size_t i, const Vec3& direction, double stress,
                  Eigen::Ref<VecX> column) const;

  TriangleMesh mesh_;
  Fabric fabric_;
  std::vector<StiffnessCurve> curves_;  ///< one a component
  std::vector<Spring> springs_;
  BlockPattern pattern_;

  std::array<Friction, 6> friction_;
  /// Of the amplitude among the parameters, before that of the scale; -1: a component without.
  std::array<int, 6> friction_column_;
  VecX history_;  ///< strain and friction stress of each spring; empty without friction
};

}  // namespace weft::detail
