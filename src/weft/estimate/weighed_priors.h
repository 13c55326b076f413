#pragma once
/// Priors in fits at rest, beside a cost that is the mean of squared differences over their noise.
#include <functional>
#include <map>
#include <string>
#include <string_view>
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

  bool empty() const { return rows_.empty() && curves_.empty(); }
  /// Adds that the curve of `row` is smooth unless the data say otherwise: in place of z^2 the sum
  ///
  ///     sum over inner knots i of h_i d_i^2 / r^2,
  ///
  /// with d_i the second divided difference of log k there, over strains of which the knots span 1,
  /// and h_i half of the way between the knot's neighbours: the integral of (log k)''^2 over r^2,
  /// of curves with a roughness of r (1 until roughen_by()). Curves that are exponential are free.
  /// No effect on a row of less than three values, and on one that the unknowns do not move. The
  /// coordinates of the values must be logarithmic. Throws Error as the constructor.
  void add_smooth_curve(std::string_view row, const std::function<Fabric(const VecX&)>& fabric,
                        int dimension);

  /// In the unit of the cost; 0 without priors.
  double weight() const { return empty() ? 0 : weight_; }
  void weigh(double weight) { weight_ = weight; }

  bool has_smooth_curves() const { return !curves_.empty(); }
  /// Of the smooth curves, by row; > 0.
  using Roughness = std::map<std::string, double, std::less<>>;
  Roughness roughness() const;
  /// Rows without a smooth curve here have no effect.
  void roughen_by(const Roughness& roughness);
  /// The most probable roughness by the evidence (to second order: D. J. C. MacKay, Neural
  /// Computation 4, 1992) and what cloth is like: log r is normal about 0 with log 2.5 as
  /// deviation, so that data which say nothing leave 1; within 0.01 and 100 in steps of a tenth of
  /// a decade, of one curve after the other, twice: with `data` the cost without priors about
  /// `scaled`, of which the likelihood is exp(-cost / weight).
  Roughness most_probable_roughness(const VecX& scaled, const QuadraticModel& data) const;

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
  struct SmoothCurve {
    std::string row;
    MatX slopes;  ///< of sqrt(h_i) d_i, by the unknowns
    VecX offset;
    double roughness = 1;
    VecX bends(const VecX& x) const { return slopes * x.head(slopes.cols()) + offset; }
  };
  std::vector<Row> rows_;
  std::vector<SmoothCurve> curves_;
  double weight_ = 0;
};

}  // namespace weft
