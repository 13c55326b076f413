#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "weft/base/types.h"

namespace weft {

/// Logarithm of a density, without its constant; -infinity where it is zero.
using LogDensity = std::function<double(const VecX& x)>;

struct SamplingOptions {
  int walkers = 0;       ///< even, more than twice the dimension; 0: 4 a dimension, at least 20
  int steps = 3000;      ///< of each walker that are kept, >= 10
  int burn_in = 1000;    ///< of each walker before them, >= 0
  double spread = 0.02;  ///< standard deviation of the walkers' starts about the start, > 0
  std::uint64_t seed = 1;
};
struct SamplingResult {
  MatX samples;           ///< dimension x (walkers * steps), step by step
  VecX autocorrelation;   ///< of each coordinate, steps
  double acceptance = 0;  ///< share of the moves, of the kept steps
  /// Independent samples that those of coordinate i are worth.
  double effective(Eigen::Index i) const { return double(samples.cols()) / autocorrelation[i]; }
};
/// After each step of all walkers; false stops with an Error.
using SamplingObserver = std::function<bool(std::size_t done, std::size_t total)>;

/// Draws from the density inside the box lower <= x <= upper by an ensemble of walkers with stretch
/// moves (Goodman and Weare 2010, equations 7 to 11, a = 2): a walker moves along the line to
/// another one, so that a density which is narrow in some directions is sampled like a round one.
/// The autocorrelation time of a coordinate is that of the walkers' own paths, averaged, summed
/// over a window of 5 times itself (Sokal 1997). Deterministic for a seed. Throws Error for options
/// out of range, bounds out of order, and a start without density.
SamplingResult sample_ensemble(const LogDensity& density, const VecX& start, const VecX& lower,
                               const VecX& upper, const SamplingOptions& options = {},
                               const SamplingObserver& observer = {});

/// What was evaluated: minus the logarithm of the likelihood, that at the estimate being 0.
struct LikelihoodPoint {
  VecX x;
  double cost = 0;
};

/// A cheap stand-in for minus the logarithm of the likelihood about an estimate: the quadratic
/// slope^T d + d^T I d / 2 with d = x - estimate and the Fisher information I, and a Gaussian
/// process that
/// carries what evaluations differ from it. Its covariance is a squared exponential; its length and
/// its noise (the error of swinging cloth is rough) are those of a small table under which each
/// evaluation is predicted best from the others (its amplitude does not matter then). Evaluations
/// where both costs are above 20 are left out: there is no density. Where the others predict no
/// better than the quadratic alone, there is no correction.
class LikelihoodSurrogate {
 public:
  /// `slope`: of the likelihood at the estimate, which priors balance there, or a bound
  /// does; else zero.
  /// Throws Error for sizes that differ.
  LikelihoodSurrogate(VecX estimate, MatX information, VecX slope,
                      const std::vector<LikelihoodPoint>& points);
  /// Corrections go no lower than the least of 0, the evaluations and the quadratic there: what was
  /// never seen is not believed.
  double cost(const VecX& x) const;
  double quadratic(const VecX& x) const;
  int points() const { return static_cast<int>(points_.cols()); }  ///< used
  double length() const { return length_; }                        ///< 0: no correction

 private:
  bool fit(const VecX& differences, double length, double noise, double& score,
           VecX& weights) const;

  VecX estimate_;
  MatX information_;
  VecX slope_;
  MatX points_;  ///< columns
  VecX weights_;
  double length_ = 0;
  double least_ = 0;
};

/// Quantile p of the values, by linear interpolation between the ordered ones. Throws Error for no
/// values and p outside [0, 1].
double sample_quantile(std::vector<double> values, double p);

}  // namespace weft
