#pragma once
#include <vector>

#include "weft/dynamics/simulate.h"
#include "weft/model/hessian_kind.h"

namespace weft {

/// What static equilibrium minimizes over the positions of the vertices.
class StaticPotential {
 public:
  virtual ~StaticPotential() = default;
  /// J.
  virtual double value(const Points& x) const = 0;
  /// d value / d x, N (3 x vertices, overwritten).
  virtual void gradient(const Points& x, Points& gradient) const = 0;
  /// The gradient (overwritten) and the Hessian: lower triangle with diagonal, added to `hessian`
  /// in the pattern of hessian_pattern().
  virtual void hessian(const Points& x, HessianKind kind, Points& gradient,
                       SparseMatrix& hessian) const = 0;
  /// Lower triangle with explicit zeros, compressed, rows ascending; has all diagonal entries.
  virtual const SparseMatrix& hessian_pattern() const = 0;
  /// Lumped masses, kg, one a vertex: regularization is in proportion to them.
  virtual const VecX& masses() const = 0;
  virtual const TriangleMesh& mesh() const = 0;
};

/// A stable equilibrium near `start` (3 x vertices), by the method of solve_static in simulate.h.
/// Vertices whose flag in `held` is set stay where `start` has them.
StaticResult solve_static(const StaticPotential& potential, Points start,
                          const std::vector<char>& held, const StaticOptions& options = {});

/// Positions in matrix.valuePtr() of the diagonal entries of a lower triangle as above.
std::vector<int> diagonal_slots(const SparseMatrix& lower);

}  // namespace weft
