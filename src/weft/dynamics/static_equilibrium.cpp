#include "weft/dynamics/state.h"
#include "weft/dynamics/static_system.h"

namespace weft {
namespace {

/// Elasticity and gravity of a model that also has damping and drag.
class RestingCloth : public StaticPotential {
 public:
  explicit RestingCloth(const ClothModel& model) : model_(model) {}
  double value(const Points& x) const override { return model_.potential(x, {}); }
  void gradient(const Points& x, Points& gradient) const override {
    model_.potential_gradient(x, {}, gradient);
  }
  void hessian(const Points& x, HessianKind kind, Points& gradient,
               SparseMatrix& hessian) const override {
    model_.potential_hessian(x, {}, kind, gradient, hessian);
  }
  const SparseMatrix& hessian_pattern() const override { return model_.hessian_pattern(); }
  const VecX& masses() const override { return model_.masses(); }
  const TriangleMesh& mesh() const override { return model_.mesh(); }

 private:
  const ClothModel& model_;
};

}  // namespace

StaticResult solve_static(const ClothModel& model, const Points& start,
                          const std::vector<PointFixture>& fixtures, double time,
                          const StaticOptions& options) {
  Points x = start;
  prescribe_positions(fixtures, time, x);
  return solve_static(RestingCloth(model), std::move(x),
                      held_vertices(fixtures, model.vertex_count()), options);
}

StaticResult solve_static(const StaticPotential& potential, Points start,
                          const std::vector<char>& held, const StaticOptions& options) {
  return StaticSystem(potential, held).solve(std::move(start), options);
}

std::vector<int> diagonal_slots(const SparseMatrix& lower) {
  // The first entry of a column of a lower triangle is on the diagonal.
  return {lower.outerIndexPtr(), lower.outerIndexPtr() + lower.cols()};
}

}  // namespace weft
