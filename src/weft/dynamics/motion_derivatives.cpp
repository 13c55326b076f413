#include "weft/dynamics/motion_derivatives.h"

#include <utility>

namespace weft {

MotionDerivatives::MotionDerivatives(const ClothModel& model,
                                     const std::vector<PointFixture>& fixtures,
                                     std::vector<int> parameters, StateDerivatives start)
    : model_(model),
      fixtures_(fixtures),
      parameters_(std::move(parameters)),
      matrix_(model, held_vertices(fixtures, model.vertex_count())),
      states_{std::move(start)} {}

void MotionDerivatives::follow(const ImplicitStep& step) {
  // None of the two that the next step can take.
  const auto other = [](std::size_t a, std::size_t b) {
    std::size_t i = 0;
    while (i == a || i == b) ++i;
    return i;
  };
  const std::size_t start = current_;
  if (step.middle) {
    const std::size_t middle = other(start, previous_);
    follow(*step.middle, start, kNone, middle);
    follow(step.end, middle, start, other(start, middle));
  } else {
    follow(step.end, start, previous_, other(start, previous_));
  }
  previous_ = start;
}

void MotionDerivatives::follow(const Stage& stage, std::size_t now, std::size_t before,
                               std::size_t end) {
  if (stage.formula.derivative != 0 || stage.strain_formula.derivative != 0) complete_rates();
  origin_ = {stage.formula, stage.strain_formula, now, before};
  differentiate(stage, origin_, states_[end]);
  rates_known_ = false;
  current_ = end;
}

StrainHistory MotionDerivatives::strain_history(const Origin& origin) const {
  const StageFormula& f = origin.strain_formula;
  StrainHistory history;
  history.add(f.current, states_[origin.now].c);
  history.add(f.derivative, states_[origin.now].c_rate);
  if (origin.before != kNone) history.add(f.previous, states_[origin.before].c);
  return history;
}

void MotionDerivatives::history(const Origin& origin, Directions StateDerivatives::*of,
                                Directions StateDerivatives::*rate, Directions& out) const {
  const StageFormula& f = origin.formula;
  const StateDerivatives& now = states_[origin.now];
  out = f.current * now.*of;
  if (f.derivative != 0) out += f.derivative * now.*rate;
  if (f.previous != 0) out += f.previous * states_[origin.before].*of;
}

void MotionDerivatives::complete_rates() {
  if (rates_known_) return;
  StateDerivatives& d = states_[current_];
  history(origin_, &StateDerivatives::v, &StateDerivatives::a, v_history_);
  d.a = origin_.formula.rate * d.v - v_history_;
  const StrainHistory strains = strain_history(origin_);
  d.c_rate.resizeLike(d.c);
  for (int i = 0; i < d.c.rows(); ++i)
    row_of(d.c_rate, i) = origin_.strain_formula.rate * row_of(d.c, i) - strains.row(i);
  rates_known_ = true;
}

void MotionDerivatives::differentiate(const Stage& stage, const Origin& origin,
                                      StateDerivatives& end) {
  const StageFormula &f = origin.formula, &c = origin.strain_formula;
  history(origin, &StateDerivatives::x, &StateDerivatives::v, x_history_);
  history(origin, &StateDerivatives::v, &StateDerivatives::a, v_history_);

  const State& state = stage.state;
  strain_history_ = c.rate * state.c - state.c_rate;
  const StepPoint at{
      state.x, state.velocity_in_air(velocity_in_air_), {c.rate, &strain_history_}, f.rate};
  matrix_.assemble(at, HessianKind::exact, gradient_);
  const StepMatrix::Factor factor = matrix_.factorize(at);

  response_.set_state(model_, state, parameters_, strain_history(origin));
  response_.add_inertia(model_.masses(), f.rate, x_history_, v_history_);
  response_.add_velocity_history(x_history_);
  const bool solved = factor != StepMatrix::Factor::none &&
                      response_.solve(matrix_.matrix(), matrix_.factor(), end.x);
  if (factor == StepMatrix::Factor::none) end.x = states_[origin.now].x;
  if (!solved || factor != StepMatrix::Factor::of_matrix) ++inexact_;
  end.v = f.rate * end.x - x_history_;
  response_.strains().multiply(end.x, end.c);
}

Directions MotionDerivatives::reactions() {
  return response_.reactions(matrix_.matrix(), fixtures_, current().x);
}

}  // namespace weft
