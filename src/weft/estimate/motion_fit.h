#pragma once
/// Fit of a fabric to points that were followed over time: registered scans, tracked markers. The
/// simulated motion is compared with them at the same material points.
///
/// Unknown are parameters of the fabric, a constant delay, and any other number of the experiment
/// (SceneUnknown). Fixtures move on one clock, that of the simulation, the tracks were taken on
/// another: a point with the time stamp t was at x(t - delay). The simulation runs from node to
/// node on its own clock, which the delay does not change; between nodes the motion is the cubic
/// with the positions and velocities of both (Hermite), h^4 / 384 of the fourth derivative off.
/// What is differentiated is this cubic: by a parameter of the fabric, with the derivatives of
/// positions and velocities at the nodes (sensitivity.h); by the delay it is minus its velocity,
/// where the interpolation is exact dx/d(delay) = -v. By other numbers of the experiment
/// derivatives are central differences of two simulations.
///
/// The distance d of a simulated from a tracked point counts by its parts along the tracked
/// surface's normal and across,
///
///     s^2 = (n . d)^2 / normal^2 + |d - n (n . d)|^2 / tangential^2,   rho = s^2 / (1 + s^2 /
///     outlier^2)
///
/// (Geman and McClure), so that points that slide on the surface, as registered and tracked ones
/// do, pull less than those off it, and mistaken ones hardly. With priors of mean m and deviation d
/// in scaled coordinates x the cost is
///
///     sum weight rho / N + dispersion / 2 sum ((x - m) / d)^2,
///
/// N the sum of three times the weights. `dispersion` makes minus the logarithm of a likelihood of
/// the first term (uncertainty.h): 2 / N for points whose errors are independent, more where errors
/// last in time, as those of a model do.
///
/// All stiffness, damping and drag is known per areal density only, as long as no force is
/// measured: twice the density with twice of each of them moves alike.
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "weft/dynamics/air.h"
#include "weft/estimate/least_squares.h"
#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/uncertainty.h"
#include "weft/fabric/prior.h"

namespace weft {

/// Points of the fabric that were followed.
struct MotionTracks {
  MaterialPoints uv;             ///< 2 x points, m, on the mesh of the simulation
  std::vector<double> times;     ///< s, increasing, on the clock of the tracks
  std::vector<Points> position;  ///< a frame: 3 x points, m; any number where the weight is 0
  /// A frame: 3 x points, unit normals of the tracked surface, or zero where only the distance
  /// itself counts (by `tangential`).
  std::vector<Points> normal;
  std::vector<VecX> weight;  ///< a frame: one a point, >= 0; 0: not seen
};
/// The frames first ... last - 1.
MotionTracks frames_of(const MotionTracks& tracks, std::size_t first, std::size_t last);
/// Normals of a grid of `columns` x `rows` tracked points (point = row * columns + column), by
/// differences to neighbours that were seen; zero where there are not enough.
Points grid_normals(const Points& position, const VecX& weight, int columns, int rows);

struct MotionExperiment {
  Scene scene;  ///< frame_times: the nodes, on the clock of the fixtures
  AirMotion air;
};

struct MotionTrial {
  std::string name;
  MotionExperiment experiment;
  SimulationOptions simulation;
  MotionTracks tracks;
};

/// How far tracked points may be off, m, and where mistakes begin.
struct MotionNoise {
  double normal = 2e-3;      ///< m, standard deviation along the normal; > 0
  double tangential = 4e-3;  ///< m, of each coordinate across; > 0
  double outlier = 3;        ///< in these units, > 0; infinity: least squares
};

/// A number of the experiment that is searched, with its range and scale in `info`.
struct SceneUnknown {
  ParameterInfo info;
  double initial = 0;
  std::function<void(double value, MotionExperiment& experiment)> apply;
  double step = 1e-3;  ///< scaled coordinate, half of the central difference; > 0
  /// Of the scaled coordinate, where something is known before the data.
  std::optional<ScaledPrior> prior;
};

struct MotionUnknowns {
  std::vector<std::string> free;  ///< parameters of the fabric
  std::vector<ParameterPrior> priors;
  bool delay = false;                            ///< whether the delay, s, is searched
  double delay_lower = -0.5, delay_upper = 0.5;  ///< its range
  double delay_initial = 0;                      ///< its value if not
  std::vector<SceneUnknown> scene;               ///< the same in all trials
};

struct MotionFrames {
  std::vector<Points> position;  ///< simulated, at the tracked points, one a frame of the tracks
  bool diverged = false;
  std::string divergence;
};

/// Unknowns in the order: parameters of the fabric, delay, numbers of the scene; each scaled so
/// that its range is [0, 1].
class MotionProblem {
 public:
  /// Throws Error for no trials, tracks of other sizes than their points and frames, points off the
  /// mesh by more than rounding, noise or steps out of range, names that are not parameters or
  /// listed twice, and tracks that end after the last node whatever the delay. Before the first
  /// node the cloth is where it starts.
  MotionProblem(std::vector<MotionTrial> trials, Fabric fabric, MotionUnknowns unknowns,
                const MotionNoise& noise = {}, int threads = 0);

  int dimension() const { return static_cast<int>(infos_.size()); }
  const std::vector<ParameterInfo>& infos() const { return infos_; }
  const std::vector<MotionTrial>& trials() const { return trials_; }
  double residual_count() const { return residual_count_; }
  double dispersion() const { return dispersion_; }
  void set_dispersion(double dispersion) { dispersion_ = dispersion; }

  /// The fabric's values, and the initial delay and numbers of the scene.
  VecX scaled(const Fabric& fabric) const;
  VecX initial() const { return scaled(fabric_); }
  Fabric fabric(const VecX& scaled) const;
  double delay(const VecX& scaled) const;  ///< s

  /// Infinity where a simulation diverged.
  double cost(const VecX& scaled) const;
  struct Linearization {
    QuadraticModel model;         ///< with the priors
    std::vector<CostPart> parts;  ///< one a tracked frame, without the priors
    PriorTerm prior;              ///< the priors' own, of the dispersion at hand
    long inexact = 0;             ///< Sensitivities::inexact
  };
  Linearization linearize(const VecX& scaled) const;
  /// One a trial. Of other tracks on the same mesh (frames that were not fitted, other points), if
  /// given, one a trial.
  std::vector<MotionFrames> simulate(const VecX& scaled,
                                     const std::vector<MotionTracks>* tracks = nullptr) const;
  const VecX& prior_mean() const { return prior_mean_; }
  const VecX& prior_precision() const { return prior_precision_; }  ///< 0: no prior

 private:
  struct Frames;
  MotionExperiment experiment(std::size_t trial, const VecX& scaled) const;
  Frames differentiate(std::size_t trial, const VecX& scaled, const VecX& slopes,
                       int threads) const;
  double add_frame(std::size_t trial, std::size_t frame, const Points& x, const MatX* jacobian,
                   CostPart* part) const;
  double prior_cost(const VecX& scaled) const;
  PriorTerm prior(const VecX& scaled) const;
  void check(const MotionTrial& trial) const;
  void add_unknowns();

  std::vector<MotionTrial> trials_;
  Fabric fabric_;
  MotionUnknowns unknowns_;
  MotionNoise noise_;
  int threads_ = 0;
  std::vector<int> indices_;
  std::vector<ParameterInfo> infos_;
  VecX prior_mean_, prior_precision_;
  double residual_count_ = 0, dispersion_ = 0;
};

struct MotionFitOptions {
  MotionFitOptions() {
    least_squares.max_iterations = 40;
    least_squares.step_tolerance = 1e-4;
    least_squares.cost_tolerance = 1e-4;
    least_squares.largest_step = 0.15;
  }
  LeastSquaresOptions least_squares;
  double confidence = 0.9;  ///< of the intervals
  /// Descents, >= 1. Each but the first weighs the priors by the dispersion of the residuals that
  /// the one before left.
  int passes = 2;
};

struct MotionFitResult {
  VecX scaled;
  Fabric fabric;
  double delay = 0;  ///< s
  double cost_start = 0, cost = 0;
  int iterations = 0;  ///< linearizations
  /// Jackknife over blocks of successive frames (uncertainty.h) with the priors in every repeat, at
  /// least as wide as dispersion and priors make them. `determined`: narrower than half of what
  /// the prior alone would give (where there is one), and than half the range: the data say
  /// something. Infinite for one that is held at a bound; cut at zero where a value cannot be
  /// negative.
  std::vector<ParameterInterval> intervals;
  MatX correlation;
  double condition = 0;
  long inexact = 0;
  double wall_s = 0;
};
/// After each trial step, with its scaled coordinates and cost; false stops.
using MotionFitObserver = std::function<bool(const LeastSquaresStep&)>;

/// Throws Error if the start diverges or options are out of range.
MotionFitResult fit_motion(MotionProblem problem, const VecX& start,
                           const MotionFitOptions& options = {},
                           const MotionFitObserver& observer = {});

/// Distances of simulated from tracked points at the same (u, v), over those that were seen, m; NaN
/// for a frame without any.
struct MotionDistance {
  double mean = 0, rms = 0, median = 0;
};
MotionDistance motion_distance(const MotionTracks& tracks, std::size_t frame, const Points& x);
/// Over all points of the frames first ... last - 1.
MotionDistance motion_distance(const MotionTracks& tracks, const std::vector<Points>& x,
                               std::size_t first, std::size_t last);

}  // namespace weft
