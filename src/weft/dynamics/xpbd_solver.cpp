#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "weft/base/error.h"
#include "weft/dynamics/held_equilibrium.h"
#include "weft/fabric/orthotropic.h"
#include "weft/model/sheet_model.h"

namespace weft {
namespace {

constexpr double kSameRigidity = 1e-9;  // relative
constexpr double kNoCoupling = 1e-6;    // of b, that changes no shape

/// Columns of the fabric's values that the derivatives by (c00, c11, c01, c22, bend) go to.
constexpr const char* kValues[kSheetParameters] = {"membrane_uu", "membrane_vv", "membrane_uv",
                                                   "membrane_shear", "bend_uu"};

OrthotropicSheet sheet_of(const Fabric& fabric, double areal_density) {
  require_model(fabric, "stvk");
  const double b = fabric.value("bend_uu");
  if (std::abs(fabric.value("bend_vv") - b) > kSameRigidity * b ||
      std::abs(2 * fabric.value("bend_twist") - b) > kSameRigidity * b)
    throw Error(
        fmt::format("fabric \"{}\": XPBD bends with one rigidity b: bend_uu = bend_vv = b, "
                    "bend_twist = b / 2 are needed; they are {:g}, {:g}, {:g} N m",
                    fabric.name, b, fabric.value("bend_vv"), fabric.value("bend_twist")));
  if (fabric.value("bend_uv") > std::max(2 * kNoBendCoupling, kNoCoupling * b))
    throw Error(fmt::format(
        "fabric \"{}\": XPBD bends without Poisson effect: bend_uv must be at most {:g} "
        "(nothing) or {:g} times bend_uu; it is {:g} N m, bend_uu {:g}",
        fabric.name, kNoBendCoupling, kNoCoupling, fabric.value("bend_uv"), b));
  return {fabric.value("membrane_uu"),
          fabric.value("membrane_vv"),
          fabric.value("membrane_uv"),
          fabric.value("membrane_shear"),
          b,
          areal_density};
}

class XpbdSolver final : public EquilibriumSolver {
 public:
  explicit XpbdSolver(XpbdOptions options) : options_(std::move(options)) {}

  std::string_view name() const override { return "xpbd"; }
  bool takes(std::string_view model) const override { return model == "stvk"; }

  HeldEquilibrium solve(const HeldCloth& cloth, const Fabric& fabric,
                        HeldDerivatives derivatives) const override {
    if (cloth.hem_width > 0) throw Error("the solver xpbd cannot take a hem");
    std::vector<int> pinned;
    for (std::size_t i = 0; i < cloth.held.size(); ++i)
      if (cloth.held[i]) pinned.push_back(static_cast<int>(i));
    XpbdOptions options = options_;
    options.gravity = cloth.gravity;
    options.loads.clear();
    if (derivatives == HeldDerivatives::none) options.derivatives = XpbdDerivatives::none;
    const bool turned = cloth.grain_angle != 0;
    XpbdEquilibrium found = xpbd_equilibrium(
        turned ? detail::along_the_threads(cloth.mesh, cloth.grain_angle) : cloth.mesh,
        sheet_of(fabric, cloth.areal_density), pinned, cloth.start, options);
    HeldEquilibrium result;
    result.residual = found.residual;
    result.iterations = found.iterations;
    result.converged = found.converged;
    result.reactions = Points::Zero(3, found.x.cols());
    for (std::size_t i = 0; i < pinned.size(); ++i)
      result.reactions.col(pinned[i]) = found.reactions.col(static_cast<Eigen::Index>(i));
    if (derivatives == HeldDerivatives::all) {
      result.inexact = found.derivative_residual > options.derivative_tolerance;
      const Eigen::Index rows = found.x.size(), columns = fabric.values.size();
      result.x_derivative = MatX::Zero(rows, columns);
      result.reaction_derivative = MatX::Zero(rows, columns);
      for (int p = 0; p < kSheetParameters; ++p) {
        const int column = fabric.value_index(kValues[p]);
        result.x_derivative.col(column) = found.position_derivative.col(p);
        for (std::size_t i = 0; i < pinned.size(); ++i)
          result.reaction_derivative.block<3, 1>(3 * pinned[i], column) =
              found.reaction_derivative.block<3, 1>(3 * static_cast<Eigen::Index>(i), p);
      }
    }
    result.x = std::move(found.x);
    return result;
  }

 private:
  XpbdOptions options_;
};

}  // namespace

XpbdOptions xpbd_solver_options() {
  XpbdOptions options;
  options.bending = XpbdBending::curvature;
  options.derivatives = XpbdDerivatives::at_rest;
  return options;
}

std::unique_ptr<EquilibriumSolver> make_xpbd_solver(XpbdOptions options) {
  return std::make_unique<XpbdSolver>(std::move(options));
}

}  // namespace weft
