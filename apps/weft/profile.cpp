#include "weft/estimate/profile.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <string>

#include "commands.h"
#include "options.h"
#include "profiled.h"
#include "report_of_fit.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/report/plot.h"

namespace weft::app {
namespace {

struct ProfileArguments {
  std::vector<std::string> captures;
  std::string fabric;
  std::string out = "profile";
  std::vector<std::string> parameters;
  bool overwrite = false;
  TrialArguments trial;
  MechanicalArguments mechanical;
  MechanicalFitArguments tests;  ///< what of mechanical captures is compared
  ScanArguments scan;
  ScanFitArguments scans;  ///< how their residuals are balanced
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
void write_points(std::ofstream& csv, const Profiled& of, const Profile& found) {
  for (const ProfilePoint& point : found.points) {
    csv << fmt::format("{},{:.6g}", of.infos[at(found.parameter)].name, point.rise);
    for (std::size_t i = 0; i < of.infos.size(); ++i)
      csv << fmt::format(",{:.9g}",
                         from_scaled(of.infos[i], point.x[static_cast<Eigen::Index>(i)]));
    csv << '\n';
  }
  csv.flush();
}

void print_warnings(const ParameterInfo& info, const Profile& found) {
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
        info.name, from_scaled(info, least->x[found.parameter]), info.unit);
}

/// Of parameter i, with its picture and what is printed of it.
void profile_one(const Profiled& of, int i, const std::filesystem::path& out, std::ofstream& csv) {
  const ParameterInfo& info = of.infos[at(i)];
  const ParameterInterval& own = of.intervals[at(i)];
  // One that is held at a bound has no width.
  const double half = own.determined ? own.half_width : widest_half_interval;
  const ProfileOptions chosen = profile_options(of.quantile, half, of.least_step);
  const Profile found = profile(
      of.linearize, of.cost, of.estimate, i, of.dispersion, chosen, [&](const ProfilePoint& point) {
        fmt::print(stderr, "{} {:.4g} {}: rise {:.3g}, {:.3g} ends the interval\n", info.name,
                   from_scaled(info, point.x[i]), info.unit, point.rise, chosen.threshold);
        return !interrupted();
      });
  write_points(csv, of, found);
  write_plot(out / fmt::format("{}.svg", info.name), plot_of(info, found, chosen.threshold));
  fmt::print("{:<20} {:>12.5g} {:<11} by derivatives {}; by its profile {}\n", info.name, own.value,
             info.unit, ends_in_words(own), interval_of(info, found));
  print_warnings(info, found);
}

/// Of all the captures, which must be of one kind. Throws Error where they are not.
CaptureKind kind_of(const std::vector<std::string>& captures) {
  refuse_twice(captures);
  const CaptureKind kind = capture_kind(captures.front());
  for (const std::string& folder : captures)
    if (capture_kind(folder) != kind)
      throw Error(
          "captures: those of a profile must be of one kind: videos, mechanical captures, "
          "or scans");
  return kind;
}

/// Throws Error for options that mean nothing for captures of this kind.
void check_options(const CLI::App& command, CaptureKind kind) {
  if (kind != CaptureKind::scan) {
    refuse_options(command, ScanArguments::names(), "anything but scans");
    refuse_options(command, {"--balance"}, "anything but scans");
  }
  if (kind != CaptureKind::mechanical)
    refuse_options(command, cost_option_names(), "anything but mechanical captures");
  if (kind == CaptureKind::video)
    refuse_options(command, MechanicalArguments::names(), "videos");
  else
    refuse_options(command, video_option_names(),
                   kind == CaptureKind::scan ? "scans" : "mechanical captures");
}

/// What the captures may show of the fabric.
std::vector<std::string> names_of(CaptureKind kind, const Fabric& fabric) {
  if (kind == CaptureKind::scan) return default_scan_parameters(fabric);
  if (kind == CaptureKind::mechanical) return names_at_rest(fabric);
  require_motion_model(fabric);
  return fabric.value_names();
}

void check_names(const ProfileArguments& arguments, CaptureKind kind, const Fabric& fabric) {
  if (kind == CaptureKind::video)
    check_parameters("--parameters", fabric.model, arguments.parameters);
  const std::vector<std::string> known = names_of(kind, fabric);
  for (const std::string& name : arguments.parameters)
    if (std::ranges::find(known, name) == known.end())
      throw Error(fmt::format("--parameters: \"{}\" is not searched; these are: {}", name,
                              fmt::join(known, ", ")));
}

Profiled profiled(const ProfileArguments& arguments, CaptureKind kind, const Fabric& fabric,
                  const CLI::App& command) {
  const int threads = arguments.trial.threads();
  if (kind == CaptureKind::mechanical) {
    MechanicalFitArguments tests = arguments.tests;
    tests.captures = arguments.captures;
    tests.options = arguments.mechanical.options();
    tests.threads = threads;
    return profiled_tests(tests, fabric);
  }
  if (kind == CaptureKind::scan) {
    ScanFitArguments scans = arguments.scans;
    scans.captures = arguments.captures;
    scans.options = arguments.scan.options(command, threads);
    scans.solver = arguments.scan.solver();
    scans.threads = threads;
    return profiled_scans(scans, fabric);
  }
  return profiled_videos(arguments.captures, fabric, arguments.trial);
}

void run_profile(const ProfileArguments& arguments, const CLI::App& command) {
  const InterruptGuard guard;
  const CaptureKind kind = kind_of(arguments.captures);
  check_options(command, kind);
  if (kind == CaptureKind::video) arguments.trial.need_derivatives("weft profile");
  const Fabric fabric = find_fabric(arguments.fabric);
  check_names(arguments, kind, fabric);
  const std::filesystem::path out = arguments.out;
  prepare_output_folder(out, {"profile.csv"},
                        arguments.overwrite ? Existing::overwrite : Existing::refuse);
  const Profiled of = profiled(arguments, kind, fabric, command);
  std::ofstream csv(out / "profile.csv");
  if (!csv) throw Error((out / "profile.csv").string() + ": cannot be written");
  csv << "profile_of,rise";
  for (const ParameterInfo& info : of.infos) csv << ',' << info.name;
  csv << '\n';
  for (std::size_t i = 0; i < of.infos.size() && !interrupted(); ++i) {
    const bool named =
        std::ranges::find(arguments.parameters, of.infos[i].name) != arguments.parameters.end();
    if (arguments.parameters.empty() ? of.intervals[i].determined : named)
      profile_one(of, static_cast<int>(i), out, csv);
  }
  if (!csv) throw Error((out / "profile.csv").string() + ": cannot be written");
  const std::string points = (out / "profile.csv").string();
  end_if_stopped(interrupted(), points + " has the points so far");
  fmt::print("{}\n", points);
}

}  // namespace

void add_profile(CLI::App& app) {
  auto* command = add_command(
      app, "profile",
      "intervals by how the cost rises when a parameter is held and all others follow: wider or "
      "narrower than those of a fit on a side where the cost is no parabola; of the data alone, "
      "without priors");
  auto arguments = std::make_shared<ProfileArguments>();
  command
      ->add_option("captures", arguments->captures,
                   "capture folders, all of one kind: videos, mechanical captures, or scans")
      ->required();
  command->add_option("--fabric", arguments->fabric, "fabric.toml of a fit to them")->required();
  command->add_option(
      "--parameters", arguments->parameters,
      "to profile, while all others follow (default: those that the data determine)");
  command->add_option("--out", arguments->out, "folder for the points and the plots")
      ->capture_default_str();
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  arguments->trial.add_to(*command);
  arguments->trial.add_starts_to(*command);
  arguments->mechanical.add_to(*command);
  add_cost_options(*command, arguments->tests);
  arguments->scan.add_to(*command);
  arguments->scans.add_balance_to(*command);
  command->footer(
      "Examples:\n  weft profile data/captures/cotton_waving_A --fabric out/fabric.toml "
      "--parameters shear_stiffness --out out/profile\n"
      "  weft profile stretch_weft shear --fabric out/denim/fabric.toml --out out/profile");
  command->callback([arguments, command] { run_profile(*arguments, *command); });
}

}  // namespace weft::app
