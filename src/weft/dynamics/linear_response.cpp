#include "weft/dynamics/linear_response.h"

#include <cmath>

namespace weft {
namespace {

constexpr double kTolerance = 1e-9;  // of the largest entry of a column
constexpr int kMaxIterations = 40;
constexpr double kFirstRegularization = 1e-6;  // 1/s^2, as where equilibria are found
constexpr double kMostRegularization = 1e12;

using Row = Eigen::Array<double, 1, kDirections>;

Eigen::Map<const Row, Eigen::Aligned16> row(const Directions& m, int index) {
  return Eigen::Map<const Row, Eigen::Aligned16>(m.data() + std::ptrdiff_t{kDirections} * index);
}
Eigen::Map<Row, Eigen::Aligned16> row(Directions& m, int index) {
  return Eigen::Map<Row, Eigen::Aligned16>(m.data() + std::ptrdiff_t{kDirections} * index);
}

/// y -= A x with the lower triangle of A.
void subtract_product(const SparseMatrix& lower, const Directions& x, Directions& y) {
  const int* rows = lower.innerIndexPtr();
  const double* values = lower.valuePtr();
  for (int column = 0; column < lower.cols(); ++column) {
    const int begin = lower.outerIndexPtr()[column], end = lower.outerIndexPtr()[column + 1];
    const Row from = row(x, column);
    Row sum = Row::Zero();
    for (int k = begin; k < end; ++k) {
      const Row product = values[k] * from;
      if (rows[k] != column) sum += values[k] * row(x, rows[k]);
      row(y, rows[k]) -= product;
    }
    row(y, column) -= sum;
  }
}

Row largest(const Directions& m) { return m.cwiseAbs().colwise().maxCoeff().array(); }

}  // namespace

void LinearResponse::set_state(const ClothModel& model, const State& state,
                               const std::vector<int>& parameters) {
  model.strain_jacobian(state.x, strains_);
  model.drag_jacobian(state.x, state.v, drag_);
  const ComponentTable& table = model.components();
  factors_.setZero(state.c.size(), kDirections);
  for (Eigen::Index i = 0; i < state.c.size(); ++i) {
    const auto component = static_cast<std::size_t>(i);
    for (std::size_t p = 0; p < parameters.size(); ++p) {
      const auto column = static_cast<Eigen::Index>(p);
      if (table.stiffness[component] == parameters[p])
        factors_(i, column) -= table.weight[i] * state.c[i];
      if (table.damping[component] == parameters[p])
        factors_(i, column) -= table.weight[i] * state.c_rate[i];
    }
  }
  right_side_.setZero(state.x.size(), kDirections);
  strains_.add_transposed(factors_, right_side_);
  for (std::size_t p = 0; p < parameters.size(); ++p) {
    model.drag_derivative(state.x, state.v, parameters[p], drag_derivative_);
    right_side_.col(static_cast<Eigen::Index>(p)) += flat(drag_derivative_);
  }
}

void LinearResponse::add_inertia(const VecX& masses, const Directions& acceleration) {
  for (int i = 0; i < right_side_.rows(); ++i)
    row(right_side_, i) += masses[i / 3] * row(acceleration, i);
}

void LinearResponse::add_damping_history(const ClothModel& model,
                                         const Directions& strain_history) {
  const ComponentTable& table = model.components();
  factors_.resize(strain_history.rows(), kDirections);
  for (int i = 0; i < strain_history.rows(); ++i) {
    const double damping = model.values()[table.damping[static_cast<std::size_t>(i)]];
    row(factors_, i) = (table.weight[i] * damping) * row(strain_history, i);
  }
  strains_.add_transposed(factors_, right_side_);
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
                           const std::vector<char>& held, Directions& x) {
  for (std::size_t i = 0; i < held.size(); ++i)
    if (held[i]) x.middleRows<3>(static_cast<Eigen::Index>(3 * i)).setZero();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    residual(matrix, x);
    factor.solve(residual_);
    x += residual_;
    if ((largest(residual_) <= kTolerance * largest(x)).all()) return true;
    if (!residual_.allFinite()) return false;
  }
  return false;
}

template bool LinearResponse::solve(const SparseMatrix&, const SparseCholesky<double>&,
                                    const std::vector<char>&, Directions&);
template bool LinearResponse::solve(const SparseMatrix&, const SparseCholesky<float>&,
                                    const std::vector<char>&, Directions&);

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
    if (!response.solve(regular, cholesky, held, d.x)) exact = false;
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
