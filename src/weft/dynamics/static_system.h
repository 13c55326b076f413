#pragma once
#include <optional>
#include <vector>

#include "weft/dynamics/retry_pause.h"
#include "weft/dynamics/sparse_cholesky.h"
#include "weft/dynamics/static_potential.h"

namespace weft {

/// Static equilibria of one potential with one set of held vertices: the order of elimination is
/// found once, and what solve() ended with serves the derivatives there. Keeps a reference to the
/// potential, which must not change between the calls.
class StaticSystem {
 public:
  /// `held`: a flag a vertex. `like`: null, or a system of a potential with the same pattern; where
  /// the same vertices are held there, the order of elimination is taken from it.
  StaticSystem(const StaticPotential& potential, std::vector<char> held,
               const StaticSystem* like = nullptr);

  const std::vector<char>& held() const { return held_; }
  /// As solve_static() in static_potential.h.
  StaticResult solve(Points start, const StaticOptions& options = {});

  struct Factor {
    const SparseMatrix& hessian;  ///< exact, lower triangle, with `regularization` times the masses
    const SparseCholesky<double>& cholesky;  ///< of it
    double regularization;                   ///< 1/s^2, 1e-6 where no more makes it definite
    const VecX& masses;                      ///< kg
    bool inexact() const;                    ///< it took more
  };
  /// At `x`, valid until the next call. Throws Error for a Hessian that is not finite.
  Factor factor_at(const Points& x);

 private:
  double largest_free_force() const;
  void regularize(double regularization);
  bool factorize(HessianKind kind);
  bool factorize_for_direction();
  bool find_step();
  bool leap();
  bool finish_by_factor(double force_tolerance, StaticResult& result);
  bool is_stable();
  bool escape();

  const StaticPotential& model_;
  std::vector<char> held_;
  SparseCholesky<double> cholesky_;
  SparseMatrix hessian_;
  std::vector<int> diagonal_;
  Points x_, gradient_, direction_, trial_;
  double potential_ = 0;
  double regularization_ = 0;
  bool exact_ = false;         // the factor at hand is of the exact Hessian
  bool as_predicted_ = false;  // the last step was whole, and lowered the potential as foreseen
  RetryPause exact_pause_;     // of tries of the exact Hessian
  int leaps_ = 0;
  std::optional<Points> factored_at_;  // by the exact Hessian with the least regularization
};

}  // namespace weft
