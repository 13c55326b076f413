#include "weft/model/material_response.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "weft/base/error.h"
#include "weft/model/elastic_model.h"

namespace weft {
namespace {

/// Cells of the smaller patch along a side; the larger has twice as many.
constexpr int kCells = 6;
/// Angle over which the smaller patch is rolled, rad.
constexpr double kRolled = 0.25;

/// Chord over arc of a circle.
double chord(double angle) {
  const double half = 0.5 * angle;
  return half == 0 ? 1 : std::sin(half) / half;
}

/// A point of a line that is rolled up, without loss at a curvature of 0: on the circle, or, of
/// straight pieces that keep their length `piece`, on the one around them.
struct Arc {
  double along, across;  ///< m
};
Arc arc(double s, double curvature, double piece) {
  const double angle = s * curvature;
  const double way = s * chord(angle) / chord(piece * curvature);
  return {way * std::cos(0.5 * angle), way * std::sin(0.5 * angle)};
}

/// `cell`: side of the cells that are to stay flat, m; 0: they follow the arc.
Points deformed(const TriangleMesh& mesh, MaterialTest test, double strain, double cell) {
  Points x(3, mesh.vertex_count());
  for (Eigen::Index i = 0; i < x.cols(); ++i) {
    const double u = mesh.material(0, i), v = mesh.material(1, i);
    switch (test) {
      case MaterialTest::weft_stretch:
        x.col(i) << (1 + strain) * u, v, 0;
        break;
      case MaterialTest::warp_stretch:
        x.col(i) << u, (1 + strain) * v, 0;
        break;
      case MaterialTest::shear:
        x.col(i) << u + strain * v, v, 0;
        break;
      case MaterialTest::weft_bend: {
        const Arc a = arc(u, strain, cell);
        x.col(i) << a.along, v, a.across;
        break;
      }
      case MaterialTest::warp_bend: {
        const Arc a = arc(v, strain, cell);
        x.col(i) << u, a.along, a.across;
        break;
      }
      case MaterialTest::diagonal_bend: {
        constexpr double kHalf = 0.5 * std::numbers::sqrt2;
        const Arc a = arc(kHalf * (u + v), strain, kHalf * cell);
        const double held = kHalf * (v - u);
        x.col(i) << kHalf * (a.along - held), kHalf * (a.along + held), a.across;
        break;
      }
    }
  }
  return x;
}

/// Side of a patch, m: the mesh error of a cylinder depends on the angle of a cell alone.
double patch_side(MaterialTest test, std::span<const double> strains, double cell) {
  if (cell > 0) return kCells * cell;
  if (!is_bend(test)) return 1;
  double most = 0;
  for (const double strain : strains) most = std::max(most, std::abs(strain));
  return most > 0 ? kRolled / most : 1;
}

void check(MaterialTest test, std::span<const double> strains) {
  const bool stretch = test == MaterialTest::weft_stretch || test == MaterialTest::warp_stretch;
  for (const double strain : strains) {
    if (!std::isfinite(strain) || (stretch && strain <= -1))
      throw Error(fmt::format("a {} of {:g} is out of range ({})", material_test_name(test), strain,
                              stretch ? "above -1" : "a finite number"));
  }
}

}  // namespace

std::string_view material_test_name(MaterialTest test) {
  switch (test) {
    case MaterialTest::weft_stretch:
      return "weft stretch";
    case MaterialTest::warp_stretch:
      return "warp stretch";
    case MaterialTest::shear:
      return "shear";
    case MaterialTest::weft_bend:
      return "weft bend";
    case MaterialTest::warp_bend:
      return "warp bend";
    case MaterialTest::diagonal_bend:
      return "diagonal bend";
  }
  return "";
}

bool is_bend(MaterialTest test) {
  return test == MaterialTest::weft_bend || test == MaterialTest::warp_bend ||
         test == MaterialTest::diagonal_bend;
}

namespace {

/// Adds `weight` times the energy of a patch by the strain, and its derivative by the parameters.
void add_patch(const TriangleMesh& mesh, const Fabric& fabric, MaterialTest test,
               std::span<const double> strains, const MaterialResponseOptions& options, double step,
               double weight, MaterialResponse& response) {
  const auto model = make_elastic_model(mesh, fabric);
  const Eigen::Index parameters = fabric.values.size();
  Points gradient(3, mesh.vertex_count());
  MatX by_parameters(3 * mesh.vertex_count(), parameters);
  const MatX not_moved = MatX::Zero(by_parameters.rows(), parameters);
  MatX history_derivative = MatX::Zero(model->history_size(), parameters);
  for (Eigen::Index k = 0; k < response.stress.size(); ++k) {
    const double strain = strains[static_cast<std::size_t>(k)];
    const auto at = [&](double e) { return deformed(mesh, test, e, options.cell); };
    const Points direction = (at(strain + step) - at(strain - step)) / (2 * step);
    const Points x = at(strain);
    model->gradient(x, gradient);
    response.stress[k] += weight * gradient.cwiseProduct(direction).sum();
    model->parameter_derivative(x, by_parameters);
    model->add_history_derivative(x, history_derivative, by_parameters);
    response.derivative.row(k) +=
        weight * Eigen::Map<const VecX>(direction.data(), direction.size()).transpose() *
        by_parameters;
    if (options.path == StrainPath::separate || model->history_size() == 0) continue;
    history_derivative = model->next_history_derivative(x, not_moved, history_derivative);
    model->set_history(model->next_history(x));
  }
}

}  // namespace

MaterialResponse material_response(const Fabric& fabric, MaterialTest test,
                                   std::span<const double> strains,
                                   const MaterialResponseOptions& options) {
  check(test, strains);
  if (!(options.cell >= 0))
    throw Error(fmt::format("cells of {:g} m: must not be below 0", options.cell));
  if (fabric.model == "springs" && is_bend(test) && options.cell == 0)
    throw Error("the bend of the model springs depends on the cells of the mesh: none are given");
  const auto count = static_cast<Eigen::Index>(strains.size());
  MaterialResponse response{VecX::Zero(count), MatX::Zero(count, fabric.values.size())};
  const double side = patch_side(test, strains, options.cell);
  // Positions are linear in the strain, but for bend, where this step makes an error of 1e-10.
  const double step = is_bend(test) ? 1e-5 * kRolled / side : 0.5;
  // The energy of n x m cells is n m times what is sought, and what n cells of one rim, m of the
  // other and the corners lack: differences of four patches leave the first.
  for (const int n : {1, 2})
    for (const int m : {1, 2})
      add_patch(
          make_swatch(n * side, m * side, n * kCells + 1, m * kCells + 1, GridPattern::uniform),
          fabric, test, strains, options, step, (n == m ? 1 : -1) / (side * side), response);
  return response;
}

}  // namespace weft
