#include "synthesize_rig.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "weft/base/error.h"

namespace weft::app {

const std::vector<std::string>& RigArguments::names() {
  static const std::vector<std::string> names{"--tests",         "--steps",          "--loops",
                                              "--largest-force", "--largest-strain", "--cells",
                                              "--threads",       "--known-forces"};
  return names;
}

void RigArguments::add_to(CLI::App& command) {
  command.add_flag("--rig", wanted_,
                   "mechanical captures instead of a video, OUT/TEST for each of --tests: a square "
                   "of 0.1 m between bars, on a table's edge and at its corners");
  for (const RigTest test : rig_tests()) tests_.emplace_back(name_of(test));
  command
      .add_option("--tests", tests_,
                  "with --rig: the first five are for fits, the others for evaluation")
      ->check(CLI::IsMember(tests_))
      ->capture_default_str();
  command.add_flag("--known-forces", known_forces_,
                   "with --rig: stretch tests of a bar that cords pull with known forces, whose "
                   "poses are recorded, in place of one that is moved, whose forces are");
  command
      .add_option("--steps", options_.steps,
                  "with --rig: frames from rest to the largest load, and overhangs of a bend test")
      ->check(integer_in(1, 1000))
      ->capture_default_str();
  command.add_option("--loops", options_.loops, "with --rig: of loading and unloading")
      ->check(integer_in(1, 100))
      ->capture_default_str();
  command
      .add_option("--largest-force", options_.largest_force,
                  "with --rig: on a bar, N, were the cloth strained evenly")
      ->check(number_in(1e-3, 1e4))
      ->capture_default_str();
  command
      .add_option("--largest-strain", options_.largest_strain,
                  "with --rig: elongation at which a stretch ends before that force")
      ->check(number_in(1e-4, 1))
      ->capture_default_str();
  command
      .add_option("--cells", options_.mesh.cells,
                  "with --rig: cells of the truth's mesh across the shortest free side")
      ->check(integer_in(2, 200))
      ->capture_default_str();
  command.add_option("--threads", options_.threads, "with --rig: 0: one a core")
      ->check(integer_in(0, 1024))
      ->capture_default_str();
}

void RigArguments::check() const {
  const std::set<std::string> tests(tests_.begin(), tests_.end());
  if (tests.size() < tests_.size()) throw Error("--tests: one is named twice");
  const bool stretches = std::any_of(tests_.begin(), tests_.end(), [](const std::string& test) {
    return test.starts_with("stretch");
  });
  if (known_forces_ && !stretches) throw Error("--known-forces: only with a test of stretch");
}

void RigArguments::run(const Fabric& fabric, const std::string& out, bool with_noise,
                       std::uint64_t seed, Existing existing) const {
  check();
  RigOptions options = options_;
  options.seed = seed;
  if (known_forces_) options.stretch_drive = StretchDrive::known_forces;
  if (!with_noise) options.noise = {0, 0, 0, 0};
  for (const std::string& test : tests_)
    prepare_output_folder(std::filesystem::path(out) / test, {"capture.toml"}, existing);
  for (const std::string& test : tests_) {
    const MechanicalCapture made = make_rig_capture(std::filesystem::path(out) / test,
                                                    rig_test_from_name(test), fabric, options);
    fmt::print("{}: {} frames of {}\n", made.folder.string(), made.frame_count, fabric.name);
  }
}

}  // namespace weft::app
