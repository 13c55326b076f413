#pragma once
#include <array>
#include <vector>

#include "weft/dynamics/implicit_stepper.h"
#include "weft/dynamics/linear_response.h"
#include "weft/dynamics/step_matrix.h"

namespace weft {

/// Follows the derivatives of a motion by parameters of the fabric from step to step: the equation
/// in sensitivity.h. A step's derivatives take its end states and formulas alone, so that they can
/// be computed while the next steps are taken.
class MotionDerivatives {
 public:
  /// `start`: those of the state the motion starts from, by `parameters`.
  MotionDerivatives(const ClothModel& model, const std::vector<PointFixture>& fixtures,
                    std::vector<int> parameters, StateDerivatives start);

  void follow(const ImplicitStep& step);
  /// At the end of the last step; a and c_rate are those of an earlier one.
  const StateDerivatives& current() const { return states_[current_]; }
  /// Of the forces that hold the fixtures, at the end of the last step, 3 fixtures rows. Not before
  /// the first.
  Directions reactions();
  /// Linear systems that were not solved as they should (sensitivity.h).
  long inexact() const { return inexact_; }

 private:
  /// A stage's formulas, and the states that they take.
  struct Origin {
    StageFormula formula, strain_formula;
    std::size_t now, before;  // of states_; before: kNone if there is none
  };
  static constexpr std::size_t kNone = 3;
  void differentiate(const Stage& stage, const Origin& origin, StateDerivatives& end);
  void follow(const Stage& stage, std::size_t now, std::size_t before, std::size_t end);
  void complete_rates();
  StrainHistory strain_history(const Origin& origin) const;
  /// H of the derivatives of x or of v, whose own derivatives by time are those in `rate`.
  void history(const Origin& origin, Directions StateDerivatives::*of,
               Directions StateDerivatives::*rate, Directions& out) const;

  const ClothModel& model_;
  const std::vector<PointFixture>& fixtures_;
  std::vector<int> parameters_;
  StepMatrix matrix_;
  LinearResponse response_;
  // Of the last two steps, and of a stage in the middle or none.
  std::array<StateDerivatives, 3> states_;
  std::size_t current_ = 0, previous_ = kNone;
  // Few formulas take a and c_rate of the state they start from: they are made when one does, of
  // what that state was made of.
  Origin origin_{};
  bool rates_known_ = true;
  long inexact_ = 0;
  // Work space.
  Directions x_history_, v_history_;
  VecX strain_history_;
  Points velocity_in_air_, gradient_;
};

}  // namespace weft
