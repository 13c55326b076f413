#pragma once
/// Arguments that several subcommands share.
#include <CLI/App.hpp>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "weft/estimate/problem.h"

namespace weft::app {

/// How a capture is simulated and looked at.
class TrialArguments {
 public:
  void add_to(CLI::App& command);
  /// For a command with one capture: where its motion starts.
  void add_start_to(CLI::App& command);
  /// For a command with several: the same, one each or none.
  void add_starts_to(CLI::App& command);
  /// Throws Error for values outside their ranges.
  TrialOptions options() const;
  /// Throws Error for an integrator without derivatives, which `what` needs.
  void need_derivatives(const std::string& what) const;
  int threads() const { return threads_; }
  /// Which frames of a capture are compared.
  enum class Frames { fit, from_fit_to_end };
  /// Reads those frames and prepares them; what was computed from the video is kept in the cache.
  std::shared_ptr<const Trial> prepare(const Capture& capture, Frames frames) const;
  std::vector<std::shared_ptr<const Trial>> prepare(const std::vector<Capture>& captures,
                                                    Frames frames) const;
  std::shared_ptr<const Trial> prepare(const Capture& capture, int first, int last) const;
  /// The same with the starts that suit `fabric` (with_start_for).
  std::shared_ptr<const Trial> prepare_for(const Fabric& fabric, const Capture& capture,
                                           Frames frames) const;
  std::vector<std::shared_ptr<const Trial>> prepare_for(const Fabric& fabric,
                                                        const std::vector<Capture>& captures,
                                                        Frames frames) const;
  std::shared_ptr<const Trial> prepare_for(const Fabric& fabric, const Capture& capture, int first,
                                           int last) const;

 private:
  /// Of the captures given that with index k.
  std::shared_ptr<const Trial> prepare_one(const Capture& capture, std::size_t k, int first,
                                           int last) const;

  int grid_ = 41;
  int steps_ = 4;
  const CLI::Option* steps_option_ = nullptr;
  std::string integrator_ = "bdf2";
  double alpha_ = 0.1;
  double mask_threshold_ = AngleMapOptions().mask_threshold;
  int threads_ = 0;
  std::vector<std::string> starts_;  // empty, or one a capture
  std::string cache_ = default_cache_folder();
  static std::string default_cache_folder();
};

/// Throws Error for a folder that is given twice, under whatever path: it would count double.
void refuse_twice(const std::vector<std::string>& folders);
/// Throws Error as read_capture and refuse_twice do.
std::vector<Capture> read_captures(const std::vector<std::string>& folders);

/// What becomes of an earlier run's results. `extend`: its evaluations are kept and not made again.
enum class Existing { refuse, overwrite, extend };
/// Makes the folder if needed. Throws Error if it cannot be made or written to, or if it holds one
/// of `results` (the files of another run) and they are to be refused.
void prepare_output_folder(const std::filesystem::path& folder,
                           const std::vector<std::string>& results, Existing existing);

/// Removes the files of an earlier run from `folder`: those whose whole name `pattern` (a regular
/// expression, ECMAScript) matches.
void remove_results(const std::filesystem::path& folder, const std::string& pattern);

/// Throws Error if a file cannot be written at `path`: asked before the work whose result goes
/// there. Leaves what is there as it is.
void check_output_file(const std::filesystem::path& path);

/// The same of a picture, .svg, beside which its data go (write_plot). Throws Error for another
/// ending, and for data that stand there without the picture: they are of something else.
void check_plot_file(const std::string& option, const std::filesystem::path& path);

/// A file that a command reads or writes, and what names it: "--out". Without a path there is none.
struct NamedFile {
  std::string name;
  std::filesystem::path path;
};
/// Throws Error for an output that is another output or an input: one of them would be lost.
void refuse_same_file(const std::vector<NamedFile>& outputs, const std::vector<NamedFile>& inputs);

/// The numbers of "AxB" or "A,B,C"; throws Error, with the option's name, unless there are `count`.
std::vector<double> numbers_in(const std::string& option, const std::string& text, char separator,
                               std::size_t count);

/// Throws Error for options of `command` that were given though they do not apply to the captures:
/// `names` as "--grid", `kind` as "a mechanical capture".
void refuse_options(const CLI::App& command, const std::vector<std::string>& names,
                    const std::string& kind);
/// Throws Error for those of `names` that were given without `needed`, "--rig".
void refuse_without(const CLI::App& command, const std::string& needed,
                    const std::vector<std::string>& names);
/// Throws Error for those of `names` that were given beside `other`, which says it already.
void refuse_beside(const CLI::App& command, const std::string& other,
                   const std::vector<std::string>& names);

/// If `stopped` (by Ctrl-C), says so, with `left`: what was left out or written; and ends the
/// program with the status stopped_early.
void end_if_stopped(bool stopped, const std::string& left);

/// Accepts a number from `lower` to `upper`; CLI::Range lets NaN pass.
CLI::Validator number_in(double lower, double upper);

/// Accepts an integer from `lower` to `upper`; CLI::Range takes 010 for 8 and 0x10 for 16.
CLI::Validator integer_in(int lower, int upper);

/// Accepts what an unsigned integer of 64 bits can hold, as integer_in(); CLI11 wraps a negative
/// number around.
CLI::Validator unsigned_integer();

/// --threads, into `threads`, whose value is the default.
void add_threads(CLI::App& command, int& threads);

/// `fabric` as the start of a fit to the captures in `folders`: with the optional terms that
/// --include names, the areal density of the captures, `name`, and where it came from. Throws Error
/// for a term that its model does not have.
Fabric start_of_fit(Fabric fabric, const std::vector<std::string>& include, std::string name,
                    double areal_density, const std::vector<std::string>& folders);

/// Throws Error, with the option's name, for a parameter that the model does not have.
void check_parameters(const std::string& option, const std::string& model,
                      const std::vector<std::string>& names);
/// The same for a value that the fabric does not have: its curves have several.
void check_parameters(const std::string& option, const Fabric& fabric,
                      const std::vector<std::string>& names);

/// Observer of a grid of evaluations: shows progress, and stops on Ctrl-C.
std::function<bool(std::size_t, std::size_t)> progress_observer(const std::string& label);

}  // namespace weft::app
