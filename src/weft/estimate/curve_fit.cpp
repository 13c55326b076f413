#include "weft/estimate/curve_fit.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "weft/base/clock.h"
#include "weft/base/dense.h"
#include "weft/base/error.h"
#include "weft/estimate/component_strains.h"
#include "weft/estimate/content_hash.h"
#include "weft/estimate/replays.h"

namespace weft {
namespace {

/// Of the start, where that has no equilibrium.
constexpr std::array<double, 5> kFactors{1, 10, 0.1, 100, 0.01};
constexpr double kNoWeight = 1e-9;         // of a control value in a band
constexpr double kDampingOfSmooth = 1e-6;  // at most, to begin with
constexpr double kBeyond = 1.1;            // of a curve's last knot: strains beyond it count

using Trials = std::vector<std::shared_ptr<const MechanicalTrial>>;
using Tests = std::vector<IsolatedStrain>;

std::vector<std::string> names_of(const Trials& trials) {
  std::vector<std::string> names;
  for (const auto& trial : trials) names.push_back(trial->capture.name);
  return names;
}

/// A step of the incremental order and the tests that its rows are found from.
enum class Step { weft_stretch, warp_stretch, coupling, shear, weft_bend, warp_bend, diagonal };
struct StepInfo {
  Step step;
  std::string_view name;
  std::vector<std::string_view> prefixes;  ///< of its rows
  Tests tests;
};
const std::vector<StepInfo>& steps() {
  using enum IsolatedStrain;
  static const std::vector<StepInfo> list{
      {Step::weft_stretch, "weft_stretch", {"weft_stretch", "membrane_uu"}, {weft_stretch}},
      {Step::warp_stretch, "warp_stretch", {"warp_stretch", "membrane_vv"}, {warp_stretch}},
      {Step::coupling,
       "coupling",
       {"stretch_coupling", "membrane_uv"},
       {weft_stretch, warp_stretch}},
      {Step::shear, "shear", {"shear", "membrane_shear"}, {shear}},
      {Step::weft_bend, "weft_bend", {"weft_bend", "bend_uu"}, {weft_bend}},
      {Step::warp_bend, "warp_bend", {"warp_bend", "bend_vv"}, {warp_bend}},
      {Step::diagonal,
       "diagonal_bend",
       {"diagonal_bend", "bend_twist", "bend_uv"},
       {weft_bend, warp_bend, diagonal_bend}}};
  return list;
}

const StepInfo* step_of(std::string_view row) {
  for (const StepInfo& step : steps())
    for (const std::string_view prefix : step.prefixes)
      if (row.starts_with(prefix)) return &step;
  return nullptr;
}

/// What an isotropic fabric has the same of: the row along the warp for one along the weft; empty
/// for others.
std::string partner_of(std::string_view row) {
  if (row.starts_with("weft_")) return "warp" + std::string(row.substr(4));
  if (row == "membrane_uu") return "membrane_vv";
  if (row == "bend_uu") return "bend_vv";
  return {};
}

const ParameterInfo& row_info(const Fabric& fabric, std::string_view row) {
  return model_parameters(
      fabric.model)[static_cast<std::size_t>(parameter_index(fabric.model, row))];
}
bool may_be_curve(const Fabric& fabric, std::string_view row) {
  return !row_info(fabric, row).curve_over.empty();
}

std::vector<std::string> value_names(const Fabric& fabric, std::string_view row) {
  std::vector<std::string> names;
  const int first = fabric.first_value(row);
  for (int i = 0; i < fabric.value_count(row); ++i) names.emplace_back(fabric.info(first + i).name);
  return names;
}

void check(const CurveFitOptions& options) {
  if (options.most_points < 1 || options.most_points > StiffnessCurve::kMostKnots)
    throw Error(fmt::format("control points of a curve: {}, must be in [1, {}]",
                            options.most_points, StiffnessCurve::kMostKnots));
  if (options.shape == CurveShape::smooth && options.most_points < 3)
    throw Error(fmt::format("control points of a smooth curve: {}, must be in [3, {}]",
                            options.most_points, StiffnessCurve::kMostKnots));
  if (!(options.least_reduction >= 0 && options.least_reduction < 1))
    throw Error(fmt::format("least reduction by a control point is {:g}, must be in [0, 1)",
                            options.least_reduction));
  if (options.passes < 1) throw Error(fmt::format("passes: {}, must be 1 or more", options.passes));
  if (!options.cost.ties.empty()) throw Error("ties of a curve fit follow from its symmetry");
}

/// What a cost is weighed by: those of different weights say nothing of each other.
struct Weights {
  ForceWeights forces;
  double priors = 0;  ///< 0: as a problem begins
  WeighedPriors::Roughness roughness;
};

class CurveFitter {
 public:
  CurveFitter(const Trials& trials, const Fabric& start, const std::vector<std::string>& rows,
              const CurveFitOptions& options, const CurveFitObserver& observer)
      : trials_(trials), fabric_(start), rows_(rows), options_(options), observer_(observer) {
    check(options);
    for (const auto& trial : trials) tests_.push_back(trial->isolated_strain);
    choose_rows();
    shape_start();
  }

  CurveFitResult run() {
    const auto begin = Clock::now();
    if (options_.order == FitOrder::incremental)
      incremental();
    else
      joint();
    const Fabric start = fabric_at_start_;
    CurveFitResult result = std::move(result_);
    const std::vector<MechanicalFitStep> history = std::move(result.fit.history);
    const std::size_t evaluations = result.fit.evaluations, replayed = result.fit.replayed;
    const Group all = everything();
    MechanicalShapes shapes;
    const auto assess = stopped_ ? assess_stopped : assess_mechanical;
    result.fit = assess(problem(all, fabric_), fabric_, options_.fit, &shapes);
    const MechanicalProblem at_start = problem(all, start, weights_of(result.fit));
    const Replays replays(at_start);
    shapes = at_start.as_starts(shapes, "start");
    result.fit.cost_start = at_start.cost(at_start.scaled(start), nullptr, &shapes);
    result.fit.start = start;
    result.fit.history = history;
    result.fit.evaluations += evaluations + 1;
    result.fit.replayed += replayed + replays.since();
    result.fit.end = stopped_ ? LeastSquaresEnd::stopped : LeastSquaresEnd::small_reduction;
    result.fit.wall_s = seconds_since(begin);
    result.free = names(all, fabric_);
    return result;
  }

 private:
  enum class Cells { all, half };  ///< of the trials that were given
  /// What is fitted together.
  struct Group {
    std::string name;
    std::vector<std::string> rows;
    Trials trials;
    Cells cells = Cells::all;
  };

  // The start.

  void choose_rows() {
    if (rows_.empty()) {
      for (const ParameterInfo& info : model_parameters(fabric_.model))
        if (fabric_.value_count(info.name) > 0) rows_.emplace_back(info.name);
    }
    for (const std::string& row : rows_) {
      if (fabric_.value_count(row) == 0)  // throws for a row that the model does not know
        throw Error(fmt::format("\"{}\" is left out of fabric \"{}\"", row, fabric_.name));
      if (options_.order == FitOrder::incremental && !step_of(row))
        throw Error(
            fmt::format("\"{}\" of model \"{}\" has no place in the incremental order; use a joint "
                        "fit",
                        row, fabric_.model));
    }
    if (options_.symmetry == ThreadSymmetry::isotropic) tie_rows();
    if (options_.order == FitOrder::incremental) drop_rows_without_test();
    if (rows_.empty()) throw Error("no parameters to search: no capture isolates one of them");
  }

  void tie_rows() {
    std::vector<std::string> followers;
    for (const std::string& row : rows_) {
      const std::string partner = partner_of(row);
      if (partner.empty() || fabric_.value_count(partner) == 0) continue;
      for (const ParameterPrior& prior : options_.cost.priors)
        if (prior.parameter == partner)
          throw Error(
              fmt::format("prior of \"{}\": it has the value of \"{}\" in an isotropic "
                          "fabric; state there what is known",
                          partner, row));
      tied_.push_back({partner, row});
      followers.push_back(partner);
    }
    std::erase_if(rows_, [&](const std::string& row) {
      return std::find(followers.begin(), followers.end(), row) != followers.end();
    });
    for (const std::string& row : rows_)
      if (row.starts_with("warp_") || row.ends_with("_vv"))
        throw Error(
            fmt::format("\"{}\" follows the weft in an isotropic fabric, which is not "
                        "searched",
                        row));
  }

  void drop_rows_without_test() {
    std::erase_if(rows_, [&](const std::string& row) {
      if (!trials_for(row).empty()) return false;
      result_.without_test.push_back(row);
      return true;
    });
  }

  void shape_start() {
    for (const std::string& row : rows_) {
      const bool flatten = options_.shape != CurveShape::as_given && may_be_curve(fabric_, row) &&
                           fabric_.value_count(row) > 1;
      if (!flatten) continue;
      const StiffnessCurve curve = fabric_.curve(row);
      const double middle = 0.5 * (curve.knots()[0] + curve.knots()[curve.size() - 1]);
      fabric_.set_curve(row, StiffnessCurve(curve.stiffness(middle)));
    }
    for (const ParameterTie& tie : tied_) copy_to_follower(tie, fabric_);
    fabric_at_start_ = fabric_;
  }

  static void copy_to_follower(const ParameterTie& tie, Fabric& fabric) {
    if (may_be_curve(fabric, tie.leader))
      fabric.set_curve(tie.follower, fabric.curve(tie.leader));
    else
      fabric.set(tie.follower, fabric.value(tie.leader));
  }

  /// Of a row and of those that follow it.
  void set_curve(const std::string& row, const StiffnessCurve& curve, Fabric& fabric) const {
    fabric.set_curve(row, curve);
    for (const ParameterTie& tie : tied_)
      if (tie.leader == row) copy_to_follower(tie, fabric);
  }

  // Groups.

  static constexpr std::string_view kAll = "all", kInPlane = "in_plane";

  Trials trials_for(const std::string& row) const {
    const StepInfo* step = step_of(row);
    Trials found;
    if (!step) return found;
    Tests wanted = step->tests;
    for (const ParameterTie& tie : tied_) {
      if (tie.leader != row) continue;
      const Tests& more = step_of(tie.follower)->tests;
      wanted.insert(wanted.end(), more.begin(), more.end());
    }
    for (std::size_t i = 0; i < trials_.size(); ++i)
      if (std::find(wanted.begin(), wanted.end(), tests_[i]) != wanted.end())
        found.push_back(trials_[i]);
    return found;
  }

  Group everything() const { return {std::string(kAll), rows_, trials_, Cells::all}; }
  /// Stretch and shear from the tests of both.
  static Group in_plane(const std::vector<Group>& groups) {
    Group all{std::string(kInPlane), {}, {}, Cells::all};
    for (const Group& group : groups) {
      if (bends(group)) continue;
      for (const std::string& row : group.rows)
        if (std::ranges::find(all.rows, row) == all.rows.end()) all.rows.push_back(row);
      for (const auto& trial : group.trials)
        if (std::ranges::find(all.trials, trial) == all.trials.end()) all.trials.push_back(trial);
    }
    return all;
  }
  static bool is_shear(const Group& group) { return group.name == "shear"; }
  /// Rows of the models that have no incremental order belong to no step.
  static bool is_diagonal(const Group& group) {
    const StepInfo* step = step_of(group.rows.front());
    return step && step->step == Step::diagonal;
  }
  /// Whether its curves are found smooth.
  bool is_smooth(const Group& group) const {
    return options_.shape == CurveShape::smooth &&
           (options_.order == FitOrder::joint || !bends(group));
  }
  static bool bends(const Group& group) {
    const StepInfo* step = step_of(group.rows.front());
    return step && step->step >= Step::weft_bend;
  }
  /// Those along the clips are of the shear alone.
  MechanicalForces forces_of(const Group& group) const {
    const bool all = !is_shear(group) || !longer_.empty() || options_.shape == CurveShape::smooth;
    return all ? MechanicalForces::all : MechanicalForces::along_clips;
  }

  /// Of a pass: smooth curves in the plane are found together once each is near its own.
  std::vector<Group> groups_of(int pass) const {
    std::vector<Group> result = groups();
    if (pass == 1 || options_.shape != CurveShape::smooth) return result;
    const Group together = in_plane(result);
    std::erase_if(result, [](const Group& group) { return !bends(group); });
    if (!together.rows.empty()) result.insert(result.begin(), together);
    return result;
  }

  std::vector<Group> groups() const {
    std::vector<Group> result;
    for (const StepInfo& step : steps()) {
      Group group{std::string(step.name), {}, {}, Cells::all};
      for (const std::string& row : rows_)
        if (step_of(row)->step == step.step) group.rows.push_back(row);
      if (group.rows.empty()) continue;
      group.trials = trials_for(group.rows.front());
      if (step.step == Step::coupling)  // found with what it is coupled to
        for (const std::string& row : rows_)
          if (step_of(row)->step == Step::weft_stretch || step_of(row)->step == Step::warp_stretch)
            group.rows.push_back(row);
      result.push_back(std::move(group));
    }
    return result;
  }

  bool is_longer(const std::string& row) const {
    return std::find(longer_.begin(), longer_.end(), row) != longer_.end();
  }

  /// The values of a row that a group searches.
  std::vector<std::string> names(const Group& group, const std::string& row,
                                 const Fabric& fabric) const {
    std::vector<std::string> all = value_names(fabric, row);
    if (group.name == kAll || group.name == kInPlane || !is_longer(row)) return all;
    if (is_shear(group)) return {all.back()};
    all.pop_back();
    return all;
  }

  /// Rows of which a group searches some values.
  std::vector<std::string> searched_rows(const Group& group) const {
    std::vector<std::string> rows = group.rows;
    if (is_shear(group)) rows.insert(rows.end(), longer_.begin(), longer_.end());
    return rows;
  }

  std::vector<std::string> names(const Group& group, const Fabric& fabric) const {
    std::vector<std::string> result;
    for (const std::string& row : searched_rows(group))
      for (std::string& name : names(group, row, fabric)) result.push_back(std::move(name));
    return result;
  }

  static Weights weights_of(const MechanicalFitResult& fit) {
    return {fit.weights, fit.prior_weight, fit.roughness};
  }
  /// What a fit minimized, at its end; of smooth curves without what that adds, which depends on
  /// where their knots are.
  double minimized(const MechanicalFitResult& fit) const {
    return options_.shape == CurveShape::smooth ? fit.cost : fit.cost + fit.prior_error;
  }

  MechanicalProblem problem(const Group& group, const Fabric& fabric,
                            const Weights& weights = {}) const {
    MechanicalCostOptions cost = options_.cost;
    cost.forces = forces_of(group);
    const std::vector<std::string> searched = searched_rows(group);
    if (is_smooth(group)) cost.smooth = searched;
    for (const ParameterTie& tie : tied_) {
      if (std::find(searched.begin(), searched.end(), tie.leader) == searched.end()) continue;
      const auto all = value_names(fabric, tie.leader), leaders = names(group, tie.leader, fabric),
                 followers = value_names(fabric, tie.follower);
      for (const std::string& leader : leaders) {
        const auto place = std::find(all.begin(), all.end(), leader) - all.begin();
        cost.ties.push_back({followers[static_cast<std::size_t>(place)], leader});
      }
    }
    MechanicalProblem result(group.trials, fabric, names(group, fabric), cost, options_.threads);
    result.weigh_by(weights.forces);
    if (weights.priors > 0) result.weigh_priors(weights.priors);
    result.roughen_by(roughness_);
    result.roughen_by(weights.roughness);
    result.keep_in(options_.store);
    return result;
  }

  // Fits.

  /// Equilibria of a group's tests, and of the same on cells of half the width.
  struct Shapes {
    explicit Shapes(const Group& group) : here(group.name), finer(group.name + "-finer") {}
    MechanicalShapes here, finer;
  };

  MechanicalFitResult fit(const Group& group, const Fabric& from, const std::string& name,
                          const Weights& weights, MechanicalShapes& near) {
    const MechanicalProblem p = problem(group, from, weights);
    const MechanicalFitObserver observer = [&](const MechanicalFitStep& step) {
      if (observer_ && !observer_(name, step)) stopped_ = true;
      return !stopped_;
    };
    const VecX scaled = p.scaled(from);
    MechanicalFitOptions options = options_.fit;
    options.mesh_error = MeshError::left_out;  // on the way
    // What bends a smooth curve is little beside what makes it stiffer; it is found from near.
    if (p.priors().has_smooth_curves())
      options.least_squares.initial_damping =
          std::min(options.least_squares.initial_damping, kDampingOfSmooth);
    for (std::size_t k = 0;; ++k) {
      const double factor = kFactors[k];
      VecX x = scaled;
      for (int i = 0; i < p.dimension(); ++i)
        if (p.info(i).scale == Scale::logarithmic)
          x[i] = std::clamp(to_scaled(p.info(i), factor * from_scaled(p.info(i), scaled[i])), 0.0,
                            1.0);
      try {
        return fit_mechanical(p, p.fabric(x), options, observer, &near);
      } catch (const MechanicalStartError&) {
        if (k + 1 == kFactors.size()) throw;
      }
    }
  }

  /// The fit that a group is at, and its place among the stages.
  struct Kept {
    MechanicalFitResult fit;
    std::size_t stage;
  };
  Kept at_last_stage(MechanicalFitResult fit) const {
    return {std::move(fit), result_.stages.size() - 1};
  }

  /// A fit from `from`, noted as a stage. `weights` to begin with; none: those of `from`. `near`:
  /// equilibria to begin with, then those of the end.
  MechanicalFitResult stage(const Group& group, const Fabric& from, int pass, int points,
                            MechanicalShapes& near, const Weights& weights = {}) {
    const std::string name =
        (points > 1 ? fmt::format("{}, {} points", group.name, points) : group.name) +
        (group.cells == Cells::half ? ", half the cells" : "");
    MechanicalFitResult found = fit(group, from, name, weights, near);
    result_.stages.push_back({.name = name,
                              .pass = pass,
                              .captures = names_of(group.trials),
                              .points = points,
                              .kept = true,
                              .cost_start = found.cost_start,
                              .cost = found.cost,
                              .evaluations = found.evaluations,
                              .wall_s = found.wall_s});
    for (MechanicalFitStep step : found.history) {
      step.evaluation += result_.fit.evaluations;
      result_.fit.history.push_back(step);
    }
    result_.fit.evaluations += found.evaluations;
    result_.fit.replayed += found.replayed;
    for (const auto& [row, roughness] : found.roughness) roughness_[row] = roughness;
    return found;
  }

  /// The group on half as many cells; with too few for that, on all.
  static Group on_fewer_cells(Group group) {
    Trials half = on_half_the_cells(group.trials);
    if (half.empty()) return group;
    group.trials = std::move(half);
    group.cells = Cells::half;
    return group;
  }

  /// From the start to near the estimate. What that finds is a start, no more: where it finds
  /// nothing, or an end of a range, the group begins where it would have.
  void begin(const Group& group) {
    MechanicalShapes shapes(group.name + "-start");
    try {
      const MechanicalFitResult found = stage(group, fabric_, 1, most_points_of(group), shapes);
      result_.stages.back().kept = !left_at_start(group, found);
      if (!result_.stages.back().kept) return;
      fabric_ = found.fabric;
      weights_.insert_or_assign(group.name, weights_of(found));
    } catch (const MechanicalStartError&) {
    }
  }

  /// Of its last fit; of what lies in the plane, of those of its parts, none where one has none.
  Weights weights_before(const Group& group) const {
    if (const auto known = weights_.find(group.name); known != weights_.end()) return known->second;
    if (group.name != kInPlane) return {};
    std::map<const MechanicalTrial*, std::vector<PoseErrors>> of_trials;
    for (const Group& part : groups()) {
      const auto known = weights_.find(part.name);
      if (known == weights_.end() || known->second.forces.empty()) continue;
      for (std::size_t t = 0; t < part.trials.size(); ++t)
        of_trials[part.trials[t].get()] = known->second.forces[t];
    }
    Weights weights;
    for (const auto& trial : group.trials) {
      const auto known = of_trials.find(trial.get());
      if (known == of_trials.end()) return {};
      weights.forces.push_back(known->second);
    }
    return weights;
  }

  void fit_group(const Group& group, int pass) {
    const int points = most_points_of(group);
    const Fabric before = fabric_;
    if (pass == 1 && options_.fit.first_cells == FirstCells::halved && !begun_.contains(group.name))
      if (const Group fewer = on_fewer_cells(group); fewer.cells == Cells::half) begin(fewer);
    if (stopped_) return;
    Shapes shapes(group);
    MechanicalFitResult found =
        stage(group, fabric_, pass, points, shapes.here, weights_before(group));
    if (options_.order == FitOrder::incremental && points == 1 && left_at_start(group, found)) {
      result_.stages.back().kept = false;
      fabric_ = before;
      return;
    }
    fabric_ = found.fabric;
    weights_[group.name] = weights_of(found);
    if (pass > 1 || !finds_curves(options_.shape) || stopped_) return;
    Kept kept = at_last_stage(std::move(found));
    if (is_shear(group)) kept = fit_longer_stretch(group, std::move(kept), shapes);
    kept = subdivide(group, std::move(kept), shapes);
    weights_[group.name] = weights_of(kept.fit);
    first_pass_.emplace(group.name, std::move(kept.fit));
  }

  /// The shear with longer curves of stretch where it needs them and where they leave the tests of
  /// stretch as they were found. `shorter`: the shear without them.
  Kept fit_longer_stretch(const Group& shear, Kept shorter, Shapes& shapes) {
    lengthen_stretch(shear, shapes.here);
    while (!longer_.empty() && !stopped_) {
      Kept longer = at_last_stage(stage(shear, fabric_, 1, most_points_of(shear), shapes.here));
      fabric_ = longer.fit.fabric;
      if (!shorten_where_stretch_loses(shorter.fit.fabric)) return longer;
      result_.stages[longer.stage].kept = false;
    }
    fabric_ = shorter.fit.fabric;
    return shorter;
  }

  /// Gives curves of stretch that their tests lose by back what they are in `shorter`. False where
  /// there is none.
  bool shorten_where_stretch_loses(const Fabric& shorter) {
    std::vector<std::string> losing;
    for (const std::string& row : std::vector<std::string>(longer_))
      if (stretch_loses(row, shorter)) losing.push_back(row);
    for (const std::string& row : losing) {
      set_curve(row, shorter.curve(row), fabric_);
      std::erase(longer_, row);
    }
    return !losing.empty();
  }

  /// A control point beyond the tests of stretch bends the curve inside them, too. Where a model
  /// cannot make the forces of the shear, it is found where it makes up for that, and stretch gets
  /// worse by so much that a control point less pays, even if its other values are found again, and
  /// those of the curve without it with the shear of `shorter`: stretch may have been found with
  /// quite another one.
  bool stretch_loses(const std::string& row, const Fabric& shorter) {
    for (const Group& group : groups()) {
      const auto first = first_pass_.find(group.name);
      const bool searched = std::ranges::find(group.rows, row) != group.rows.end();
      if (!searched || first == first_pass_.end()) continue;
      const MechanicalFitResult& before = first->second;
      const auto less_pays = [&](double cost, double less) {
        return pays(group, cost, less, before);
      };
      if (!less_pays(cost_of(group, fabric_, before), minimized(before))) continue;
      Shapes shapes(group);
      const MechanicalFitResult again =
          stage(group, fabric_, 1, most_points_of(group), shapes.here, weights_of(before));
      const std::size_t place = result_.stages.size() - 1;
      const bool loses = less_pays(again.cost_first, minimized(before)) &&
                         less_pays(again.cost_first, cost_without_longer(group, shorter, before));
      result_.stages[place].kept = !loses;
      if (loses) return true;
      fabric_ = again.fabric;
    }
    return false;
  }

  /// Of a stretch found again with the shear of `shorter`, with the weights of `before`.
  double cost_without_longer(const Group& stretch, const Fabric& shorter,
                             const MechanicalFitResult& before) {
    const std::vector<std::string> longer = std::exchange(longer_, {});
    Shapes shapes(stretch);
    const double cost = stage(stretch, shorter, 1, most_points_of(stretch, shorter), shapes.here,
                              weights_of(before))
                            .cost_first;
    result_.stages.back().kept = false;
    longer_ = longer;
    return cost;
  }

  /// Threads that are sheared between stiff bars may be stretched beyond what the tests of stretch
  /// show, where a curve is constant and shear would make up for it: one more control point there,
  /// which is found with the shear, from all forces.
  void lengthen_stretch(const Group& shear, const MechanicalShapes& shapes) {
    for (const std::string& row : rows_) {
      const Step step = step_of(row)->step;
      if (step != Step::weft_stretch && step != Step::warp_stretch) continue;
      if (!may_be_curve(fabric_, row)) continue;
      const StiffnessCurve curve = fabric_.curve(row);
      const Eigen::Index n = curve.size();
      if (n < 2 || n >= StiffnessCurve::kMostKnots) continue;
      const double end = curve.knots()[n - 1];
      const double reached = range_in(shear, row, shapes, Isolating::no).upper;
      if (!(reached > kBeyond * end)) continue;
      VecX knots(n + 1), values(n + 1);
      knots << curve.knots(), reached;
      const double slope = (curve.values()[n - 1] - curve.values()[n - 2]) /
                           (curve.knots()[n - 1] - curve.knots()[n - 2]);
      values << curve.values(), curve.values()[n - 1] + std::max(0.0, slope) * (reached - end);
      set_curve(row, StiffnessCurve(knots, values), fabric_);
      longer_.push_back(row);
    }
  }

  /// What runs off to an end of its range follows something else, such as the error of the mesh;
  /// and so does a diagonal bend that its tests do not determine.
  static bool left_at_start(const Group& group, const MechanicalFitResult& found) {
    return ends_at_a_bound(found) || (is_diagonal(group) && !is_determined(found));
  }

  static bool ends_at_a_bound(const MechanicalFitResult& found) {
    return std::any_of(found.intervals.begin(), found.intervals.end(),
                       [](const ParameterInterval& p) { return p.at_lower || p.at_upper; });
  }

  /// By the tests, or by a prior.
  static bool is_determined(const MechanicalFitResult& found) {
    return std::all_of(found.intervals.begin(), found.intervals.end(),
                       [](const ParameterInterval& p) { return p.bounded(); });
  }

  /// Begins rows of the diagonal bend in the proportion to the other bends that they have in the
  /// start: these may have been found far from theirs, and tests may tell nothing of the diagonal.
  void follow_other_bends(const std::vector<std::string>& diagonal) {
    double way = 0, count = 0;
    for (const std::string& row : rows_) {
      const Step step = step_of(row)->step;
      if (step != Step::weft_bend && step != Step::warp_bend) continue;
      way += mean_logarithm(fabric_, row) - mean_logarithm(fabric_at_start_, row);
      ++count;
    }
    if (count == 0) return;
    for (const std::string& row : diagonal)
      for (const std::string& name : value_names(fabric_, row)) {
        const ParameterInfo info = fabric_.info(fabric_.value_index(name));
        fabric_.set(name, std::clamp(fabric_at_start_.value(name) * std::exp(way / count),
                                     info.lower, info.upper));
      }
  }

  /// Of the values of a row.
  static double mean_logarithm(const Fabric& fabric, const std::string& row) {
    return fabric.values.segment(fabric.first_value(row), fabric.value_count(row))
        .array()
        .log()
        .mean();
  }

  /// One more control point each, of smooth curves all at once, as long as it pays: with the
  /// weights of the fit without it, for costs of different weights say nothing of each other.
  /// Returns the last that did.
  Kept subdivide(const Group& group, Kept kept, Shapes& shapes) {
    const int first = is_smooth(group) ? options_.most_points : 2;
    for (int points = first; points <= options_.most_points && !stopped_; ++points) {
      Fabric finer = fabric_;
      if (!place_points(group, points, shapes.here, finer)) break;
      Kept found = at_last_stage(stage(group, finer, 1, points, shapes.here, weights_of(kept.fit)));
      result_.stages[found.stage].kept =
          pays(group, minimized(kept.fit), found.fit.cost_first, found.fit) &&
          pays_on_finer_cells(group, kept, found, shapes);
      if (!result_.stages[found.stage].kept) break;
      fabric_ = found.fit.fabric;
      kept = std::move(found);
    }
    return kept;
  }

  /// With the weights of `fit`, as minimized() is of one.
  double cost_of(const Group& group, const Fabric& fabric, const MechanicalFitResult& fit) {
    const MechanicalProblem p = problem(group, fabric, weights_of(fit));
    const Replays replays(p);
    const VecX scaled = p.scaled(fabric);
    const double cost =
        p.cost(scaled) + (options_.shape == CurveShape::smooth ? 0 : p.priors().cost(scaled));
    ++result_.fit.evaluations;
    result_.fit.replayed += replays.since();
    return cost;
  }

  int most_points_of(const Group& group) const { return most_points_of(group, fabric_); }
  static int most_points_of(const Group& group, const Fabric& fabric) {
    int points = 1;
    for (const std::string& row : group.rows)
      if (may_be_curve(fabric, row)) points = std::max(points, fabric.value_count(row));
    return points;
  }

  /// By Schwarz's criterion, too (G. Schwarz, Annals of Statistics 6, 1978): of n numbers each
  /// parameter more has to lower the sum of squares, in units of the noise, by ln n.
  bool pays(const Group& group, double before, double after, const MechanicalFitResult& fit) const {
    const auto curves = std::count_if(group.rows.begin(), group.rows.end(),
                                      [&](const auto& row) { return may_be_curve(fabric_, row); });
    // A single number, as an overhang is, cannot ask for a second control point.
    const double schwarz = static_cast<double>(curves) *
                           std::log(std::max(fit.residual_count, 2.0)) / fit.residual_count;
    return before - after >= std::max(options_.least_reduction * fit.force_share * before, schwarz);
  }

  /// Of `found` against `kept`. Where it cannot be told the cells of the fit decide.
  bool pays_on_finer_cells(const Group& group, const Kept& kept, const Kept& found,
                           Shapes& shapes) {
    if (options_.fit.mesh_error == MeshError::left_out || stopped_) return true;
    const Weights weights = weights_of(kept.fit);
    double& before = result_.stages[kept.stage].finer_cost;
    double& after = result_.stages[found.stage].finer_cost;
    if (std::isnan(before) || !weights.forces.empty() || weights.priors > 0)
      before = cost_on_finer_cells(group, kept.fit.fabric, weights, shapes);
    if (std::isnan(before)) return true;
    after = cost_on_finer_cells(group, found.fit.fabric, weights, shapes);
    return std::isnan(after) || pays(group, before, after, found.fit);
  }

  /// The least that the rows of `group` reach there, to second order about `estimate`.
  double cost_on_finer_cells(const Group& group, const Fabric& estimate, const Weights& weights,
                             Shapes& shapes) {
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    const MechanicalProblem here = problem(group, estimate, weights);
    const VecX scaled = here.scaled(estimate);
    const Replays replays(here);
    if (shapes.finer.empty()) shapes.finer = here.as_starts(shapes.here, group.name + "-finer");
    const auto finer = linearize_refined(here, scaled, nullptr, &shapes.finer);
    if (!finer) return unknown;  // more cells than may be
    ++result_.fit.evaluations;
    result_.fit.replayed += replays.since();
    if (!std::isfinite(finer->model.cost)) return unknown;
    return least_cost(scaled, with_priors(here, scaled, finer->model), residual_noise(here));
  }

  /// Equidistant over the strains that occur. False where no row of the group takes any.
  bool place_points(const Group& group, int points, const MechanicalShapes& shapes,
                    Fabric& fabric) const {
    bool placed = false;
    for (const std::string& row : group.rows) {
      if (!may_be_curve(fabric, row)) continue;
      const StrainRange range = occurring(group, row, shapes);
      if (!(range.upper > range.lower)) continue;
      const VecX knots = VecX::LinSpaced(points, range.lower, range.upper);
      set_curve(row, fabric.curve(row).resampled(knots), fabric);
      placed = true;
    }
    return placed;
  }

  StrainRange occurring(const Group& group, const std::string& row,
                        const MechanicalShapes& shapes) const {
    if (!options_.store) return range_in(group, row, shapes, Isolating::yes);
    ContentHash hash;
    for (const auto& trial : group.trials) add_trial(hash, *trial);
    add_fabric(hash, fabric_);
    hash.add(std::string_view(row));
    hash.add(options_.symmetry);
    const std::string key = "strains-" + hash.hex();
    if (const auto known = options_.store->find(key)) return {(*known)[0], (*known)[1]};
    const StrainRange range = range_in(group, row, shapes, Isolating::yes);
    options_.store->add(key, Vec2(range.lower, range.upper));
    return range;
  }

  /// In the tests of the group, or in those that isolate the row, where there are some.
  enum class Isolating { no, yes };
  StrainRange range_in(const Group& group, const std::string& row, const MechanicalShapes& shapes,
                       Isolating which) const {
    auto frames = problem(group, fabric_).frames(shapes);
    if (!frames)
      frames = std::make_shared<MechanicalFrames>(simulate_mechanical(
          group.trials, fabric_, MechanicalDerivatives::none, options_.threads));
    const Trials isolating = which == Isolating::yes ? trials_for(row) : Trials();
    ComponentSample sample;
    for (std::size_t i = 0; i < group.trials.size(); ++i) {
      const MechanicalTrial& trial = *group.trials[i];
      if (!isolating.empty() && std::ranges::find(isolating, group.trials[i]) == isolating.end())
        continue;
      append(component_strains(trial, (*frames)[i], fabric_, row), sample);
      for (const ParameterTie& tie : tied_)
        if (tie.leader == row)
          append(component_strains(trial, (*frames)[i], fabric_, tie.follower), sample);
    }
    return strain_range(sample);
  }

  /// What hangs by its weight hardly feels how stiff the cloth is in its plane, where cloth between
  /// clips folds by how it bends: bends that are wrong by a factor cost stretch and shear control
  /// points. So rough bends come first where other components are searched as well.
  void begin_with_bends() {
    const std::vector<Group> all = groups();
    if (std::ranges::all_of(all, bends)) return;
    for (const Group& group : all) {
      if (!bends(group) || stopped_) continue;
      if (is_diagonal(group)) {
        follow_other_bends(group.rows);
        continue;
      }
      begin(options_.fit.first_cells == FirstCells::halved ? on_fewer_cells(group) : group);
      begun_.insert(group.name);
    }
  }

  void incremental() {
    begin_with_bends();
    for (int pass = 1; pass <= options_.passes; ++pass)
      for (const Group& group : groups_of(pass)) {
        if (stopped_) continue;
        if (is_diagonal(group) && pass == 1) follow_other_bends(group.rows);
        fit_group(group, pass);
      }
  }
  void joint() { fit_group(everything(), 1); }

  const Trials& trials_;
  Tests tests_;  ///< one a trial
  Fabric fabric_, fabric_at_start_;
  std::vector<std::string> rows_;
  std::vector<ParameterTie> tied_;   ///< rows
  std::vector<std::string> longer_;  ///< rows whose last value is found with the shear
  const CurveFitOptions& options_;
  const CurveFitObserver& observer_;
  CurveFitResult result_;
  std::set<std::string, std::less<>> begun_;                            ///< groups, before a pass
  std::map<std::string, MechanicalFitResult, std::less<>> first_pass_;  ///< by group
  std::map<std::string, Weights, std::less<>> weights_;  ///< by group, of its last fit
  WeighedPriors::Roughness roughness_;                   ///< of the last fit of each curve
  bool stopped_ = false;
};

}  // namespace

FitOrder fit_order_from_name(std::string_view name) {
  if (name == "joint") return FitOrder::joint;
  if (name == "incremental") return FitOrder::incremental;
  throw Error(fmt::format("order \"{}\" is not known; known: joint, incremental", name));
}

std::string fit_fingerprint(const Trials& trials, const Fabric& start,
                            const std::vector<std::string>& rows, const CurveFitOptions& options) {
  ContentHash hash;
  hash.add(std::string_view(fit_fingerprint(
      MechanicalProblem(trials, start, start.value_names(), options.cost, options.threads), start,
      options.fit)));
  for (const std::string& row : rows) hash.add(std::string_view(row));
  hash.add(options.order);
  hash.add(options.shape);
  hash.add(options.symmetry);
  hash.add(options.most_points);
  hash.add(options.least_reduction);
  hash.add(options.passes);
  return hash.hex();
}

CurveFitResult fit_curves(const Trials& trials, const Fabric& start,
                          const std::vector<std::string>& rows, const CurveFitOptions& options,
                          const CurveFitObserver& observer) {
  return CurveFitter(trials, start, rows, options, observer).run();
}

CurveBand curve_band(const MechanicalFitResult& fit, std::string_view row, const VecX& strains) {
  const StiffnessCurve curve = fit.fabric.curve(row);
  const int first = fit.fabric.first_value(row), count = curve.size();
  std::vector<Eigen::Index> places;  // among the intervals
  for (int j = 0; j < count; ++j)
    for (std::size_t i = 0; i < fit.intervals.size(); ++i)
      if (fit.intervals[i].name == fit.fabric.info(first + j).name)
        places.push_back(static_cast<Eigen::Index>(i));
  const bool searched = static_cast<int>(places.size()) == count;
  CurveBand band{strains, VecX(strains.size()), {}, {}};
  band.lower = band.upper = VecX(strains.size());
  VecX slopes(count);
  for (Eigen::Index s = 0; s < strains.size(); ++s) {
    const double k = curve.stiffness(strains[s]);
    band.stiffness[s] = band.lower[s] = band.upper[s] = k;
    if (!searched) continue;
    curve.stiffness_by_values(strains[s], slopes);
    VecX way(count);  // of log k, by each control value's half width
    bool bounded = true;
    for (int j = 0; j < count; ++j) {
      const ParameterInfo info = fit.fabric.info(first + j);
      const ParameterInterval& interval =
          fit.intervals[static_cast<std::size_t>(places[static_cast<std::size_t>(j)])];
      const double weight = slopes[j] * curve.values()[j] / k;
      way[j] = std::abs(weight) > kNoWeight
                   ? weight * interval.half_width * std::log(info.upper / info.lower)
                   : 0;
      bounded = bounded && (interval.bounded() || way[j] == 0);
    }
    double square = 0;
    for (int i = 0; i < count; ++i)
      for (int j = 0; j < count; ++j) {
        const double c = i == j ? 1
                                : fit.certainty.correlation(places[static_cast<std::size_t>(i)],
                                                            places[static_cast<std::size_t>(j)]);
        // Where it is not known, as if both went wrong together.
        square += std::isnan(c) ? std::abs(way[i] * way[j]) : c * way[i] * way[j];
      }
    const double half = bounded ? std::sqrt(std::max(0.0, square)) : kInfinity;
    band.lower[s] = k * std::exp(-half);
    band.upper[s] = k * std::exp(half);
  }
  return band;
}

}  // namespace weft
