#include "weft/dynamics/held_equilibrium.h"

#include <algorithm>
#include <utility>

#include "weft/base/error.h"
#include "weft/dynamics/clips.h"
#include "weft/dynamics/equilibrium_derivatives.h"

namespace weft {
namespace {

void zero_free_columns(const std::vector<char>& held, Points& reactions) {
  for (std::size_t i = 0; i < held.size(); ++i)
    if (!held[i]) reactions.col(static_cast<Eigen::Index>(i)).setZero();
}

class StaticSolver final : public EquilibriumSolver {
 public:
  explicit StaticSolver(const StaticOptions& options) : options_(options) {}

  std::string_view name() const override { return "static"; }

  HeldEquilibrium solve(const HeldCloth& cloth, const Fabric& fabric,
                        HeldDerivatives derivatives) const override {
    const auto model = make_elastic_model(cloth.mesh, fabric, cloth.grain_angle, cloth.hem_width);
    const HeavyCloth heavy(*model, cloth.areal_density, cloth.gravity);
    StaticSystem system(heavy, cloth.held);
    StaticResult found = system.solve(cloth.start, options_);
    HeldEquilibrium result;
    result.x = std::move(found.x);
    result.residual = found.residual;
    result.iterations = found.iterations;
    result.converged = found.converged;
    heavy.gradient(result.x, result.reactions);
    zero_free_columns(cloth.held, result.reactions);
    if (derivatives == HeldDerivatives::all) {
      detail::EquilibriumDerivatives d = detail::equilibrium_derivatives(heavy, system, result.x);
      result.x_derivative = std::move(d.x);
      result.reaction_derivative = std::move(d.gradient);
      result.inexact = d.inexact;
    }
    return result;
  }

 private:
  StaticOptions options_;
};

}  // namespace

HeldResponse held_response(const HeldCloth& cloth, const Fabric& fabric, const Points& x,
                           const MatX& moves) {
  const auto model = make_elastic_model(cloth.mesh, fabric, cloth.grain_angle, cloth.hem_width);
  const HeavyCloth heavy(*model, cloth.areal_density, cloth.gravity);
  StaticSystem system(heavy, cloth.held);
  return detail::held_response(system, x, moves);
}

StaticOptions static_solver_options() {
  StaticOptions options;
  options.max_iterations = 3000;
  return options;
}

std::unique_ptr<EquilibriumSolver> make_static_solver(const StaticOptions& options) {
  return std::make_unique<StaticSolver>(options);
}

}  // namespace weft
