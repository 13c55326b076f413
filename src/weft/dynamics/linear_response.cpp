#include "weft/dynamics/linear_response.h"

#include <cmath>

namespace weft {
namespace {

constexpr double kTolerance = 1e-7;  // of the largest entry of a column
constexpr int kMaxIterations = 40;
constexpr double kFirstRegularization = 1e-6;  // 1/s^2, as where equilibria are found
constexpr double kMostRegularization = 1e12;

/// y -= A x with the lower triangle of A, in the pattern of ClothModel::hessian_pattern(): the
/// three columns of a vertex have the same rows below their block on the diagonal.
void subtract_product(const SparseMatrix& lower, const Directions& x, Directions& y) {
  const int* rows = lower.innerIndexPtr();
  const double* values = lower.valuePtr();
  for (int column = 0; column < lower.cols(); column += 3) {
    const int* begin = lower.outerIndexPtr() + column;
    const double *a0 = values + begin[0] + 3, *a1 = values + begin[1] + 2,
                 *a2 = values + begin[2] + 1;
    const double *d0 = a0 - 3, *d1 = a1 - 2, *d2 = a2 - 1;  // the block on the diagonal
    const DirectionsRow x0 = row_of(x, column), x1 = row_of(x, column + 1),
                        x2 = row_of(x, column + 2);
    DirectionsRow sum0 = d0[0] * x0 + d0[1] * x1 + d0[2] * x2;
    DirectionsRow sum1 = d0[1] * x0 + d1[0] * x1 + d1[1] * x2;
    DirectionsRow sum2 = d0[2] * x0 + d1[1] * x1 + d2[0] * x2;
    const int* row = rows + begin[0] + 3;
    const int count = begin[1] - begin[0] - 3;
    for (int k = 0; k < count; ++k) {
      const DirectionsRow other = row_of(x, row[k]);
      sum0 += a0[k] * other;
      sum1 += a1[k] * other;
      sum2 += a2[k] * other;
      row_of(y, row[k]) -= a0[k] * x0 + a1[k] * x1 + a2[k] * x2;
    }
    row_of(y, column) -= sum0;
    row_of(y, column + 1) -= sum1;
    row_of(y, column + 2) -= sum2;
  }
}

DirectionsRow largest(const Directions& m) { return m.cwiseAbs().colwise().maxCoeff().array(); }

}  // namespace

void StrainHistory::add(double factor, const Directions& strains) {
  if (factor != 0) terms_[count_++] = {factor, &strains};
}

void LinearResponse::set_state(const ClothModel& model, const State& state,
                               const std::vector<int>& parameters, const StrainHistory& history) {
  model.strain_jacobian(state.x, strains_);
  const Points& velocity = state.velocity_in_air(velocity_in_air_);
  model.drag_jacobian(state.x, velocity, drag_);
  const ComponentTable& table = model.components();
  // Row p has a 1 in the column of parameter p, if it has one.
  Directions columns = Directions::Zero(model.values().size(), kDirections);
  for (std::size_t p = 0; p < parameters.size(); ++p)
    columns(parameters[p], static_cast<Eigen::Index>(p)) = 1;
  const auto factor = [&](int component) -> DirectionsRow {
    const auto i = static_cast<std::size_t>(component);
    const int stiffness = table.stiffness[i], damping = table.damping[i];
    const double weight = table.weight[component];
    return (weight * model.values()[damping]) * history.row(component) -
           (weight * state.c[component]) * row_of(columns, stiffness) -
           (weight * state.c_rate[component]) * row_of(columns, damping);
  };
  right_side_.setZero(state.x.size(), kDirections);
  strains_.add_transposed_rows(factor, right_side_);
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    if (!model.drag_depends_on(parameters[p])) continue;
    model.drag_derivative(state.x, velocity, parameters[p], drag_derivative_);
    right_side_.col(static_cast<Eigen::Index>(p)) += flat(drag_derivative_);
  }
}

void LinearResponse::add_inertia(const VecX& masses, double rate, const Directions& velocity,
                                 const Directions& acceleration) {
  for (int i = 0; i < right_side_.rows(); ++i)
    row_of(right_side_, i) +=
        masses[i / 3] * (rate * row_of(velocity, i) + row_of(acceleration, i));
}

void LinearResponse::add_velocity_history(const Directions& velocity_history) {
  drag_.add_by_velocity(-1, velocity_history, right_side_);
}

const Directions& LinearResponse::residual(const SparseMatrix& matrix, const Directions& x) {
  residual_ = right_side_;
  subtract_product(matrix, x, residual_);
  drag_.add_by_position(x, residual_);
  return residual_;
}

template <class Scalar>
bool LinearResponse::solve(const SparseMatrix& matrix, const SparseCholesky<Scalar>& factor,
                           Directions& x) {
  x = right_side_;
  factor.solve(x);
  DirectionsRow correction = largest(x);
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    residual(matrix, x);
    factor.solve(residual_);
    x += residual_;
    if (!residual_.allFinite()) return false;
    // Corrections shrink by the same factor from one to the next: the one to come is below
    // correction * shrinkage.
    const DirectionsRow before = correction;
    correction = largest(residual_);
    const DirectionsRow goal = kTolerance * largest(x);
    const auto shrinks = 2 * correction <= before;
    if ((correction <= goal || (shrinks && correction * correction <= before * goal)).all())
      return true;
  }
  return false;
}

template bool LinearResponse::solve(const SparseMatrix&, const SparseCholesky<double>&,
                                    Directions&);
template bool LinearResponse::solve(const SparseMatrix&, const SparseCholesky<float>&, Directions&);

Directions LinearResponse::reactions(const SparseMatrix& matrix,
                                     const std::vector<PointFixture>& fixtures,
                                     const Directions& x) {
  residual(matrix, x);
  Directions out(static_cast<Eigen::Index>(3 * fixtures.size()), kDirections);
  for (std::size_t k = 0; k < fixtures.size(); ++k)
    out.middleRows<3>(static_cast<Eigen::Index>(3 * k)) =
        -residual_.middleRows<3>(3 * fixtures[k].vertex);
  return out;
}

StateDerivatives derivatives_at_rest(const ClothModel& model,
                                     const std::vector<PointFixture>& fixtures, const State& state,
                                     const std::vector<int>& parameters, bool settled,
                                     Directions& reactions, long& inexact) {
  const std::vector<char> held = held_vertices(fixtures, model.vertex_count());
  SparseMatrix hessian = model.hessian_pattern();
  Points gradient;
  hessian.coeffs().setZero();
  model.potential_hessian(state.x, {}, HessianKind::exact, gradient, hessian);

  StateDerivatives d;
  d.x.setZero(state.x.size(), kDirections);
  LinearResponse response;
  if (settled) {
    // Without velocities: drag is no part of an equilibrium.
    State still = state;
    still.v.setZero();
    still.air.resize(3, 0);
    response.set_state(model, still, parameters);
    SparseCholesky<double> cholesky(model.hessian_pattern(), held, model.mesh().material);
    SparseMatrix regular = hessian;
    bool exact = true;
    for (double r = kFirstRegularization; !cholesky.factorize(regular) && r < kMostRegularization;
         r *= 10) {
      exact = false;
      regular = hessian;
      const auto diagonal = model.diagonal_slots();
      for (std::size_t i = 0; i < diagonal.size(); ++i)
        regular.valuePtr()[diagonal[i]] += r * model.masses()[static_cast<Eigen::Index>(i / 3)];
    }
    if (!response.solve(regular, cholesky, d.x)) exact = false;
    if (!exact) ++inexact;
  }
  response.set_state(model, state, parameters);
  // What is not balanced accelerates.
  reactions = response.reactions(hessian, fixtures, d.x);
  d.a = response.residual(hessian, d.x);
  for (Eigen::Index i = 0; i < d.a.rows(); ++i) d.a.row(i) /= model.masses()[i / 3];
  for (std::size_t i = 0; i < held.size(); ++i)
    if (held[i]) d.a.middleRows<3>(static_cast<Eigen::Index>(3 * i)).setZero();
  d.v.setZero(d.x.rows(), kDirections);
  response.strains().multiply(d.x, d.c);
  d.c_rate.setZero(d.c.rows(), kDirections);
  return d;
}

}  // namespace weft
