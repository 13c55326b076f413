/// Do the 90 % intervals hold the truth in 90 % of cases? Fabrics are drawn at random from the
/// range of the presets, each is filmed by a simulated camera with sensor noise, fitted by least
/// squares from the neighbourhood, and its intervals are compared with the truth:
///
///     weft_validate_coverage OUT [--recoveries N] [--grid N] [--truth-grid N] [--frames N]
///                            [--pixels N] [--seed S] [--first N] [--truth same|other|both]
///                            [--other all|steps|cells|split] [--threads N]
///                            [--profile PARAMETER]
///
/// Two kinds of truth: `same` has the mesh and the steps of the fit, so that the noise of the video
/// is all that is wrong; `other` has a finer mesh, split the other way, and a quarter of the step,
/// or, with --other, one of these alone. Of the latter the intervals hold what halving the cells
/// and steps of the fit does. The motion starts from the true first frame in both. With --profile
/// the interval of that parameter, where it is determined, reaches on either side as far as that or
/// its profile (estimate/profile.h) does; whether that holds the truth is tallied, too. Writes
/// recoveries.csv (a row a parameter and recovery; rows of an earlier run stay, so that more
/// recoveries can be added with --first), parts.csv (truth, recovery, frame or patch, its gradient
/// and matrix at the estimate), coverage.svg, and prints how often the interval of each parameter
/// that was reported as determined held the truth, and how often of all.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>

#include "program.h"
#include "weft/base/error.h"
#include "weft/base/parallel.h"
#include "weft/base/random.h"
#include "weft/estimate/linearize_trial.h"
#include "weft/estimate/profile.h"
#include "weft/estimate/synthetic.h"
#include "weft/estimate/uncertainty.h"
#include "weft/estimate/video_mesh_error.h"
#include "weft/report/plot.h"

namespace {

using namespace weft;

struct Arguments {
  std::filesystem::path out;
  int recoveries = 100, first = 0;
  int grid = 13, truth_grid = 19;
  int frames = 12, pixels = 160;
  int threads = 0;
  std::uint64_t seed = 1;
  std::string truth = "both";
  std::string other = "all";  ///< what differs: steps, cells, split
  std::string profile;        ///< the parameter; empty: none
};

const std::string kHeader =
    "truth,recovery,parameter,true_scaled,estimate_scaled,half_width,determined,at_bound,holds,"
    "condition,dispersion,gain,cost,noise_half_width,mesh_shift,profile_lower,profile_upper";

struct Tally {
  int held = 0, determined = 0, all = 0;
  int held_of_all = 0;
  int bounded = 0, held_of_bounded = 0;     ///< by one end or two
  int profiles = 0, held_with_profile = 0;  ///< of the determined
  std::vector<double> distance;             ///< of the truth from the estimate, in half widths
};

/// Uniform in the scaled coordinates between the least and the largest value of the presets.
Fabric random_fabric(Rng& rng) {
  Fabric fabric = Fabric::with_defaults("random");
  for (int i = 0; i < fabric.values.size(); ++i) {
    const ParameterInfo info = fabric.info(i);
    double lower = 1, upper = 0;
    for (const Fabric& preset : fabric_presets()) {
      lower = std::min(lower, to_scaled(info, preset.values[i]));
      upper = std::max(upper, to_scaled(info, preset.values[i]));
    }
    // Away from the ends of the search, where intervals have one side.
    const double scaled = std::clamp(rng.uniform(lower, upper), 0.03, 0.97);
    fabric.values[i] = from_scaled(info, scaled);
  }
  return fabric;
}

class Study {
 public:
  explicit Study(const Arguments& arguments) : arguments_(arguments) {
    trial_.columns = trial_.rows = arguments.grid;
    trial_.simulation.steps_per_frame = kSteps;
    // The filters of the default are for images four times as wide.
    trial_.angle_map.kernel_radius = 4;
    trial_.angle_map.blur_sigma = 2;
    for (const ParameterInfo& p : baraff_witkin_parameters()) names_.emplace_back(p.name);
  }

  /// Rows for the two files.
  struct Rows {
    std::string coverage, parts;
  };
  Rows recover(int index, bool same) const {
    Rng rng(arguments_.seed, static_cast<std::uint64_t>(index));
    const Fabric truth = random_fabric(rng);
    LayoutOptions layout;
    layout.width = layout.height = 0.3;
    layout.image_width = arguments_.pixels;
    layout.image_height = arguments_.pixels * 3 / 4;
    layout.stripe_period = 0.022;
    layout.frame_count = layout.fit_frames = arguments_.frames;
    layout.separation = rng.uniform(0.7, 0.95);
    layout.wave_amplitude = rng.uniform(0.02, 0.06);
    layout.wave_frequency = rng.uniform(1, 3);
    SyntheticOptions synthetic;
    const auto differs = [&](const char* what) {
      return !same && (arguments_.other == "all" || arguments_.other == what);
    };
    synthetic.columns = synthetic.rows = differs("cells") ? arguments_.truth_grid : arguments_.grid;
    synthetic.pattern = differs("split") ? GridPattern::uniform : GridPattern::alternating;
    synthetic.simulation.steps_per_frame = differs("steps") ? 4 * kSteps : kSteps;
    synthetic.seed = arguments_.seed * 1000003 + static_cast<std::uint64_t>(index);
    synthetic.threads = 1;
    const auto trial = simulate_trial(make_layout(layout), truth, trial_, synthetic);

    const Problem problem({trial}, truth, names_);
    const VecX true_scaled = problem.scaled(truth);
    VecX start = true_scaled;
    for (double& coordinate : start)
      coordinate = std::clamp(coordinate + rng.uniform(-0.05, 0.05), 0.0, 1.0);
    const LeastSquaresResult fit = descend(problem, start);
    if (!std::isfinite(fit.cost)) throw Error("the fit diverged");
    const std::vector<PatchPart> parts = linearize_patches(problem, fit.x, linearization());
    const Uncertainty scatter = estimate_uncertainty(problem, fit.x, parts);
    // On the mesh of the truth there is no error of the mesh.
    const auto [uncertainty, mesh] =
        same ? UncertaintyWithMesh{scatter, {}}
             : estimate_uncertainty_with_mesh(problem, fit.x, parts, scatter.dispersion,
                                              linearization());
    const double gain = fit.cost / evaluate_cost(problem, true_scaled, linearization()).cost;
    Rows rows;
    const auto add_parts = [&](const char* kind, const std::vector<CostPart>& sums) {
      for (const CostPart& part : sums) {
        rows.parts += fmt::format("{},{},{},{}", same ? "same" : "other", index, kind, part.frame);
        for (const double g : part.gradient) rows.parts += fmt::format(",{:.9g}", g);
        for (const double h : part.hessian.reshaped()) rows.parts += fmt::format(",{:.9g}", h);
        rows.parts += '\n';
      }
    };
    add_parts("frame", frames_of(parts));
    add_parts("patch", patches_of(parts));
    for (int i = 0; i < problem.dimension(); ++i) {
      const ParameterInterval& p = uncertainty.parameters[static_cast<std::size_t>(i)];
      std::string profiled = ",";
      if (p.name == arguments_.profile && p.determined) {
        const Profile found = profile_of(problem, fit.x, i, p.half_width, scatter);
        profiled = fmt::format("{:.6f},{:.6f}", found.lower, found.upper);
      }
      const double value = truth.value(p.name);
      rows.coverage += fmt::format(
          "{},{},{},{:.6f},{:.6f},{:.6g},{},{},{},{:.3g},{:.3g},{:.4g},{:.4g},{:.6g},{:.6g},{}\n",
          same ? "same" : "other", index, p.name, true_scaled[i], fit.x[i], p.half_width,
          int(p.determined), int(p.at_lower || p.at_upper),
          int(value >= p.lower && value <= p.upper), uncertainty.condition, uncertainty.dispersion,
          gain, fit.cost, scatter.parameters[static_cast<std::size_t>(i)].half_width,
          mesh.shift.size() > 0 ? mesh.shift[i] : 0, profiled);
    }
    return rows;
  }

 private:
  static constexpr int kSteps = 4;

  static LinearizationOptions linearization() {
    LinearizationOptions options;
    options.threads = 1;
    return options;
  }

  static LinearizeFunction linearizer(const Problem& problem) {
    return [&](const VecX& x) { return linearize(problem, x, linearization()).model; };
  }
  static CostFunction cost_of(const Problem& problem) {
    return [&](const VecX& x) { return evaluate_cost(problem, x, linearization()).cost; };
  }

  static LeastSquaresResult descend(const Problem& problem, const VecX& start) {
    LeastSquaresOptions options;
    options.max_iterations = 12;
    options.step_tolerance = 3e-4;
    options.cost_tolerance = 1e-5;
    options.initial_damping = 1e-4;
    return minimize_least_squares(linearizer(problem), cost_of(problem), start,
                                  VecX::Zero(start.size()), VecX::Ones(start.size()), options);
  }

  static Profile profile_of(const Problem& problem, const VecX& at, int parameter,
                            double half_width, const Uncertainty& scatter) {
    return profile(linearizer(problem), cost_of(problem), at, parameter, scatter.dispersion,
                   profile_options(scatter, half_width));
  }

  const Arguments& arguments_;
  TrialOptions trial_;
  std::vector<std::string> names_;
};

/// Of all rows in the file: by truth, then by parameter.
std::map<std::string, std::map<std::string, Tally>> tally(const std::filesystem::path& file) {
  std::map<std::string, std::map<std::string, Tally>> result;
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::vector<std::string> cells;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    if (cells.size() < 9) continue;
    Tally& t = result[cells[0]][cells[2]];
    ++t.all;
    t.held_of_all += cells[8] == "1";
    const bool determined = cells[6] == "1";
    const double estimate = std::stod(cells[4]), half_width = std::stod(cells[5]);
    if (determined || estimate - half_width > 0 || estimate + half_width < 1) {
      ++t.bounded;
      t.held_of_bounded += cells[8] == "1";
    }
    if (!determined) continue;
    ++t.determined;
    t.held += cells[8] == "1";
    if (cells.size() > 16 && !cells[15].empty()) {
      const double truth = std::stod(cells[3]);
      ++t.profiles;
      t.held_with_profile += truth >= std::min(estimate - half_width, std::stod(cells[15])) &&
                             truth <= std::max(estimate + half_width, std::stod(cells[16]));
    }
    t.distance.push_back(std::abs(estimate - std::stod(cells[3])) / half_width);
  }
  return result;
}

void conclude(const std::filesystem::path& out) {
  const auto tallies = tally(out / "recoveries.csv");
  BarChart chart;
  chart.title = "Share of the 90 % intervals that hold the truth";
  chart.value.label = "share";
  chart.value.unit = "%";
  chart.value.upper = 100;
  fmt::print("{:<6} {:<18} {:>10} {:>9} {:>8} {:>10} {:>12} {:>10} {:>8} {:>8}\n", "truth",
             "parameter", "recoveries", "determined", "held", "share", "90 % at", "bounded", "held",
             "of all");
  for (const auto& [truth, parameters] : tallies) {
    for (const ParameterInfo& info : baraff_witkin_parameters()) {
      const auto at = parameters.find(std::string(info.name));
      if (at == parameters.end()) continue;
      Tally t = at->second;
      std::ranges::sort(t.distance);
      const double share = t.determined > 0 ? 100.0 * t.held / t.determined : 0;
      // The half width times this would have held 90 %.
      const double quantile =
          t.distance.empty() ? 0
                             : t.distance[std::min(t.distance.size() - 1,
                                                   std::size_t(0.9 * double(t.distance.size())))];
      fmt::print("{:<6} {:<18} {:>10} {:>9} {:>8} {:>8.0f} % {:>10.2f}x {:>10} {:>8} {:>6.0f} %\n",
                 truth, info.name, t.all, t.determined, t.held, share, quantile, t.bounded,
                 t.held_of_bounded, 100.0 * t.held_of_all / t.all);
      if (t.profiles > 0)
        fmt::print("{:<6} {:<18} {:>10} {:>9} {:>8} {:>8.0f} %\n", "", "  or its profile", "",
                   t.profiles, t.held_with_profile, 100.0 * t.held_with_profile / t.profiles);
      if (t.determined == 0) continue;
      std::string words(info.name);
      std::ranges::replace(words, '_', ' ');
      chart.bars.push_back({fmt::format("{}, {} mesh", words, truth), share,
                            fmt::format("{} of {}", t.held, t.determined),
                            share >= 85 && share <= 95});
    }
  }
  if (!chart.bars.empty()) write_plot(out / "coverage.svg", chart);
}

Arguments read(int argc, char** argv) {
  if (argc < 2) throw Error("usage: weft_validate_coverage OUT [--recoveries N] ... (see source)");
  Arguments arguments;
  arguments.out = argv[1];
  for (int i = 2; i < argc; i += 2) {
    const std::string option = argv[i];
    if (i + 1 == argc) throw Error(option + ": a value is missing");
    const std::string value = argv[i + 1];
    if (option == "--recoveries")
      arguments.recoveries = validation::number(option, value, 0);
    else if (option == "--first")
      arguments.first = validation::number(option, value, 0);
    else if (option == "--grid")
      arguments.grid = validation::number(option, value, 3);
    else if (option == "--truth-grid")
      arguments.truth_grid = validation::number(option, value, 3);
    else if (option == "--frames")
      arguments.frames = validation::number(option, value, 2);
    else if (option == "--pixels")
      arguments.pixels = validation::number(option, value, 48);
    else if (option == "--profile")
      arguments.profile = value;
    else if (option == "--threads")
      arguments.threads = validation::number(option, value, 0);
    else if (option == "--seed")
      arguments.seed = static_cast<std::uint64_t>(validation::number(option, value, 0));
    else if (option == "--truth" && (value == "same" || value == "other" || value == "both"))
      arguments.truth = value;
    else if (option == "--other" &&
             (value == "all" || value == "steps" || value == "cells" || value == "split"))
      arguments.other = value;
    else
      throw Error(fmt::format("{} {}: is not known", option, value));
  }
  if (!arguments.profile.empty()) parameter_index("baraff-witkin", arguments.profile);
  return arguments;
}

int run(int argc, char** argv) {
  const Arguments arguments = read(argc, argv);
  std::filesystem::create_directories(arguments.out);
  const std::filesystem::path file = arguments.out / "recoveries.csv";
  const bool fresh = !std::filesystem::exists(file);
  std::ofstream csv(file, std::ios::app);
  if (!csv) throw Error(file.string() + ": cannot be written");
  if (fresh) csv << kHeader << '\n' << std::flush;
  std::ofstream parts(arguments.out / "parts.csv", std::ios::app);
  const Study study(arguments);
  std::mutex mutex;
  const int kinds = arguments.truth == "both" ? 2 : 1;
  parallel_for(static_cast<std::size_t>(arguments.recoveries * kinds), arguments.threads,
               [&](std::size_t task) {
                 const int index = arguments.first + static_cast<int>(task) / kinds;
                 const bool same = kinds == 2 ? task % 2 == 0 : arguments.truth == "same";
                 try {
                   const Study::Rows rows = study.recover(index, same);
                   const std::lock_guard lock(mutex);
                   csv << rows.coverage << std::flush;
                   parts << rows.parts << std::flush;
                 } catch (const Error& error) {
                   const std::lock_guard lock(mutex);
                   fmt::print(stderr, "recovery {}: {}\n", index, error.what());
                 }
               });
  conclude(arguments.out);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return weft::validation::run_program("weft_validate_coverage", [&] { return run(argc, argv); });
}
