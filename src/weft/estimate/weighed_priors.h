#pragma once
/// Priors in fits at rest, beside a cost that is the mean of squared differences over their noise.
#include <functional>
#include <vector>

#include "weft/estimate/least_squares.h"
#include "weft/estimate/uncertainty.h"
#include "weft/fabric/fabric.h"
#include "weft/fabric/prior.h"

namespace weft {

class ContentHash;

/// What is known of a problem's unknowns before its data, added to the cost as
///
///     weight * sum z^2 / 2,   z = (t - mean) / deviation (prior.h),
///
/// where t is the mean of the scaled coordinates of the row's values: one number, or the control
/// values of a curve, whose prior then does not grow with their number. Values that several
/// unknowns or none stand for (ties, multiples) count as what the unknowns make of them. With the
/// cost's dispersion as weight (residual_dispersion()) the sum is minus the logarithm of a
/// posterior density times that weight, as beside videos.
class WeighedPriors {
 public:
  WeighedPriors() = default;
  /// Of `dimension` unknowns x in scaled coordinates, which make `fabric(x)`; the scaled
  /// coordinates of its values must be linear in x. Priors of rows that the unknowns do not move
  /// have no effect. Weight > 0. Throws Error for a row that the model does not have.
  WeighedPriors(const std::vector<ParameterPrior>& priors, int dimension,
                const std::function<Fabric(const VecX& scaled)>& fabric, double weight);

  bool empty() const { return rows_.empty(); }
  /// In the unit of the cost; 0 without priors.
  double weight() const { return empty() ? 0 : weight_; }
  void weigh(double weight) { weight_ = weight; }
  /// weight * sum z^2 / 2; 0 without priors. The coordinates may be followed by others.
  double cost(const VecX& scaled) const;
  /// Adds cost, gradient and Hessian, the latter two to the first unknowns of the model: it may
  /// have more.
  void add_to(const VecX& scaled, QuadraticModel& model) const;
  /// Of `size` unknowns, the first of which are these; empty without priors.
  PriorTerm term(const VecX& scaled, Eigen::Index size) const;
  /// All but the weight; nothing without priors.
  void add_to(ContentHash& hash) const;

 private:
  struct Row {
    VecX slope;         ///< of t, by the unknowns
    double offset = 0;  ///< of t - mean, with all unknowns zero
    double deviation = 1;
    double z(const VecX& x) const { return (slope.dot(x.head(slope.size())) + offset) / deviation; }
  };
  std::vector<Row> rows_;
  double weight_ = 0;
};

}  // namespace weft
