#pragma once
#include <memory>

#include "weft/fabric/fabric.h"
#include "weft/mesh/triangle_mesh.h"
#include "weft/model/hessian_kind.h"

namespace weft {

/// The elastic energy of a mesh as a function of its shape and of a vector of material parameters:
/// what static equilibrium, its sensitivities and fits to forces need. No mass, no gravity, no
/// damping. Geometry and sparsity are fixed at construction. Const functions keep no state: one
/// model may serve several threads.
class ElasticModel {
 public:
  virtual ~ElasticModel() = default;

  virtual const TriangleMesh& mesh() const = 0;
  /// Area of the cloth at each vertex, m^2, with the second layer of a hem: times the areal density
  /// its mass.
  virtual VecX vertex_areas() const { return weft::vertex_areas(mesh()); }
  /// Values in the order of the fabric that the model was made from (Fabric::values), SI.
  virtual const VecX& parameters() const = 0;
  /// Throws Error for a wrong count, or a value that is not finite or outside what the model can
  /// stand.
  virtual void set_parameters(const VecX& values) = 0;

  /// J.
  virtual double energy(const Points& x) const = 0;
  /// d energy / d x, N, 3 x vertices. Overwrites.
  virtual void gradient(const Points& x, Points& gradient) const = 0;
  /// The gradient (overwritten) and, in the same pass, the Hessian: lower triangle with diagonal,
  /// in the pattern of hessian_pattern(), added to what is there.
  virtual void hessian(const Points& x, HessianKind kind, Points& gradient,
                       SparseMatrix& hessian) const = 0;
  /// Lower triangle with explicit zeros, 3 n x 3 n, compressed; has all diagonal entries.
  virtual const SparseMatrix& hessian_pattern() const = 0;
  /// d gradient / d parameters, 3 n x parameters (rows as flat(x)). Overwrites.
  /// With the history held.
  virtual void parameter_derivative(const Points& x, MatX& derivative) const = 0;

  /// Internal friction (the fabric's `*_friction` terms, model/friction.h) depends on what came
  /// before: strain and friction stress of each component at the last frame. Energy and its
  /// derivatives are those of the way from there to x. A quasi-static sequence, frame by frame:
  /// find the equilibrium x, then set_history(next_history(x)). A model without friction has a
  /// history of no numbers.
  virtual int history_size() const { return 0; }
  /// Flat and without stress, after construction.
  virtual VecX history() const { return {}; }
  /// Throws Error for a wrong count.
  virtual void set_history(const VecX& history);
  virtual VecX next_history(const Points& /*x*/) const { return {}; }
  /// What a history that depends on the parameters adds to parameter_derivative() at x: adds
  /// (d gradient / d history) `history_derivative`, with d history / d parameters in a row an
  /// entry.
  virtual void add_history_derivative(const Points& /*x*/, const MatX& /*history_derivative*/,
                                      MatX& /*derivative*/) const {}
  /// d next_history(x) / d parameters, from d x / d parameters (3 n x parameters, rows as flat(x))
  /// and that of the history now.
  virtual MatX next_history_derivative(const Points& /*x*/, const MatX& x_derivative,
                                       const MatX& /*history_derivative*/) const {
    return MatX(0, x_derivative.cols());
  }
};

/// The model that `fabric.model` names on `mesh`; of a motion model (fabric.h) the elastic part.
/// `grain_angle` (rad): u of the material lies at
/// this angle, counter-clockwise, from the first axis of the mesh's material coordinates.
/// `hem_width` (m): hem.h, of these two models. Throws Error for a name that is no elastic model, a
/// mesh or fabric that is not valid, or a hem that cannot be.
std::unique_ptr<ElasticModel> make_elastic_model(const TriangleMesh& mesh, const Fabric& fabric,
                                                 double grain_angle = 0, double hem_width = 0);

}  // namespace weft
