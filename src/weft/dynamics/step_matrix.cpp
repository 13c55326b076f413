#include "weft/dynamics/step_matrix.h"

namespace weft {

StepMatrix::StepMatrix(const ClothModel& model, const std::vector<char>& held)
    : model_(model),
      factor_(model.hessian_pattern(), held, model.mesh().material),
      matrix_(model.hessian_pattern()),
      projection_(model.hessian_pattern()),
      product_(matrix_) {}

void StepMatrix::assemble(const StepPoint& at, HessianKind kind, Points& gradient) {
  assemble(at, kind, gradient, matrix_);
}

void StepMatrix::assemble(const StepPoint& at, HessianKind kind, Points& gradient,
                          SparseMatrix& matrix) const {
  matrix.coeffs().setZero();
  model_.step_hessian(at.x, at.damping, kind, at.velocity_in_air, at.rate, gradient, matrix);
  const auto diagonal = model_.diagonal_slots();
  for (std::size_t i = 0; i < diagonal.size(); ++i)
    matrix.valuePtr()[diagonal[i]] +=
        model_.masses()(static_cast<Eigen::Index>(i / 3)) * at.rate * at.rate;
}

StepMatrix::Factor StepMatrix::factorize(const StepPoint& at) {
  if (factor_.factorize(matrix_)) return Factor::of_matrix;
  assemble(at, HessianKind::positive_semidefinite, unused_gradient_, projection_);
  return factor_.factorize(projection_) ? Factor::of_projection : Factor::none;
}

}  // namespace weft
