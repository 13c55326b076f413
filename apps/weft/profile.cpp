#include "weft/estimate/profile.h"

#include <fmt/core.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/report/plot.h"

namespace weft::app {
namespace {

struct Arguments {
  std::vector<std::string> captures;
  std::string fabric;
  std::string out = "profile";
  std::vector<std::string> parameters;
  bool overwrite = false;
  TrialArguments trial;
};

/// A rise of the cost that the noise of the clusters does not make.
constexpr double kBetterBy = -0.5;

/// The interval of `found` in the parameter's own unit, with words for an end that was not found.
std::string interval_of(const ParameterInfo& info, const Profile& found) {
  const auto end = [&](double scaled, ProfileEnd why, const char* beyond) {
    std::string value = fmt::format("{:.4g}", from_scaled(info, scaled));
    switch (why) {
      case ProfileEnd::crossed:
        return value;
      case ProfileEnd::range:
        return value + " (the end of its range)";
      case ProfileEnd::most_points:
        return fmt::format("{} ({})", value, beyond);
      case ProfileEnd::infinite:
        return fmt::format("{} ({}: cannot be simulated)", value, beyond);
      case ProfileEnd::stopped:
        return fmt::format("{} ({}: stopped)", value, beyond);
    }
    return value;
  };
  return end(found.lower, found.lower_end, "or less") + " to " +
         end(found.upper, found.upper_end, "or more");
}

LinePlot plot_of(const ParameterInfo& info, const Profile& found, double threshold) {
  LinePlot plot;
  plot.title = fmt::format("Profile of {}", info.name);
  plot.x.label = info.name;
  plot.x.unit = info.unit;
  plot.x.logarithmic = info.scale == Scale::logarithmic;
  plot.y.label = "rise of the cost (minus log likelihood)";
  plot.y.from_zero = true;
  PlotSeries series;
  series.mark = PlotSeries::Mark::line_and_points;
  for (const ProfilePoint& point : found.points) {
    series.x.push_back(from_scaled(info, point.x[found.parameter]));
    series.y.push_back(point.rise);
  }
  plot.series.push_back(series);
  plot.levels.push_back({threshold, "90 %", 0});
  // Beyond the interval the rise may be any number of times the threshold.
  plot.y.upper = 4 * threshold;
  return plot;
}

/// A row a point: the parameter, the rise, and where all of them are.
void write_points(std::ofstream& csv, const Problem& problem, const Profile& found) {
  for (const ProfilePoint& point : found.points) {
    csv << fmt::format("{},{:.6g}", problem.info(found.parameter).name, point.rise);
    for (int i = 0; i < problem.dimension(); ++i)
      csv << fmt::format(",{:.9g}", from_scaled(problem.info(i), point.x[i]));
    csv << '\n';
  }
  csv.flush();
}

void run(const Arguments& arguments) {
  const InterruptGuard guard;
  const Fabric fabric = find_fabric(arguments.fabric);
  require_motion_model(fabric);
  check_parameters("--parameters", fabric.model, arguments.parameters);
  for (const std::string& name : arguments.parameters) fabric.value_index(name);  // throws
  const std::vector<Capture> captures = read_captures(arguments.captures);
  const std::filesystem::path out = arguments.out;
  prepare_output_folder(out, {"profile.csv"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  const Problem problem(arguments.trial.prepare(captures, TrialArguments::Frames::fit), fabric,
                        fabric.value_names());
  LinearizationOptions options;
  options.threads = arguments.trial.threads();
  const VecX estimate = problem.scaled(fabric);
  const std::vector<PatchPart> parts = linearize_patches(problem, estimate, options);
  if (frames_of(parts).size() < 2)
    throw Error("profile: at least two frames with this fabric are needed");
  const Uncertainty sure = estimate_uncertainty(problem, estimate, parts);
  // Each profile begins with the model at the estimate.
  const QuadraticModel here = linearize(problem, estimate, options).model;
  const LinearizeFunction model_at = [&](const VecX& x) {
    return x == estimate ? here : linearize(problem, x, options).model;
  };
  const CostFunction cost_at = [&](const VecX& x) {
    return evaluate_cost(problem, x, options).cost;
  };
  std::ofstream csv(out / "profile.csv");
  if (!csv) throw Error((out / "profile.csv").string() + ": cannot be written");
  csv << "profile_of,rise";
  for (int i = 0; i < problem.dimension(); ++i) csv << ',' << problem.info(i).name;
  csv << '\n';
  for (int i = 0; i < problem.dimension() && !interrupted(); ++i) {
    const ParameterInfo info = problem.info(i);
    const ParameterInterval& own = sure.parameters[static_cast<std::size_t>(i)];
    const bool named = std::find(arguments.parameters.begin(), arguments.parameters.end(),
                                 info.name) != arguments.parameters.end();
    if (arguments.parameters.empty() ? !own.determined : !named) continue;
    const ProfileOptions chosen = profile_options(sure, own.half_width);
    const Profile found = profile(
        model_at, cost_at, estimate, i, sure.dispersion, chosen, [&](const ProfilePoint& point) {
          fmt::print(stderr, "{} {:.4g} {}: rise {:.3g}, {:.3g} ends the interval\n", info.name,
                     from_scaled(info, point.x[i]), info.unit, point.rise, chosen.threshold);
          return !interrupted();
        });
    write_points(csv, problem, found);
    write_plot(out / fmt::format("{}.svg", info.name), plot_of(info, found, chosen.threshold));
    fmt::print("{:<20} {:>12.5g} {:<11} by derivatives {}; by its profile {}\n", info.name,
               own.value, info.unit,
               own.determined ? fmt::format("{:.4g} to {:.4g}", own.lower, own.upper) : "unbounded",
               interval_of(info, found));
    if (!std::ranges::all_of(found.points, &ProfilePoint::searched_out))
      fmt::print(
          "warning: beside {} the others were still on their way when a search ended: the rise may "
          "be less and the interval wider\n",
          info.name);
    const auto least = std::ranges::min_element(found.points, {}, &ProfilePoint::rise);
    if (least->rise < kBetterBy)
      fmt::print(
          "warning: with {} at {:.4g} {} the cost is lower than at the fabric: it is not "
          "the end of a search; fit again from there (profile.csv)\n",
          info.name, from_scaled(info, least->x[i]), info.unit);
  }
  if (!csv) throw Error((out / "profile.csv").string() + ": cannot be written");
  const std::string points = (out / "profile.csv").string();
  end_if_stopped(interrupted(), points + " has the points so far");
  fmt::print("{}\n", points);
}

}  // namespace

void add_profile(CLI::App& app) {
  auto* command = app.add_subcommand(
      "profile",
      "intervals by how the cost rises when a parameter is held and all others follow: wider or "
      "narrower than those of a fit on a side where the cost is no parabola");
  auto arguments = std::make_shared<Arguments>();
  command->add_option("captures", arguments->captures, "capture folders")->required();
  command->add_option("--fabric", arguments->fabric, "fabric.toml of a fit to them")->required();
  command->add_option("--parameters", arguments->parameters,
                      "default: those that the data determine");
  command->add_option("--out", arguments->out, "folder for the points and the plots")
      ->capture_default_str();
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  command->footer(
      "Example:\n  weft profile data/captures/cotton_waving_A --fabric out/fabric.toml "
      "--parameters shear_stiffness --out out/profile");
  command->callback([arguments] { run(*arguments); });
}

}  // namespace weft::app
