#include "weft/estimate/suggest.h"

#include <fmt/core.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "commands.h"
#include "estimate_of_fit.h"
#include "options.h"
#include "weft/base/error.h"
#include "weft/base/interrupt.h"
#include "weft/base/text_file.h"
#include "weft/estimate/estimate_scatter.h"
#include "weft/estimate/synthetic.h"
#include "weft/fabric/prior.h"
#include "weft/report/plot.h"
#include "weft/report/result.h"

namespace weft::app {
namespace {

struct SuggestArguments {
  std::string known;
  std::string like;
  std::string candidates;
  std::string video_option;  ///< one that makes candidates; empty: none was given
  std::vector<std::string> parameters;
  std::vector<std::string> axes{"across"};
  CandidateFamily family;
  double areal_density = LayoutOptions().areal_density;
  double noise = 0;
  int grid = 25;
  int cells = MechanicalOptions().cells;
  int threads = 0;
  bool json = false;
  std::string out;
  bool overwrite = false;
};

struct Known {
  Fabric fabric;
  std::vector<ParameterPrior> priors;
  MatX information;  ///< empty: none
  double noise = 0;  ///< of a sample of several frames as SuggestOptions::noise; 0: not known
  int frames_per_sample = SuggestOptions().frames_per_sample;
};

/// Of a fit to cloth at rest: its intervals, each by itself. They hold what the noise does not, the
/// cells and what the model lacks, and priors.
MatX information_of_intervals(const Report& report, const Fabric& fabric) {
  constexpr double kConfidence = 0.9;  // of the intervals of result.json
  MatX information = MatX::Zero(fabric.values.size(), fabric.values.size());
  for (const ReportParameter& p : report.parameters) {
    if (!p.free || interval_ends(p) != IntervalEnds::both) continue;
    const int i = fabric.value_index(p.name);
    const ParameterInfo info = fabric.info(i);
    const double half =
        0.5 * (to_scaled(info, *p.interval_upper) - to_scaled(info, *p.interval_lower));
    if (!(half > 0) || !std::isfinite(half)) continue;  // not known
    const double deviation = half / normal_half_width(kConfidence);
    information(i, i) = 1 / (deviation * deviation);
  }
  return information;
}

/// A preset, a fabric.toml, or the folder of a fit.
Known read_known(const std::string& name) {
  Known known;
  const std::filesystem::path folder = name;
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored)) {
    known.fabric = find_fabric(name);
    known.priors = find_priors(name);
    return known;
  }
  known.fabric = read_fabric(folder / "fabric.toml");
  const std::filesystem::path file = folder / "result.json";
  const Report report = read_result(file);
  check_same_fabric(report, known.fabric, folder);
  if (report.captures.empty()) {
    known.information = information_of_intervals(report, known.fabric);
    return known;
  }
  if (!report.certainty)
    throw Error(
        fmt::format("{}: certainty: is missing; a fit that ended writes it", file.string()));
  const ReportCertainty& certainty = *report.certainty;
  const auto n = known.fabric.values.size();
  known.information = MatX::Zero(n, n);
  std::vector<Eigen::Index> at;
  for (const std::string& parameter : certainty.parameters)
    at.push_back(known.fabric.value_index(parameter));
  known.information(at, at) = certainty.information;
  // The information of a fit is the sum of its frames' matrices over the noise of a cluster, that
  // of a sample the mean.
  known.frames_per_sample = certainty.frames_per_cluster;
  if (std::isfinite(certainty.noise)) known.noise = certainty.noise / certainty.frames_per_cluster;
  for (const ReportParameter& p : report.parameters)
    if (p.prior_median && p.prior_factor)
      known.priors.push_back({p.name, *p.prior_median, *p.prior_factor});
  return known;
}

MatX known_information(const Known& known) {
  const auto n = known.fabric.values.size();
  MatX information = known.information.size() > 0 ? known.information : MatX(MatX::Zero(n, n));
  for (const ParameterPrior& prior : known.priors) {
    const int i = known.fabric.value_index(prior.parameter);
    const double deviation = scaled_prior(known.fabric.info(i), prior).deviation;
    information(i, i) += 1 / (deviation * deviation);
  }
  return information;
}

void check_options(const SuggestArguments& arguments, const Fabric& fabric) {
  check_parameters("--parameters", fabric, arguments.parameters);
  if (!arguments.video_option.empty())
    with_errors_at({.key = arguments.video_option}, [&] { require_motion_model(fabric); });
}

Capture rig_of(const SuggestArguments& arguments, const Fabric& fabric) {
  if (!arguments.like.empty()) return read_capture(arguments.like);
  LayoutOptions layout;
  layout.areal_density = fabric.areal_density.value_or(arguments.areal_density);
  return make_layout(layout);
}

using Json = nlohmann::ordered_json;

Json values_of(const CandidateExperiment& e) {
  return {{"separation", e.separation},
          {"axis", name_of(e.axis)},
          {"amplitude", e.amplitude},
          {"frequency", e.frequency},
          {"frames", e.frames}};
}

Json values_of(const CandidateTest& test) {
  Json specimen = {{"free_length", test.specimen.free_length}, {"width", test.specimen.width}};
  if (test.specimen.areal_density > 0) specimen["areal_density"] = test.specimen.areal_density;
  specimen["grain_angle_deg"] = test.specimen.grain_angle / kDegree;
  Json values = {{"test", name_of(test.kind)}, {"specimen", specimen}};
  if (test.kind == CandidateTest::Kind::cantilever) {
    values["profile"] = {{"readings", test.readings},
                         {"clamp_angle_deg", test.clamp_angle / kDegree}};
    values["point_noise"] = test.point_noise;
  } else if (test.kind == CandidateTest::Kind::overhang) {
    values["specimen"].erase("free_length");
    values["overhang"] = {{"readings", test.readings},
                          {"angle_deg", test.angle / kDegree},
                          {"deviation", test.deviation}};
  } else {
    values["curve"] = {{"displacement", {test.first, test.last}}, {"readings", test.readings}};
    values["force_noise"] = test.force_noise;
    values["clip_noise"] = test.clip_noise;
  }
  return values;
}

Json values_of(const CandidateCapture& capture) {
  return {{"capture", capture.folder.string()},
          {"force_noise", capture.force_noise},
          {"point_noise", capture.point_noise}};
}

nlohmann::json json_of(const std::vector<Suggestion>& suggestions,
                       const SuggestArguments& arguments) {
  Json list = Json::array();
  for (std::size_t k = 0; k < suggestions.size(); ++k) {
    const Suggestion& s = suggestions[k];
    Json parameters;
    for (const ExpectedInterval& p : s.parameters)
      parameters[p.name] = {{"value", p.value},
                            {"unit", p.unit},
                            {"half_width_before", p.before},
                            {"half_width", p.after},
                            {"interval_lower", p.lower},
                            {"interval_upper", p.upper}};
    Json experiment = {{"rank", k + 1}, {"name", name_of(s.experiment)}};
    experiment.update(std::visit([](const auto& e) { return values_of(e); }, s.experiment));
    experiment["remaining"] = s.remaining;
    experiment["parameters"] = parameters;
    if (!s.failure.empty()) experiment["failure"] = s.failure;
    list.push_back(experiment);
  }
  return {{"format", "weft-suggestions"},
          {"version", 1},
          {"fabric", arguments.known},
          {"targets", arguments.parameters},
          {"experiments", list}};
}

bool is_target(const SuggestArguments& arguments, const std::string& name) {
  const auto& names = arguments.parameters;
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

void print_table(const std::vector<Suggestion>& suggestions, const SuggestArguments& arguments) {
  fmt::print(
      "Width of the 90 % intervals that is left: of all named (geometric mean), and of each, with\n"
      "the half width expected after the experiment in the scale of the search (1: the range)\n\n");
  std::size_t width = 10;
  for (const Suggestion& s : suggestions) width = std::max(width, name_of(s.experiment).size());
  fmt::print("{:>4}  {:<{}} {:>6}", "rank", "experiment", width, "all");
  for (const ExpectedInterval& p : suggestions.front().parameters)
    if (is_target(arguments, p.name)) fmt::print("  {:>18}", p.name);
  fmt::print("\n");
  for (std::size_t k = 0; k < suggestions.size(); ++k) {
    const Suggestion& s = suggestions[k];
    fmt::print("{:>4}  {:<{}} {:>5.1f}%", k + 1, name_of(s.experiment), width, 100 * s.remaining);
    for (const ExpectedInterval& p : s.parameters)
      if (is_target(arguments, p.name))
        fmt::print("  {:>6.1f}% (± {:>6.4f})", 100 * p.after / p.before, p.after);
    fmt::print("{}\n", s.failure.empty() ? "" : "  not simulated: " + s.failure);
  }
}

BarChart chart_of(const std::vector<Suggestion>& suggestions) {
  BarChart chart;
  chart.title = "Expected width of the intervals after an experiment";
  chart.value.label = "of the width before";
  chart.value.unit = "%";
  for (const Suggestion& s : suggestions)
    chart.bars.push_back({name_of(s.experiment), 100 * s.remaining, "", chart.bars.empty()});
  return chart;
}

/// Throws Error for options of videos where no candidate is one.
void check_candidates(const CLI::App& command, const std::vector<Candidate>& candidates) {
  const bool videos = std::any_of(candidates.begin(), candidates.end(), [](const Candidate& c) {
    return std::holds_alternative<CandidateExperiment>(c);
  });
  if (!videos) refuse_options(command, {"--noise", "--grid"}, "mechanical tests alone");
  refuse_beside(command, "--like", {"--areal-density"});
}

void run_suggest(SuggestArguments& arguments, const CLI::App& command) {
  const InterruptGuard guard;
  const Known known = read_known(arguments.known);
  check_options(arguments, known.fabric);
  const Capture rig = rig_of(arguments, known.fabric);
  for (const std::string& axis : arguments.axes)
    arguments.family.axes.push_back(axis == "along" ? CandidateExperiment::Axis::along
                                    : axis == "up"  ? CandidateExperiment::Axis::up
                                                    : CandidateExperiment::Axis::across);
  const std::vector<Candidate> candidates = arguments.candidates.empty()
                                                ? default_candidates(known.fabric, arguments.family)
                                                : read_candidates(arguments.candidates);
  check_candidates(command, candidates);
  if (!arguments.out.empty())
    prepare_output_folder(arguments.out, {"suggestions.json"},
                          arguments.overwrite ? Existing::overwrite : Existing::refuse);
  SuggestOptions options;
  options.trial.columns = options.trial.rows = arguments.grid;
  options.mechanical.cells = arguments.cells;
  options.targets = arguments.parameters;
  options.known = known_information(known);
  options.noise = arguments.noise > 0 ? arguments.noise : known.noise;
  options.frames_per_sample = known.frames_per_sample;
  options.threads = arguments.threads;
  const std::vector<Suggestion> suggestions =
      suggest_experiments(rig, known.fabric, candidates, options, progress_observer("experiments"));
  end_if_stopped(
      suggestions.size() < candidates.size(),
      fmt::format("{} of {} experiments were simulated", suggestions.size(), candidates.size()));
  const std::string json = json_of(suggestions, arguments).dump(1) + "\n";
  if (arguments.json)
    fmt::print("{}", json);
  else
    print_table(suggestions, arguments);
  if (arguments.out.empty()) return;
  const std::filesystem::path out = arguments.out;
  write_text(out / "suggestions.json", json);
  write_plot(out / "suggestions.svg", chart_of(suggestions));
}

constexpr const char* kFamilyOptions[] = {"--separations", "--amplitudes", "--frequencies",
                                          "--axes", "--frames"};

/// Videos of which all combinations are candidates.
void add_family_options(CLI::App& command, SuggestArguments& arguments) {
  command
      .add_option("--separations", arguments.family.separations,
                  "of the clips, of their distance on the swatch")
      ->check(number_in(0.1, 1))
      ->capture_default_str();
  command
      .add_option("--amplitudes", arguments.family.amplitudes,
                  "m, of the second clip; 0: hanging still")
      ->check(number_in(0, 1))
      ->capture_default_str();
  command.add_option("--frequencies", arguments.family.frequencies, "Hz")
      ->check(number_in(0.01, 20))
      ->capture_default_str();
  command
      .add_option("--axes", arguments.axes, "across (the line of the clips, horizontal), along, up")
      ->check(CLI::IsMember({"across", "along", "up"}))
      ->capture_default_str();
  command.add_option("--frames", arguments.family.frames, "length of each")
      ->check(integer_in(1, 10000))
      ->capture_default_str();
}

}  // namespace

void add_suggest(CLI::App& app) {
  auto* command = add_command(
      app, "suggest",
      "which experiment next: ranked by how much it is expected to shrink the intervals");
  auto arguments = std::make_shared<SuggestArguments>();
  arguments->family.axes.clear();
  command
      ->add_option("known", arguments->known,
                   "the fabric as known so far: preset, fabric.toml, or the folder of a fit, whose "
                   "information and noise level then count")
      ->required();
  command->add_option("--parameters", arguments->parameters,
                      "whose intervals shall shrink (default: all of the model)");
  command->add_option("--like", arguments->like,
                      "capture with the rig, swatch and two clips to use (default: a rig of its "
                      "own)");
  command
      ->add_option("--areal-density", arguments->areal_density,
                   "kg/m^2, without --like, of a fabric whose file does not say it")
      ->check(number_in(1e-3, 10))
      ->capture_default_str();
  command->add_option("--candidates", arguments->candidates,
                      "file of experiments (docs/formats.md); otherwise strips, a bias extension "
                      "and cantilevers, or of a model of motions all combinations of:");
  add_family_options(*command, *arguments);
  command
      ->add_option("--noise", arguments->noise,
                   "rad^2, of a frame: twice the variance of a pixel's residual times the pixels "
                   "that count as one (default: the fit's, or residuals of 0.1 rad in patches a "
                   "sixteenth of the image wide)")
      ->check(number_in(1e-12, 1e12));
  command->add_option("--grid", arguments->grid, "vertices along each side of the swatch")
      ->check(integer_in(3, 401))
      ->capture_default_str();
  command
      ->add_option("--cells", arguments->cells,
                   "mechanical tests: cells of the mesh across the shortest free side")
      ->check(integer_in(2, 200))
      ->capture_default_str();
  add_threads(*command, arguments->threads);
  command->add_flag("--json", arguments->json, "print JSON instead of a table");
  command->add_option("--out", arguments->out, "folder for suggestions.json and suggestions.svg");
  command->add_flag("--overwrite", arguments->overwrite, "replace an earlier result");
  command->footer(
      "Example:\n  weft suggest out/cotton --parameters bend_stiffness shear_stiffness "
      "--amplitudes 0 0.05 --frequencies 1 2\n"
      "  weft suggest out/strip --parameters weft_bend --candidates tests.toml");
  command->callback([arguments, command] {
    for (const char* name : kFamilyOptions) {
      if (command->count(name) == 0) continue;
      if (!arguments->candidates.empty())
        throw Error(fmt::format("{}: not with --candidates", name));
      arguments->video_option = name;
    }
    run_suggest(*arguments, *command);
  });
}

}  // namespace weft::app
