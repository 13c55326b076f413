#include "mechanical_beside.h"

#include <fmt/core.h>

#include "report_of_mechanical.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/progress.h"

namespace weft::app {

MechanicalBeside::MechanicalBeside(const MechanicalFitArguments& arguments, const Fabric& initial,
                                   const std::vector<std::string>& free)
    : threads_(arguments.threads) {
  for (const std::string& folder : arguments.captures) {
    captures_.push_back(read_mechanical_capture(folder));
    trials_.push_back(prepare_mechanical(captures_.back(), arguments.options));
  }
  MechanicalProblem problem(trials_, initial, free, cost_options(arguments), threads_);
  problem.keep_in(open_mechanical_store(arguments, fit_fingerprint(problem, initial)));
  problem_ = std::make_shared<MechanicalProblem>(std::move(problem));
  Progress progress("mechanical tests alone", 0);
  alone_ = fit_mechanical(*problem_, initial, {}, [&](const MechanicalFitStep& step) {
    progress.update(step.evaluation, fmt::format("error {:.4g}, best {:.4g}{}", step.cost,
                                                 step.best, step.replayed ? " (replayed)" : ""));
    return !interrupted();
  });
}

OtherData MechanicalBeside::data() const {
  return mechanical_data(problem_, problem_->scaled(alone_.fabric));
}

MechanicalBeside::Shown MechanicalBeside::show(const Fabric& estimate,
                                               const std::vector<ParameterInterval>& intervals,
                                               const MatX& correlation) const {
  auto frames = simulate_mechanical(trials_, estimate, MechanicalDerivatives::all, threads_);
  std::vector<CordFrictionEstimate> cord_friction;
  if (!problem_->with_friction().empty())
    cord_friction = assess_mechanical(*problem_, estimate).cord_friction;
  add_cord_friction(trials_, cord_friction, frames);
  std::vector<MechanicalEvaluation> evaluations;
  Shown shown;
  shown.json = nlohmann::json::array();
  for (std::size_t i = 0; i < trials_.size(); ++i) {
    evaluations.push_back(compare_mechanical(*trials_[i], frames[i]));
    nlohmann::json entry = mechanical_json(evaluations.back());
    entry["name"] = captures_[i].name;
    entry["folder"] = captures_[i].folder.string();
    entry["cord_friction"] = cord_friction_json(cord_friction, i);
    shown.json.push_back(entry);
    shown.lines.push_back(fmt::format("{}: {}\n{}", captures_[i].name, summary(evaluations[i]),
                                      complaints(evaluations[i])));
  }
  shown.lines.push_back(cord_friction_lines(cord_friction));
  shown.report = report_of_mechanical(trials_, frames, evaluations, estimate, intervals,
                                      correlation, cord_friction);
  for (std::size_t i = 0; i < trials_.size(); ++i)
    add_series(shown.report.captures[i], shown.json[i]);
  return shown;
}

}  // namespace weft::app
