#pragma once
/// Values of several kinds as one list of numbers, which is what a NumberStore keeps.
#include <vector>

#include "weft/base/types.h"
#include "weft/estimate/linearize_trial.h"

namespace weft {

class NumberWriter {
 public:
  void add(double number) { numbers_.push_back(number); }
  /// The coefficients alone, column by column: who reads them knows the size.
  template <typename Derived>
  void add(const Eigen::PlainObjectBase<Derived>& values) {
    numbers_.insert(numbers_.end(), values.data(), values.data() + values.size());
  }
  VecX numbers() const {
    return VecX::Map(numbers_.data(), static_cast<Eigen::Index>(numbers_.size()));
  }

 private:
  std::vector<double> numbers_;
};

/// Asked in the order in which they were written. Keeps a reference.
class NumberReader {
 public:
  explicit NumberReader(const VecX& numbers) : numbers_(numbers) {}
  bool done() const { return next_ >= numbers_.size(); }
  double number() { return numbers_[next_++]; }
  VecX vector(Eigen::Index size) {
    next_ += size;
    return numbers_.segment(next_ - size, size);
  }
  MatX matrix(Eigen::Index rows, Eigen::Index columns) {
    return vector(rows * columns).reshaped(rows, columns);
  }

 private:
  const VecX& numbers_;
  Eigen::Index next_ = 0;
};

/// Trial, frame, gradient and matrix of each.
void add_parts(const std::vector<CostPart>& parts, NumberWriter& writer);
/// All that are left to read, of `size` parameters.
std::vector<CostPart> read_parts(NumberReader& reader, Eigen::Index size);

}  // namespace weft
