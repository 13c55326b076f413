#include "weft/estimate/uncertainty.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/estimate/estimate_scatter.h"
#include "weft/estimate/variability.h"

namespace weft {
namespace {

/// Eigenvalues of a matrix below this part of the largest one are rounding.
constexpr double kEigenvalueRounding = 1e-13;
constexpr double kLargestCondition = 1e12;
constexpr int kMostFramesPerCluster = 5;
constexpr int kLeastClusters = 8;

/// Inverse of the standard normal distribution by Newton's method on erfc.
double normal_quantile(double p) {
  double x = 0;
  for (int i = 0; i < 100; ++i) {
    const double error = 0.5 * std::erfc(-x / std::numbers::sqrt2) - p;
    const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
    const double step = std::clamp(error / density, -1.0, 1.0);
    x -= step;
    if (std::abs(step) < 1e-14) break;
  }
  return x;
}

/// Throws Error for fewer than `least` or sizes that differ.
CostPart sum_of(const std::vector<CostPart>& clusters, std::size_t least = 2) {
  if (clusters.size() < least)
    throw Error(fmt::format("uncertainty needs at least {} frame{}", least, least > 1 ? "s" : ""));
  const Eigen::Index n = clusters.front().gradient.size();
  CostPart sum{0, 0, VecX::Zero(n), MatX::Zero(n, n)};
  for (const CostPart& cluster : clusters) {
    if (cluster.gradient.size() != n || cluster.hessian.rows() != n || cluster.hessian.cols() != n)
      throw Error("uncertainty: clusters of different sizes");
    sum.gradient += cluster.gradient;
    sum.hessian += cluster.hessian;
  }
  if (!sum.hessian.allFinite() || !sum.gradient.allFinite())
    throw Error("uncertainty: a derivative is not finite");
  return sum;
}

/// How many of a positive semidefinite matrix' eigenvalues, rising, are zero.
Eigen::Index null_count(const VecX& eigenvalues) {
  const double least = kEigenvalueRounding * eigenvalues[eigenvalues.size() - 1];
  Eigen::Index count = 0;
  while (count < eigenvalues.size() && !(eigenvalues[count] > least)) ++count;
  return count;
}

/// Orthonormal directions, n x m: those in which leaving out any one cluster leaves data behind,
/// and those that were given up.
struct DirectionSplit {
  MatX kept, lost;

  /// In coordinates of `kept`: its columns `given_up` become lost ones, those of `rest` stay.
  void give_up(const MatX& given_up, const MatX& rest) {
    MatX all(kept.rows(), lost.cols() + given_up.cols());
    all << lost, kept * given_up;
    lost = std::move(all);
    kept = kept * rest;
  }
  /// Directions among those that are kept.
  void give_up(const MatX& given_up) {
    const MatX all = orthonormal_basis(kept.transpose() * given_up);
    const MatX first = all.leftCols(given_up.cols()),
               rest = all.rightCols(all.cols() - given_up.cols());
    give_up(first, rest);
  }
};

/// The estimate without each cluster less the estimate, to first order, in coordinates of the kept
/// directions. Gives up those that a cluster decides alone.
std::vector<VecX> leave_each_out(const std::vector<CostPart>& clusters, const CostPart& sum,
                                 DirectionSplit& directions) {
  std::vector<VecX> shifts;
  for (std::size_t k = 0; k < clusters.size() && directions.kept.cols() > 0;) {
    const MatX& basis = directions.kept;
    const SymmetricEigen eigen =
        symmetric_eigen(congruence(sum.hessian - clusters[k].hessian, basis));
    if (const Eigen::Index none = null_count(eigen.values); none > 0) {
      directions.give_up(eigen.vectors.leftCols(none),
                         eigen.vectors.rightCols(basis.cols() - none));
      shifts.clear();
      k = 0;
      continue;
    }
    const VecX gradient = basis.transpose() * (sum.gradient - clusters[k].gradient);
    shifts.push_back(
        -(eigen.vectors * (eigen.vectors.transpose() * gradient).cwiseQuotient(eigen.values)));
    ++k;
  }
  return shifts;
}

}  // namespace

std::vector<CostPart> of_parameters(const std::vector<Eigen::Index>& indices,
                                    const std::vector<CostPart>& parts) {
  std::vector<CostPart> selected;
  for (const CostPart& part : parts)
    selected.push_back({part.trial, part.frame, VecX(part.gradient(indices)),
                        MatX(part.hessian(indices, indices)), part.factor});
  return selected;
}

PriorTerm of_parameters(const std::vector<Eigen::Index>& indices, const PriorTerm& prior) {
  if (prior.gradient.size() == 0) return {};
  return {VecX(prior.gradient(indices)), MatX(prior.hessian(indices, indices)),
          MatX(prior.gradient_covariance(indices, indices))};
}

double student_quantile(double p, double degrees_of_freedom) {
  if (!(p > 0 && p < 1) || !(degrees_of_freedom >= 1))
    throw Error("Student's t: p must be in (0, 1), degrees of freedom at least 1");
  if (p < 0.5) return -student_quantile(1 - p, degrees_of_freedom);
  const double a = 2 * p - 1;
  // One and two degrees of freedom in closed form; above, Cornish and Fisher's expansion about the
  // normal quantile (Abramowitz and Stegun 26.7.5).
  if (degrees_of_freedom < 2) return std::tan(0.5 * std::numbers::pi * a);
  if (degrees_of_freedom < 3) return a * std::sqrt(2 / (1 - a * a));
  const double z = normal_quantile(p), z2 = z * z, n = degrees_of_freedom;
  const double g1 = z * (z2 + 1) / 4;
  const double g2 = z * ((5 * z2 + 16) * z2 + 3) / 96;
  const double g3 = z * (((3 * z2 + 19) * z2 + 17) * z2 - 15) / 384;
  const double g4 = z * ((((79 * z2 + 776) * z2 + 1482) * z2 - 1920) * z2 - 945) / 92160;
  return z + (g1 + (g2 + (g3 + g4 / n) / n) / n) / n;
}

namespace {

MatX pseudo_inverse_of(const SymmetricEigen& eigen) {
  VecX inverse = eigen.values.cwiseInverse();
  inverse.head(null_count(eigen.values)).setZero();
  return eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose();
}

}  // namespace

MatX pseudo_inverse(const MatX& matrix) { return pseudo_inverse_of(symmetric_eigen(matrix)); }

double cluster_dispersion(const std::vector<CostPart>& clusters) {
  const CostPart sum = sum_of(clusters);
  const SymmetricEigen eigen = symmetric_eigen(sum.hessian);
  const MatX pseudo = pseudo_inverse_of(eigen);
  const VecX step = pseudo * sum.gradient;
  double scatter = 0, freedom = double(sum.gradient.size() - null_count(eigen.values));
  for (const CostPart& cluster : clusters) {
    const VecX gradient = cluster.gradient - cluster.hessian * step;
    scatter += gradient.dot(pseudo * gradient);
    const MatX share = pseudo * cluster.hessian;
    freedom -= share.cwiseProduct(share.transpose()).sum();
  }
  return freedom > 1e-9 ? scatter / freedom : kInfinity;
}

namespace {

/// The frames of each patch added up; a patch without cloth is no cluster. Empty for fewer than
/// two.
std::vector<CostPart> patch_clusters(std::vector<CostPart> patches) {
  std::erase_if(patches, [](const CostPart& patch) { return patch.hessian.isZero(0); });
  if (patches.size() < 2) patches.clear();
  return patches;
}

}  // namespace

double cluster_dispersion(const std::vector<PatchPart>& parts) {
  const std::vector<CostPart> frames = frames_of(parts);
  const std::vector<CostPart> patches = patch_clusters(patches_of(parts));
  if (frames.size() < 2 && patches.empty())
    throw Error("the scatter of residuals is known from two frames or two parts of a picture on");
  double dispersion = 0;
  if (frames.size() >= 2)
    dispersion += cluster_dispersion(join_frames(frames, frames_per_cluster(frames)));
  if (!patches.empty()) dispersion += cluster_dispersion(patches);
  return dispersion;
}

int frames_per_cluster(const std::vector<CostPart>& parts) {
  return std::clamp(static_cast<int>(parts.size()) / kLeastClusters, 1, kMostFramesPerCluster);
}

std::vector<CostPart> join_frames(const std::vector<CostPart>& parts, int frames) {
  if (frames < 1) throw Error("frames per cluster must be at least 1");
  std::vector<CostPart> joined;
  for (const CostPart& part : parts) {
    const int block = part.frame / frames;
    if (!joined.empty() && joined.back().trial == part.trial && joined.back().frame == block) {
      joined.back().gradient += part.gradient;
      joined.back().hessian += part.hessian;
    } else {
      joined.push_back({part.trial, block, part.gradient, part.hessian, part.factor});
    }
  }
  return joined;
}

ClusterCovariance cluster_covariance(const std::vector<CostPart>& clusters, const PriorTerm& prior,
                                     const MatX& alone) {
  CostPart sum = sum_of(clusters, 1);
  if (prior.gradient.size() > 0) {
    sum.gradient += prior.gradient;
    sum.hessian += prior.hessian;
  }
  const Eigen::Index n = sum.gradient.size();
  const SymmetricEigen eigen = symmetric_eigen(sum.hessian);
  const VecX& values = eigen.values;  // ascending
  ClusterCovariance result;
  result.clusters = static_cast<int>(clusters.size());
  result.condition = values[0] > 0 ? values[n - 1] / values[0] : kInfinity;
  result.without_data = null_count(values);
  DirectionSplit directions{eigen.vectors.rightCols(n - result.without_data),
                            eigen.vectors.leftCols(result.without_data)};
  if (alone.cols() > 0) directions.give_up(alone);
  const std::vector<VecX> shifts = leave_each_out(clusters, sum, directions);
  result.undetermined = directions.lost;
  result.covariance = MatX::Zero(n, n);
  if (prior.gradient.size() > 0) result.of_prior = MatX::Zero(n, n);
  const MatX& basis = directions.kept;
  if (basis.cols() == 0) return result;
  VecX mean = VecX::Zero(basis.cols());
  for (const VecX& shift : shifts) mean += shift / double(shifts.size());
  MatX spread = MatX::Zero(basis.cols(), basis.cols());
  for (const VecX& shift : shifts) spread += (shift - mean) * (shift - mean).transpose();
  const auto count = double(clusters.size());
  spread *= (count - 1) / count;
  if (prior.gradient.size() > 0) {
    const MatX back = inverse(congruence(sum.hessian, basis));
    const MatX own = congruence(congruence(prior.gradient_covariance, basis), back);
    result.of_prior = congruence(own, basis.transpose());
    spread += own;
  }
  result.covariance = congruence(spread, basis.transpose());
  return result;
}

namespace {

class UncertaintyOfEstimate {
 public:
  /// `patches` may be empty.
  UncertaintyOfEstimate(const Problem& problem, const VecX& scaled,
                        const std::vector<CostPart>& parts, std::vector<CostPart> patches,
                        const UncertaintyOptions& options)
      : problem_(problem),
        scaled_(scaled),
        options_(options),
        prior_(problem.prior_model(scaled)),
        patches_(patch_clusters(std::move(patches))) {
    if (!(options.confidence > 0 && options.confidence < 1))
      throw Error(fmt::format("confidence is {:g}, must be in (0, 1)", options.confidence));
    if (options.frames_per_cluster < 0) throw Error("frames per cluster must not be negative");
    result_.frames_per_cluster =
        options.frames_per_cluster > 0 ? options.frames_per_cluster : frames_per_cluster(parts);
    clusters_ = join_frames(parts, result_.frames_per_cluster);
    result_.dispersion = cluster_dispersion(clusters_);
    if (!patches_.empty()) result_.dispersion += cluster_dispersion(patches_);
    result_.confidence = options.confidence;
  }

  Uncertainty run() {
    const Eigen::Index n = scaled_.size();
    sort_parameters();
    result_.covariance = MatX::Zero(n, n);
    result_.correlation = MatX::Constant(n, n, std::numeric_limits<double>::quiet_NaN());
    result_.parameters.resize(static_cast<std::size_t>(n));
    if (!free_.empty()) fill(free_);
    // A held parameter is looked at together with the free ones, one at a time.
    for (const Eigen::Index i : held_) fill_held(i);
    find_information();
    warn();
    return std::move(result_);
  }

 private:
  /// Which parameters lie at a bound that holds them back.
  void sort_parameters() {
    VecX gradient = VecX::Zero(scaled_.size());
    for (const CostPart& cluster : clusters_) gradient += cluster.gradient;
    gradient += prior().gradient;
    for (Eigen::Index i = 0; i < scaled_.size(); ++i)
      (held_at_bound(scaled_[i], gradient[i]) ? held_ : free_).push_back(i);
  }

  bool is_held(Eigen::Index i) const {
    return std::find(held_.begin(), held_.end(), i) != held_.end();
  }

  /// In the unit of the cost.
  PriorTerm prior() const {
    return {weight() * prior_.gradient, weight() * prior_.hessian,
            weight() * weight() * prior_.hessian};
  }
  double weight() const { return std::isfinite(result_.dispersion) ? result_.dispersion : 0; }

  /// Of cluster_covariance(), for some of the parameters; empty without priors.
  PriorTerm prior(const std::vector<Eigen::Index>& indices) const {
    return problem_.has_prior() ? of_parameters(indices, prior()) : PriorTerm();
  }

  void find_information() {
    const double dispersion = result_.dispersion;
    const Eigen::Index n = scaled_.size();
    // Of all data; priors are none.
    result_.information = MatX::Zero(n, n);
    if (problem_.other().linearize)
      result_.information += prior_.hessian - MatX(problem_.prior_precision().asDiagonal());
    result_.slope = VecX::Zero(n);
    if (problem_.other().linearize)
      result_.slope += prior_.gradient -
                       problem_.prior_precision().cwiseProduct(scaled_ - problem_.prior_mean());
    for (const CostPart& cluster : clusters_) {
      result_.information += cluster.hessian / dispersion;
      result_.slope += cluster.gradient / dispersion;
    }
    // Once a trial.
    int trials = 0;
    double sum = 0;
    for (std::size_t k = 0; k < clusters_.size(); ++k) {
      if (k > 0 && clusters_[k].trial == clusters_[k - 1].trial) continue;
      ++trials;
      sum += dispersion / clusters_[k].factor;
    }
    result_.noise = sum / trials;
  }

  double quantile(int clusters) const {
    return student_quantile(0.5 + 0.5 * options_.confidence, clusters - 1);
  }

  static bool touched(const MatX& undetermined, Eigen::Index row) {
    return undetermined.cols() > 0 && undetermined.row(row).norm() > 1e-4;
  }

  /// Over the frames, and over the patches where there are some.
  ClusterCovariance covariance(const std::vector<Eigen::Index>& indices) const {
    ClusterCovariance found = cluster_covariance(of_parameters(indices, clusters_), prior(indices));
    if (patches_.empty()) return found;
    // The prior's own part once only.
    PriorTerm term = prior(indices);
    term.gradient_covariance *= 0;
    const ClusterCovariance across = cluster_covariance(of_parameters(indices, patches_), term);
    const VecX left = step_left(indices, found.undetermined);
    found.covariance += across.covariance + left * left.transpose();
    found.clusters = std::min(found.clusters, across.clusters);
    MatX both(found.undetermined.rows(), found.undetermined.cols() + across.undetermined.cols());
    both << found.undetermined, across.undetermined;
    found.undetermined = std::move(both);
    return found;
  }

  /// From the estimate to the minimum of the linearization, in the determined directions.
  VecX step_left(const std::vector<Eigen::Index>& indices, const MatX& undetermined) const {
    CostPart sum = sum_of(of_parameters(indices, clusters_));
    if (const PriorTerm term = prior(indices); term.gradient.size() > 0) {
      sum.gradient += term.gradient;
      sum.hessian += term.hessian;
    }
    // What pulls at a bound is no dent: that parameter's minimum lies beyond.
    for (std::size_t a = 0; a < indices.size(); ++a)
      if (is_held(indices[a])) sum.gradient[static_cast<Eigen::Index>(a)] = 0;
    const MatX lost = undetermined * undetermined.transpose();
    const MatX kept = MatX::Identity(lost.rows(), lost.cols()) - lost;
    // With a stiffness of their own the undetermined directions stay apart.
    const MatX regular = kept * sum.hessian * kept + sum.hessian.diagonal().maxCoeff() * lost;
    return -solve_symmetric(regular, kept * sum.gradient);
  }

  void fill(const std::vector<Eigen::Index>& indices) {
    const ClusterCovariance found = covariance(indices);
    result_.condition = found.condition;
    result_.clusters = found.clusters;
    for (std::size_t a = 0; a < indices.size(); ++a) {
      const auto row = static_cast<Eigen::Index>(a);
      const double sigma = std::sqrt(found.covariance(row, row));
      const bool lost = touched(found.undetermined, row);
      set(indices[a], lost ? kInfinity : quantile(found.clusters) * sigma);
      for (std::size_t b = 0; b < indices.size(); ++b) {
        const auto column = static_cast<Eigen::Index>(b);
        result_.covariance(indices[a], indices[b]) = found.covariance(row, column);
        if (!lost && !touched(found.undetermined, column))
          result_.correlation(indices[a], indices[b]) =
              row == column ? 1
                            : found.covariance(row, column) /
                                  (sigma * std::sqrt(found.covariance(column, column)));
      }
    }
  }

  void fill_held(Eigen::Index i) {
    std::vector<Eigen::Index> indices = free_;
    indices.push_back(i);
    const ClusterCovariance found = covariance(indices);
    const auto row = static_cast<Eigen::Index>(free_.size());
    const bool lost = touched(found.undetermined, row);
    if (free_.empty()) {
      result_.condition = found.condition;
      result_.clusters = found.clusters;
    }
    set(i, lost ? kInfinity : quantile(found.clusters) * std::sqrt(found.covariance(row, row)));
  }

  /// `scatter`: half the interval that the scatter of the residuals makes.
  void set(Eigen::Index i, double scatter) {
    const double half_width =
        options_.systematic.size() > 0 ? scatter + options_.systematic[i] : scatter;
    const ParameterInfo& info = problem_.info(static_cast<int>(i));
    ParameterInterval& p = result_.parameters[static_cast<std::size_t>(i)];
    p.name = info.name;
    p.unit = info.unit;
    p.value = from_scaled(info, scaled_[i]);
    p.half_width = half_width;
    p.determined = half_width <= widest_half_interval;
    p.at_lower = scaled_[i] < at_bound_distance;
    p.at_upper = scaled_[i] > 1 - at_bound_distance;
    const bool held = is_held(i);
    p.lower = p.value;
    p.upper = p.value;
    // No parameter of the model may be negative.
    if (!(held && p.at_lower)) p.lower = std::max(0.0, from_scaled(info, scaled_[i] - half_width));
    if (!(held && p.at_upper)) p.upper = from_scaled(info, scaled_[i] + half_width);
    if (p.determined) return;
    const bool told = problem_.prior_precision()[i] == 0;  // a prior's single end is not the data's
    open_ends(info, scaled_[i], told ? half_width : kInfinity, p);
  }

  void warn() {
    if (result_.condition > kLargestCondition)
      result_.warnings.push_back(fmt::format(
          "the condition number of the problem is {:.1g}: some combination of parameters is not "
          "determined by the data",
          result_.condition));
    for (const ParameterInterval& p : result_.parameters) {
      if (p.at_lower || p.at_upper)
        result_.warnings.push_back(fmt::format("{} lies at the {} bound of its range ({:.4g} {})",
                                               p.name, p.at_lower ? "lower" : "upper", p.value,
                                               p.unit));
      if (!p.determined)
        result_.warnings.push_back(fmt::format("{} is not determined by the data", p.name));
    }
  }

  const Problem& problem_;
  const VecX& scaled_;
  const UncertaintyOptions& options_;
  const QuadraticModel prior_;
  std::vector<CostPart> clusters_, patches_;
  std::vector<Eigen::Index> free_, held_;
  Uncertainty result_;
};

}  // namespace

Uncertainty estimate_uncertainty(const Problem& problem, const VecX& scaled,
                                 const std::vector<CostPart>& parts,
                                 const UncertaintyOptions& options) {
  if (scaled.size() != problem.dimension())
    throw Error("uncertainty: the estimate and the problem differ in size");
  return UncertaintyOfEstimate(problem, scaled, parts, {}, options).run();
}

Uncertainty estimate_uncertainty(const Problem& problem, const VecX& scaled,
                                 const std::vector<PatchPart>& parts,
                                 const UncertaintyOptions& options) {
  if (scaled.size() != problem.dimension())
    throw Error("uncertainty: the estimate and the problem differ in size");
  return UncertaintyOfEstimate(problem, scaled, frames_of(parts), patches_of(parts), options).run();
}

}  // namespace weft
