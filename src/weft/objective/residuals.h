#pragma once
/// The terms of the error of a frame as residuals of a least-squares problem, with derivatives.
///
/// Bhat 2003, equation 8, adds two sums of squares: wrapped differences of angles over the fold
/// mask (equation 5), and alpha times the pixels in which the silhouettes differ (equation 6).
/// Neither is ready for least squares as it stands:
///
/// Folds. At occlusion borders and edges of shadow a difference jumps, and near a quarter turn it
/// wraps. Each squared difference r^2 goes through Cauchy's loss s^2 log(1 + r^2 / s^2), which is
/// r^2 for |r| << s and grows ever more slowly beyond.
///
/// Silhouette. A count of pixels has no derivative. Both silhouettes are blurred by a Gaussian of
/// sigma px, and the residual of a pixel is the difference of the two coverages, weighted by
/// sqrt(alpha). Where outlines lie d px apart, the sum of squares per px of outline is
/// d^2 / (2 sqrt(pi) sigma) for d << sigma, and d - 2 sigma / sqrt(pi) for d >> sigma: smooth, and
/// nearly equation 6 itself for outlines further apart than the blur, without another weight.
/// (A difference of signed distances needs a band, a clamp and a scale, and its sum of squares
/// grows like d^2 where equation 6 grows like d.)
///
/// Phase, a third term beside the paper's two. At each stripe edge of the measured frame
/// (stripe_phase.h) the residual is the phase of the projector row that lights the simulated
/// surface there, minus the measured phase, wrapped to (-pi, pi]: a distance in depth along the
/// pixel's ray, where folds measure slopes. Its loss is Cauchy's too. An edge where the simulated
/// cloth is not seen or not lit costs what a phase without any relation would cost on average, so
/// that hiding cloth gains nothing; its derivative is zero. The number of edges is the measured
/// frame's, the same for all shapes.
///
/// Derivatives are those of the stripes on the moving mesh or differences of images, see
/// Derivatives: there the cloth is moved by a fraction of a pixel along each direction, and
/// rendered and filtered again. What visibility, shadow and the filters do is in them.
#include <memory>
#include <vector>

#include "weft/objective/fold_metric.h"
#include "weft/optics/render.h"

namespace weft {

struct ResidualOptions {
  double alpha = 0.1;       ///< weight of the silhouette (equation 8), >= 0
  double fold_weight = 1;   ///< >= 0; 1 but for comparisons of the terms
  double fold_scale = 1;    ///< s of Cauchy's loss, rad; > 0, infinity: plain squares
  double phase_weight = 0;  ///< rad^2 of a masked pixel's angle per rad^2 of an edge's phase; >= 0
  double phase_scale = 1;   ///< s of Cauchy's loss, rad; > 0, infinity: plain squares
  double silhouette_sigma = 3;  ///< px, (0, 64]
  /// Derivatives are taken at every so many-th pixel along each axis, and count for all; 1 to 16.
  /// The filters make neighbours nearly equal.
  int stride = 2;
  enum class Derivatives {
    analytic,     ///< of the stripes on the moving mesh (residuals_motion.h)
    differences,  ///< of rendered and filtered images: an image a direction
  } derivatives = Derivatives::analytic;
  /// Differences: px by which the fastest vertex moves; (0, 16].
  double image_step = 1;
  /// rad per px of the fastest vertex. The filters' blur of some 4 px does not let an angle turn
  /// faster; what does is a pixel at a border that jumps to another piece of cloth (differences) or
  /// a crumpled triangle (analytic), and its derivative counts as zero; > 0.
  double largest_turn = 0.2;
  /// The same for the phase. Moving by 1 px turns the phase by at most 2 pi over the stripes'
  /// period in the image (0.4 at 16 px) where the surface faces the camera, and by more the more it
  /// slants; > 0.
  double largest_phase_turn = 2;
};

/// One frame. Sums over pixels, not means.
struct FrameCost {
  FrameError error;  ///< of equations 5 and 6, for reports
  double cost = 0;   ///< sum of losses, rad^2: comparable with error.total(alpha)
  /// Parts of the cost, with their weights.
  double fold_cost = 0, silhouette_cost = 0, phase_cost = 0;
  int phase_samples = 0;  ///< edges of the measured frame; 0 if phase_weight is 0
  int phase_seen = 0;     ///< of these, where the simulated cloth is seen and lit
};
/// The same with derivatives by n directions.
struct FrameLinearization : FrameCost {
  VecX gradient;  ///< of the cost: sum of 2 w r dr
  MatX hessian;   ///< Gauss-Newton: sum of 2 w dr dr^T, with w the derivative of the loss by r^2
};

/// Renders simulated shapes and compares them with measured frames. Keeps its buffers: one a
/// thread.
class FrameResiduals {
 public:
  /// Throws Error for an option outside its range, and what Renderer and AngleMapper throw.
  FrameResiduals(const Rig& rig, const TriangleMesh& mesh, const RenderOptions& render,
                 const AngleMapOptions& angle_map, const ResidualOptions& options);
  ~FrameResiduals();
  FrameResiduals(FrameResiduals&&) noexcept;

  /// The mesh at `x`, 3 x vertices, m.
  FrameCost evaluate(const FrameFeatures& measured, const Points& x);
  /// `directions`: n columns of 3 x vertices numbers (as flat()), m per unit of each parameter; a
  /// column of zeros gives zero derivatives.
  FrameLinearization linearize(const FrameFeatures& measured, const Points& x,
                               const MatX& directions);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace weft
