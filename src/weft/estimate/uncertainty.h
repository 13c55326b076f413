#pragma once
#include <string>
#include <vector>

#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/patch_parts.h"

namespace weft {

/// How sure a least-squares estimate is.
///
/// Residuals of neighbouring pixels are not independent: the filters blur over some 10 px, and what
/// the model lacks shows in all of a frame at once. s^2 H^-1 with s^2 from the residuals would make
/// intervals absurdly small. So the spread is measured on clusters of residuals (frames, or blocks
/// of successive frames) that are taken to be independent of each other, whatever goes on inside:
/// the estimate is repeated, to first order, without each cluster in turn (the jackknife),
///
///     d_k = -(H - H_k)^-1 (g - g_k),   C = (K - 1) / K sum_k (d_k - mean d) (d_k - mean d)^T,
///
/// with g_k and H_k the cluster's gradient and Gauss-Newton matrix, g and H their sums. Unlike the
/// sandwich H^-1 (sum g_k g_k^T) H^-1, which it approaches for many clusters, it is not too small
/// where few clusters decide a parameter (MacKinnon and White 1985, HC3; Bell and McCaffrey 2002).
/// Intervals take Student's t with K - 1 degrees of freedom.
struct ClusterCovariance {
  MatX covariance;  ///< n x n; of the determined subspace
  /// Columns: orthonormal directions that no cluster, or a single one, determines; n x m. Those
  /// that none does come first.
  MatX undetermined;
  Eigen::Index without_data = 0;  ///< how many of these no cluster determines
  MatX of_prior;                  ///< the prior's own part of the covariance; empty without one
  double condition = 0;           ///< of H; infinity where singular
  int clusters = 0;
};
/// What is known besides the clusters and never left out: gradient and matrix add to theirs, and
/// the gradient's own covariance adds H^-1 (that) H^-1 to the result. Empty: nothing.
struct PriorTerm {
  VecX gradient;
  MatX hessian, gradient_covariance;
};
/// Their rows and columns of some parameters.
std::vector<CostPart> of_parameters(const std::vector<Eigen::Index>& indices,
                                    const std::vector<CostPart>& parts);
PriorTerm of_parameters(const std::vector<Eigen::Index>& indices, const PriorTerm& prior);

/// With a single cluster all it determines is undetermined. `alone`: orthonormal directions that
/// count as determined by a single cluster whatever the prior says there; empty: none. Throws Error
/// for no cluster, or sizes that differ.
ClusterCovariance cluster_covariance(const std::vector<CostPart>& clusters,
                                     const PriorTerm& prior = {}, const MatX& alone = {});

/// Of a symmetric positive semidefinite matrix: its inverse in the directions that are not zero to
/// rounding, and zero in the others.
MatX pseudo_inverse(const MatX& matrix);

/// How much more (or less) the gradient scatters than a cost of squares with independent residuals
/// of variance 1/2 would have it: phi in cov(g_k) = phi H_k, so that phi H^-1 is the covariance of
/// the estimate and H / phi the Fisher information of the data. From the clusters,
///
///     phi = sum_k g_k^T H^+ g_k / (m - sum_k tr((H^+ H_k)^2)),
///
/// with g_k taken at the stationary point of the linearization and m the rank of H; unbiased where
/// cov(g_k) = phi H_k holds. One number from all clusters and parameters, it is far steadier than
/// the matrix of cluster_covariance(), whose inverse is of no use with few clusters. Infinity where
/// one cluster decides alone. Throws Error for fewer than two clusters, or sizes that differ.
double cluster_dispersion(const std::vector<CostPart>& clusters);

/// The sum of it over blocks of frames and over patches of the picture: what estimate_uncertainty()
/// takes. Where all frames show the same, as a swatch at rest, frames alone scatter by the noise of
/// the pixels only, and the data would seem to be far surer than they are. Of a single frame that
/// of the patches. Throws Error where there are fewer than two of both.
double cluster_dispersion(const std::vector<PatchPart>& parts);

/// Successive parts of a trial joined into blocks of `frames`; the last block may be shorter.
std::vector<CostPart> join_frames(const std::vector<CostPart>& parts, int frames);

/// Frames of a cluster where nothing else is known: what the model lacks lasts for some frames, so
/// up to 5 of them, but at least 8 clusters where there are so many frames.
int frames_per_cluster(const std::vector<CostPart>& parts);

struct UncertaintyOptions {
  double confidence = 0.9;  ///< of the intervals, (0, 1)
  /// Successive frames whose residuals are taken to depend on each other; 0: frames_per_cluster().
  int frames_per_cluster = 0;
  /// Added to the half widths, scaled coordinates, >= 0; empty: nothing.
  VecX systematic{};
};

/// Scaled coordinate: an interval of half the range and more to either side says nothing.
inline constexpr double widest_half_interval = 0.5;
/// Of a prior's own interval: one that is wider is not the data's.
inline constexpr double widest_beside_prior = 0.5;

/// One parameter. Symmetric in its search coordinate, so not in its own unit.
struct ParameterInterval {
  std::string name, unit;
  double value = 0;
  /// Of the interval, not of the range. Where not determined at most one end is left, which is
  /// inside of the range; the other is infinite, or 0 (open_ends()).
  double lower = 0, upper = 0;
  /// Half the interval in scaled coordinates, 1 being the whole range of the search.
  double half_width = 0;
  bool determined = true;  ///< half_width is at most widest_half_interval
  bool by_prior = false;   ///< known, but not determined by the data: the interval is the prior's
  bool at_lower = false, at_upper = false;  ///< lies at a bound of the search
  bool bounded() const { return determined || by_prior; }
};

struct Uncertainty {
  std::vector<ParameterInterval> parameters;
  MatX covariance;   ///< scaled coordinates; rows of parameters that are held at a bound are zero
  MatX correlation;  ///< -1 to 1; NaN for parameters that are not determined
  /// Fisher information of the data about all parameters, held or not, scaled coordinates:
  /// H / cluster_dispersion(). Singular where the data do not determine a direction.
  MatX information;
  /// Gradient of minus the logarithm of the data's likelihood, as `information`: not near zero for
  /// a parameter that a bound or a prior holds.
  VecX slope;
  /// cluster_dispersion() of the sums over the pixels of a frame, rad^2: twice the variance of a
  /// pixel's residual times the number of pixels that count as one. Mean over the trials.
  double noise = 0;
  double dispersion = 0;  ///< cluster_dispersion(), in the unit of the cost
  int frames_per_cluster = 0;
  double condition = 0;
  int clusters = 0;
  double confidence = 0;
  std::vector<std::string> warnings;
};

/// Of the estimate at `scaled`, from the parts of its linearization and the problem's priors, whose
/// weight is the cluster_dispersion(). Parameters at a bound towards
/// which the cost still falls are held for the intervals of the others; their own interval reaches
/// from the bound inwards by what it would be if they were free.
Uncertainty estimate_uncertainty(const Problem& problem, const VecX& scaled,
                                 const std::vector<CostPart>& parts,
                                 const UncertaintyOptions& options = {});

/// The same from parts that are split among patches of the picture, with the covariance
///
///     C = (jackknife over blocks of frames) + (jackknife over patches, all frames of each) + d
///     d^T.
///
/// Leaving out frames does not see what is wrong in all of them alike: the outline that the camera
/// sees a little inside of the true one, the mesh, a term that the model lacks. Those errors do
/// differ from place to place in the picture, over a fold's width; leaving out each place in turn
/// shows them. Clusters in two ways (Cameron, Gelbach and Miller 2011), without their third term,
/// the cells' own scatter that the sum counts twice: it could make C indefinite, and it is small
/// where errors last in time or reach across the picture. What is wrong everywhere alike is still
/// not seen.
///
/// d = -H^-1 g is the way from the estimate to the minimum that the linearization has: where the
/// error is rough a search ends in a dent beside it, and which of the two is nearer to the truth is
/// not known. The way of a parameter beyond the bound that holds it is no part of d. The quantile
/// is that of the smaller number of clusters, the dispersion the sum of both.
Uncertainty estimate_uncertainty(const Problem& problem, const VecX& scaled,
                                 const std::vector<PatchPart>& parts,
                                 const UncertaintyOptions& options = {});

/// Quantile of Student's t distribution, 0 < p < 1, degrees of freedom >= 1; relative error below
/// 1e-3 from 3 degrees of freedom on.
double student_quantile(double p, double degrees_of_freedom);

}  // namespace weft
