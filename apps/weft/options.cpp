#include "options.h"

#include <fmt/format.h>

#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <optional>
#include <regex>
#include <set>
#include <string_view>
#include <utility>

#include "command_line.h"
#include "weft/base/error.h"
#include "weft/base/files.h"
#include "weft/base/interrupt.h"
#include "weft/base/number_text.h"
#include "weft/base/progress.h"
#include "weft/estimate/choose_start.h"

namespace weft::app {

void TrialArguments::add_to(CLI::App& command) {
  command.add_option("--grid", grid_, "vertices along each side of the simulated swatch")
      ->check(integer_in(3, 401))
      ->capture_default_str();
  steps_option_ =
      command.add_option("--steps-per-frame", steps_, "time steps of an implicit integrator")
          ->check(integer_in(1, 10000))
          ->capture_default_str();
  command.add_option("--integrator", integrator_, "bdf2, newmark, implicit-euler or runge-kutta")
      ->check(CLI::IsMember({"bdf2", "newmark", "implicit-euler", "runge-kutta"}))
      ->capture_default_str();
  command.add_option("--alpha", alpha_, "weight of the silhouette in the error")
      ->check(number_in(0, 1e6))
      ->capture_default_str();
  command
      .add_option("--fold-threshold", mask_threshold_,
                  "gradient of the angle map above which a pixel is part of a fold, rad/px")
      ->check(number_in(0, 3.2))
      ->capture_default_str();
  command
      .add_option("--cache", cache_,
                  "folder that keeps what was computed from videos; none: nothing is kept")
      ->capture_default_str();
  add_threads(command, threads_);
}

void TrialArguments::add_start_to(CLI::App& command) {
  command
      .add_option("--start-surface", starts_,
                  "surface of frame 0, .obj: one that a fit wrote, or start.obj of weft "
                  "simulate; else the one that suits the fabric is searched for")
      ->expected(1);
}

void TrialArguments::add_starts_to(CLI::App& command) {
  command.add_option("--start-surface", starts_,
                     "surface of frame 0 of each capture, .obj, in their order: those that a fit "
                     "wrote; else those that suit the fabric are searched for");
}

std::string TrialArguments::default_cache_folder() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache) {
    return (std::filesystem::path(cache) / "weft").string();
  }
  if (const char* home = std::getenv("HOME"); home && *home) {
    return (std::filesystem::path(home) / ".cache" / "weft").string();
  }
  return "none";
}

namespace {

int last_of(const Capture& capture, TrialArguments::Frames frames) {
  return frames == TrialArguments::Frames::fit ? capture.fit_last : capture.frame_count - 1;
}

}  // namespace

std::shared_ptr<const Trial> TrialArguments::prepare(const Capture& capture, Frames frames) const {
  return prepare(capture, capture.fit_first, last_of(capture, frames));
}

std::vector<std::shared_ptr<const Trial>> TrialArguments::prepare(
    const std::vector<Capture>& captures, Frames frames) const {
  if (!starts_.empty() && starts_.size() != captures.size())
    throw Error(fmt::format("--start-surface: {} given, {} captures: one each, in their order",
                            starts_.size(), captures.size()));
  std::vector<std::shared_ptr<const Trial>> trials;
  for (std::size_t k = 0; k < captures.size(); ++k)
    trials.push_back(
        prepare_one(captures[k], k, captures[k].fit_first, last_of(captures[k], frames)));
  return trials;
}

std::shared_ptr<const Trial> TrialArguments::prepare(const Capture& capture, int first,
                                                     int last) const {
  return prepare_one(capture, 0, first, last);
}

std::shared_ptr<const Trial> TrialArguments::prepare_one(const Capture& capture, std::size_t k,
                                                         int first, int last) const {
  const std::filesystem::path cache = cache_ == "none" ? std::string() : cache_;
  Capture started = capture;
  if (!starts_.empty()) started.start_surface = starts_[k];
  auto trial = prepare_trial(started, first, last, options(), threads_, cache);
  if (trial->start_name != "measured surface") {
    fmt::print(stderr, "{}: the motion starts from the shape \"{}\": {}\n", capture.name,
               trial->start_name, trial->start_note);
  }
  return trial;
}

std::shared_ptr<const Trial> TrialArguments::prepare_for(const Fabric& fabric,
                                                         const Capture& capture,
                                                         Frames frames) const {
  return with_start_for(prepare(capture, frames), fabric, 0, threads_);
}

std::vector<std::shared_ptr<const Trial>> TrialArguments::prepare_for(
    const Fabric& fabric, const std::vector<Capture>& captures, Frames frames) const {
  return with_starts_for(prepare(captures, frames), fabric, 0, threads_);
}

std::shared_ptr<const Trial> TrialArguments::prepare_for(const Fabric& fabric,
                                                         const Capture& capture, int first,
                                                         int last) const {
  return with_start_for(prepare(capture, first, last), fabric, 0, threads_);
}

TrialOptions TrialArguments::options() const {
  TrialOptions options;
  options.columns = options.rows = grid_;
  options.alpha = alpha_;
  options.angle_map.mask_threshold = mask_threshold_;
  options.simulation.integrator = integrator_from_name(integrator_);
  options.simulation.steps_per_frame = steps_;
  if (options.simulation.integrator == Integrator::runge_kutta && steps_option_ &&
      steps_option_->count() > 0)
    throw Error("--steps-per-frame: runge-kutta chooses its own steps");
  return options;
}

void TrialArguments::need_derivatives(const std::string& what) const {
  if (integrator_from_name(integrator_) == Integrator::runge_kutta)
    throw Error(
        fmt::format("--integrator: runge-kutta has no derivatives, which {} needs; take "
                    "bdf2, newmark or implicit-euler",
                    what));
}

void refuse_twice(const std::vector<std::string>& folders) {
  std::set<std::filesystem::path> seen;
  for (const std::string& folder : folders) {
    std::error_code failure;
    const auto path = std::filesystem::weakly_canonical(folder, failure);
    if (!failure && !seen.insert(path).second)
      throw Error(fmt::format("captures: {} is given twice", folder));
  }
}

std::vector<Capture> read_captures(const std::vector<std::string>& folders) {
  refuse_twice(folders);
  std::vector<Capture> captures;
  for (const std::string& folder : folders) captures.push_back(read_capture(folder));
  return captures;
}

void prepare_output_folder(const std::filesystem::path& folder,
                           const std::vector<std::string>& results, Existing existing) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure || !is_folder(folder)) {
    throw Error(fmt::format("{}: cannot be made: {}", folder.string(),
                            failure ? failure.message() : "it is a file"));
  }
  if (existing == Existing::refuse) {
    for (const std::string& name : results) {
      if (path_exists(folder / name)) {
        throw Error(
            fmt::format("{}: holds {} of another run; name another folder, or give "
                        "--overwrite",
                        folder.string(), name));
      }
    }
  }
  // Asking is not enough (a read-only mount): write.
  const std::filesystem::path probe = folder / ".weft-write-test";
  {
    std::ofstream file(probe);
    file << '\n';
    file.flush();
    if (!file) throw Error(fmt::format("{}: cannot be written to", folder.string()));
  }
  std::filesystem::remove(probe, failure);
}

void remove_results(const std::filesystem::path& folder, const std::string& pattern) {
  const std::regex name(pattern);
  for (const std::filesystem::path& path : entries_of(folder))
    if (std::regex_match(path.filename().string(), name)) remove_file(path);
}

void check_output_file(const std::filesystem::path& path) {
  std::error_code ignored;
  const bool existed = std::filesystem::exists(path, ignored);
  const bool writable = std::ofstream(path, std::ios::app).good();
  if (!writable) throw Error(fmt::format("{}: cannot be written", path.string()));
  if (!existed) std::filesystem::remove(path, ignored);
}

void check_plot_file(const std::string& option, const std::filesystem::path& path) {
  if (path.extension() != ".svg")
    throw Error(fmt::format("{}: {}: a picture ends in .svg; its data go beside it, as .csv",
                            option, path.string()));
  check_output_file(path);
  const std::filesystem::path data = std::filesystem::path(path).replace_extension(".csv");
  std::error_code ignored;
  if (std::filesystem::exists(data, ignored) && !std::filesystem::exists(path, ignored))
    throw Error(
        fmt::format("{}: {} is there without the picture {}, whose data would replace it; "
                    "name another picture",
                    option, data.string(), path.filename().string()));
  check_output_file(data);
}

namespace {

bool same_file(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::error_code failure;
  if (std::filesystem::equivalent(a, b, failure) && !failure) return true;
  // Absolute first: of a relative path that is not there yet nothing would be resolved.
  const auto resolved = [&failure](const std::filesystem::path& path) {
    const auto full = std::filesystem::absolute(path, failure);
    return failure ? full : std::filesystem::weakly_canonical(full, failure);
  };
  const auto resolved_a = resolved(a);
  if (failure) return false;
  const auto resolved_b = resolved(b);
  return !failure && resolved_a == resolved_b;
}

/// Whether there is a file that could be lost: /dev/null cannot, nor can the name of a preset.
bool can_be_lost(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

}  // namespace

void refuse_same_file(const std::vector<NamedFile>& outputs, const std::vector<NamedFile>& inputs) {
  std::error_code ignored;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const auto& [name, path] = outputs[i];
    if (path.empty()) continue;
    for (const NamedFile& input : inputs)
      if (can_be_lost(input.path) && same_file(path, input.path))
        throw Error(fmt::format("{}: {} is {}, which it would replace; name another file", name,
                                path.string(), input.name));
    if (std::filesystem::exists(path, ignored) && !can_be_lost(path)) continue;
    for (std::size_t j = 0; j < i; ++j)
      if (!outputs[j].path.empty() && same_file(path, outputs[j].path))
        throw Error(fmt::format("{}: {} is the file of {}, too; each needs its own", name,
                                path.string(), outputs[j].name));
  }
}

void refuse_options(const CLI::App& command, const std::vector<std::string>& names,
                    const std::string& kind) {
  for (const std::string& name : names) {
    const CLI::Option* option = command.get_option_no_throw(name);
    if (option && option->count() > 0)
      throw Error(fmt::format("{}: means nothing for {}", name, kind));
  }
}

void refuse_without(const CLI::App& command, const std::string& needed,
                    const std::vector<std::string>& names) {
  if (command.count(needed) > 0) return;
  for (const std::string& name : names)
    if (command.count(name) > 0) throw Error(fmt::format("{}: only with {}", name, needed));
}

void refuse_beside(const CLI::App& command, const std::string& other,
                   const std::vector<std::string>& names) {
  if (command.count(other) == 0) return;
  for (const std::string& name : names)
    if (command.count(name) > 0) throw Error(fmt::format("{}: not with {}", name, other));
}

void end_if_stopped(bool stopped, const std::string& left) {
  if (!stopped) return;
  fmt::print("stopped before the end: {}\n", left);
  throw CLI::RuntimeError(stopped_early);
}

CLI::Validator number_in(double lower, double upper) {
  const auto check = [lower, upper](std::string& text) -> std::string {
    const auto value = number_of<double>(text);
    if (value && *value >= lower && *value <= upper) return {};
    return fmt::format("Value {} not in range {:g} to {:g}", text, lower, upper);
  };
  return {check, fmt::format("FLOAT in [{:g} - {:g}]", lower, upper)};
}

void add_threads(CLI::App& command, int& threads) {
  command.add_option("--threads", threads, "0: all cores")
      ->check(integer_in(0, 1024))
      ->capture_default_str();
}

namespace {

/// The integer that `text` is to CLI11 as well, which takes a zero in front for octal.
template <typename Integer>
std::optional<Integer> decimal_of(std::string_view text) {
  const std::string_view digits = text.starts_with('-') ? text.substr(1) : text;
  if (digits.size() > 1 && digits.front() == '0') return std::nullopt;
  return number_of<Integer>(text);
}

template <typename Integer>
std::string no_integer(const std::string& text, Integer lower, Integer upper) {
  return fmt::format("{} is not an integer from {} to {} (decimal, without zeros in front)", text,
                     lower, upper);
}

}  // namespace

CLI::Validator integer_in(int lower, int upper) {
  const auto check = [lower, upper](std::string& text) -> std::string {
    const auto value = decimal_of<int>(text);
    if (value && *value >= lower && *value <= upper) return {};
    return no_integer(text, lower, upper);
  };
  return {check, fmt::format("INT in [{} - {}]", lower, upper)};
}

CLI::Validator unsigned_integer() {
  const auto check = [](std::string& text) -> std::string {
    if (decimal_of<std::uint64_t>(text)) return {};
    return no_integer<std::uint64_t>(text, 0, std::numeric_limits<std::uint64_t>::max());
  };
  return {check, "UINT64"};
}

Fabric start_of_fit(Fabric fabric, const std::vector<std::string>& include, std::string name,
                    double areal_density, const std::vector<std::string>& folders) {
  check_parameters("--include", fabric.model, include);
  for (const std::string& term : include) fabric.include(term);
  fabric.name = std::move(name);
  fabric.areal_density = areal_density;
  fabric.provenance = fmt::format("fitted to {} by weft " WEFT_VERSION, fmt::join(folders, ", "));
  return fabric;
}

void check_parameters(const std::string& option, const std::string& model,
                      const std::vector<std::string>& names) {
  for (const std::string& name : names)
    with_errors_at({.key = option}, [&] { parameter_index(model, name); });
}

void check_parameters(const std::string& option, const Fabric& fabric,
                      const std::vector<std::string>& names) {
  for (const std::string& name : names)
    with_errors_at({.key = option}, [&] { fabric.value_index(name); });
}

std::function<bool(std::size_t, std::size_t)> progress_observer(const std::string& label) {
  // The bar is made at the first call, when the total is known, and lives as long as the observer.
  auto bar = std::make_shared<std::unique_ptr<Progress>>();
  return [bar, label](std::size_t done, std::size_t total) {
    if (!*bar) *bar = std::make_unique<Progress>(label, total);
    (*bar)->update(done);
    return !interrupted();
  };
}

std::vector<double> numbers_in(const std::string& option, const std::string& text, char separator,
                               std::size_t count) {
  const auto numbers = numbers_of(text, separator);
  if (!numbers || numbers->size() != count)
    throw Error(fmt::format("{} \"{}\": expected {} numbers with \"{}\" between", option, text,
                            count, separator));
  return *numbers;
}

}  // namespace weft::app
