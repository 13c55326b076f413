#pragma once
/// What a fit to mechanical tests minimizes: differences of forces and shapes at equilibrium, with
/// their exact sensitivities (Miguel et al. 2012, section 5.1, equations 6 to 9), in the scaled
/// coordinates of parameter.h.
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "weft/estimate/cord_friction.h"
#include "weft/estimate/force_weights.h"
#include "weft/estimate/least_squares.h"
#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/mechanical_store.h"
#include "weft/estimate/mechanical_trial.h"
#include "weft/estimate/weighed_priors.h"

namespace weft {

/// What of a capture is compared, beside the poses of loaded clips (pose_residuals.h), which always
/// are.
enum class MechanicalResiduals {
  /// Forces where two clips or more pull on the cloth, points where a single one holds it (its
  /// force is the weight, whatever the material).
  automatic,
  forces,
  points,
  both,
  /// As `automatic`, and beside the forces of tests of stretch (isolated_strain.h) points. Between
  /// clips that move apart these say where the clips are, which is what the noise of poses hides;
  /// the folds of a shear follow the cells by more than such points are off.
  stretch_points
};
/// "auto", "forces", "points", "both", "stretch-points". Throws Error for another name.
MechanicalResiduals mechanical_residuals_from_name(std::string_view name);

/// Which components of a clip's force are compared.
enum class MechanicalForces {
  all,
  /// That along the long side of the clip, where all three were measured: in an even shear it is of
  /// the shear alone, while the one across is of the stretch (Miguel et al. 2012, section 5.1). All
  /// of a capture that has no such force, as of a bias extension or a picture
  /// frame, of which the pull is measured.
  along_clips
};

/// Of which captures the friction of the cords (cord_friction.h) is found with the fabric.
enum class CordFriction {
  none,
  as_captured,  ///< of those that say that cords pull their clips
  fitted        ///< of all in which forces are compared and clips move
};
/// "none", "auto", "fit". Throws Error for another name.
CordFriction cord_friction_from_name(std::string_view name);

/// A parameter that is not searched but has the value of one that is.
struct ParameterTie {
  std::string follower, leader;
};

struct MechanicalCostOptions {
  MechanicalResiduals residuals = MechanicalResiduals::automatic;
  MechanicalForces forces = MechanicalForces::all;
  std::vector<ParameterTie> ties;  ///< of parameters that are not free to ones that are
  CordFriction cord_friction = CordFriction::as_captured;
  double least_way = least_clip_way;  ///< m, of ways_of_clip(); > 0
  double force_noise = 3e-3;          ///< N, standard deviation of a component; > 0
  double point_noise = 75e-6;         ///< m, of a coordinate; > 0
  /// N: a frame whose largest net force is above counts as without equilibrium.
  double largest_residual = 1e-5;
  /// Of rows of the fabric; those that are not free have no effect.
  std::vector<ParameterPrior> priors{};
  /// Rows of which the curves are smooth unless the data say otherwise
  /// (WeighedPriors::add_smooth_curve()).
  std::vector<std::string> smooth{};
};

/// Equilibria of an evaluation, for others to start from; none at first. Where the evaluation was
/// found in a store they stay there until they are asked for.
class MechanicalShapes {
 public:
  /// `chain`: a word; in a store they make room for later ones of their chain only.
  explicit MechanicalShapes(std::string chain) : chain_(std::move(chain)) {}
  MechanicalShapes() : MechanicalShapes("fit") {}
  /// Whether there is nothing to start from.
  bool empty() const { return evaluation_.empty() && !frames_ && !source_; }

 private:
  friend class MechanicalProblem;
  std::string chain_;
  std::string evaluation_;  ///< its key in the store; empty without one
  std::shared_ptr<const MechanicalFrames> frames_;
  /// Of starts that are no equilibria: where those are that they are made of.
  struct Source;
  std::shared_ptr<const Source> source_;
};

/// Sum over frames of squared differences, each divided by its noise (of readings of an overhang,
/// the deviation that the capture states); the cost is its mean over the compared numbers (1 for a
/// model that lacks nothing and noise as stated). Priors are no part of it, nor of its
/// linearization: a fit adds them.
///
/// Where captures state a noise of their clips, differences of forces and of loaded clips are
/// weighed with it (force_weights.h) once weigh_by() has said how: as at one fabric, with clips
/// where they are most probably with that, whatever fabric is asked for then. Weights that followed
/// the fabric would make the cost smaller the stiffer it is.
///
/// Friction of the cords is one number f >= 0 for each of some captures, beside the fabric's
/// parameters. Its differences are linear in it, r + f w with the ways w of cord_friction.h over
/// the noise, so that it is never searched: for any fabric it has its best value, f = max(0, -r^T w
/// / w^T w), which cost() and the model of linearize() are at.
class MechanicalProblem {
 public:
  /// `free`: parameters of the fabric's model to search, distinct. Throws Error for none, for names
  /// that the model does not have, for options out of range, and where nothing is compared.
  MechanicalProblem(std::vector<std::shared_ptr<const MechanicalTrial>> trials, Fabric fabric,
                    const std::vector<std::string>& free, const MechanicalCostOptions& options = {},
                    int threads = 0);

  int dimension() const { return static_cast<int>(indices_.size()); }
  ParameterInfo info(int i) const { return fabric_.info(indices_[static_cast<std::size_t>(i)]); }
  const std::vector<std::shared_ptr<const MechanicalTrial>>& trials() const { return trials_; }
  double residual_count() const { return residual_count_; }
  /// Share of the forces in that, where points are compared as well as forces; 1 otherwise.
  double force_share() const { return force_share_; }
  /// Captures whose cord friction is found: places among trials().
  std::vector<std::size_t> with_friction() const;
  /// Of the i-th of these: N, up to the largest measured force, and as far below zero so that an
  /// estimate of zero is inside.
  ParameterInfo friction_info(std::size_t i) const;
  /// The same on cells of half the width. Throws Error where these would be more than may be.
  MechanicalProblem refined() const;
  /// The same on half as many cells along a side; none where these would be few.
  std::optional<MechanicalProblem> on_half_the_cells() const;
  VecX scaled(const Fabric& fabric) const;
  Fabric fabric(const VecX& scaled) const;

  /// Weighed as if residuals scattered as stated, until weigh_priors() says otherwise.
  const WeighedPriors& priors() const { return priors_; }
  void weigh_priors(double weight) { priors_.weigh(weight); }
  void roughen_by(const WeighedPriors::Roughness& roughness) { priors_.roughen_by(roughness); }

  /// Whether a capture of which forces are compared states a noise of its clips.
  bool has_clip_noise() const;
  enum class ClipPlaces {
    as_weighed,  ///< where the problem's weights have them, or as measured
    /// Of captures of which points are compared, without which the forces would be made what the
    /// fabric asks for: where they are most probably with that, by Gauss and Newton from there,
    /// each frame for itself, until all together would lower the sum of squares by less than 1
    /// (three steps at most); a step that does not lower that of its frame is halved.
    most_probable
  };
  /// Those of the fabric at `scaled`; none without such a capture, and where a frame has no
  /// equilibrium. `near` as of cost().
  ForceWeights force_weights(const VecX& scaled, MechanicalShapes* near = nullptr,
                             ClipPlaces places = ClipPlaces::most_probable) const;
  /// As force_weights() of this problem, or of one with the same trials and compared components,
  /// returns them.
  void weigh_by(ForceWeights weights);
  const ForceWeights& weights() const { return weights_; }

  /// Infinity where a frame has no equilibrium or the model refuses the values; `reason` then says
  /// which. `near`: equilibria to start from, where there are any; those that were found, after.
  double cost(const VecX& scaled, std::string* reason = nullptr,
              MechanicalShapes* near = nullptr) const;
  struct Linearization {
    /// Of the free parameters; friction follows them (its Schur complement), where it is not zero.
    QuadraticModel model;
    /// One a frame that is compared, of a capture that is a single shape one a piece of it, eight
    /// at most; with rows for the friction of with_friction(), coordinates scaled by
    /// friction_info(), after those of the free parameters.
    std::vector<CostPart> parts;
    VecX friction;       ///< N, of with_friction()
    int inexact = 0;     ///< frames with inexact derivatives
    std::string reason;  ///< where the cost is infinite, as of cost()
  };
  Linearization linearize(const VecX& scaled, MechanicalShapes* near = nullptr) const;
  /// Those that evaluations starting `near` would start from; null for none.
  std::shared_ptr<const MechanicalFrames> frames(const MechanicalShapes& near) const;
  /// The equilibria in `shapes` as starts for the same captures on other cells, or for a fabric far
  /// from theirs: nearer than the measured shapes, but no equilibria there. None for none.
  MechanicalShapes as_starts(const MechanicalShapes& shapes, std::string chain) const;

  /// A hash of all that decides cost and derivatives: captures, meshes, fabric, parameters,
  /// options.
  std::string fingerprint() const;
  /// Evaluations are then taken from there, or added. Several problems may share a store. Shapes
  /// that were found before must not be used after.
  void keep_in(std::shared_ptr<MechanicalStore> store);
  /// Evaluations that were taken from the store since it was opened.
  std::size_t replayed() const { return store_ ? store_->replayed() : 0; }

 private:
  enum class Question { cost, linearization, weights, found_weights };
  /// The numbers of the answer, the cost first; `found` stays empty where that is infinite. `from`
  /// is null where there is nothing to start from.
  using Answer = std::function<VecX(const MechanicalFrames* from, MechanicalFrames& found)>;
  VecX ask(Question question, const VecX& scaled, MechanicalShapes* near,
           const Answer& answer) const;
  std::string key(Question question, const VecX& scaled, const MechanicalShapes* near) const;
  bool has_clip_noise(const MechanicalTrial& trial) const;
  MatX compared_directions(const MechanicalTrial& trial, int frame) const;
  SharedErrors shared_errors(const MechanicalTrial& trial, const MechanicalFrame& frame) const;
  ForceWeights weights_of(const MechanicalFrames& frames) const;
  /// weights_of() where the clips are most probably, with `frames` then of there.
  ForceWeights found_weights(const VecX& scaled, MechanicalFrames& frames) const;
  double cost_of(const MechanicalFrames& frames) const;
  Linearization linearization_of(const MechanicalFrames& frames, const VecX& scaled) const;
  /// Differences of a frame.
  struct Residuals {
    VecX values;
    VecX ways;      ///< by friction, 1/N; zero where that is not found
    MatX jacobian;  ///< by the model's parameters
  };
  /// Where the clips of a frame would be by its differences, with friction `friction` (N).
  struct PoseStep {
    VecX moves;       ///< as of PoseErrors
    double squares;   ///< where they are: of the differences and of the moves
    double gain = 0;  ///< of that, to first order
  };
  using PoseSteps = std::vector<std::vector<PoseStep>>;
  PoseStep pose_step(std::size_t trial, const MechanicalFrame& frame, double friction) const;
  /// `friction`: one a trial.
  PoseSteps pose_steps(const MechanicalFrames& frames, const VecX& friction) const;
  struct Friction {
    std::size_t trial;
    std::vector<Points> ways;  ///< one a fixture
    double largest_force;      ///< N
  };
  void add_ties();
  void add_friction(std::size_t trial);
  /// Place among friction_; its size for a trial without.
  std::size_t friction_of(std::size_t trial) const;
  double best_friction(std::size_t trial, const std::vector<MechanicalFrame>& frames) const;
  bool uses_forces(const MechanicalTrial& trial) const;
  std::size_t force_count(const MechanicalTrial& trial) const;
  bool only_along_clips(const MechanicalTrial& trial) const;
  /// Calls `add` with each compared component of a frame's forces: the fixture, the direction, and
  /// the measured value (N).
  template <typename Add>
  void for_each_force(const MechanicalTrial& trial, int frame, const Add& add) const;
  void add_force_residuals(std::size_t trial, const MechanicalFrame& frame,
                           MechanicalDerivatives derivatives, Eigen::Index& count,
                           Residuals& r) const;
  std::vector<Eigen::Index> compared_coordinates(const MechanicalTrial& trial, int frame) const;
  void weigh(std::size_t trial, int frame, Residuals& r) const;
  bool uses_points(const MechanicalTrial& trial) const;
  /// Whether ClipPlaces::most_probable moves those of the trial.
  bool moves_clips(const MechanicalTrial& trial) const;
  /// From `from` where it is there, and from the measured shapes where that fails. The reason why
  /// there is no equilibrium, with no frames; empty where there is.
  std::string simulate(const VecX& scaled, MechanicalDerivatives derivatives,
                       const MechanicalFrames* from, MechanicalFrames& frames) const;
  /// As they are, but of an overhang, which no pose has to do with, and weighed with it.
  void differences(std::size_t trial, const MechanicalFrame& frame,
                   MechanicalDerivatives derivatives, Residuals& r) const;
  void residuals(std::size_t trial, const MechanicalFrame& frame, MechanicalDerivatives derivatives,
                 Residuals& r) const;

  std::vector<std::shared_ptr<const MechanicalTrial>> trials_;
  Fabric fabric_;
  std::vector<int> indices_;
  std::vector<std::vector<int>> followers_;  ///< of each free parameter
  MechanicalCostOptions options_;
  int threads_ = 0;
  double residual_count_ = 0, force_share_ = 1;
  std::vector<Friction> friction_;
  ForceWeights weights_;
  ClipMoves moves_;  ///< of weights_; no trials: none
  WeighedPriors priors_;
  std::shared_ptr<MechanicalStore> store_;
  std::string fingerprint_;  ///< with a store
};

}  // namespace weft
