#pragma once
#include <memory>
#include <string>
#include <vector>

#include "options.h"
#include "weft/estimate/mechanical_rig.h"

namespace weft::app {

/// `weft synthesize --rig`: mechanical captures of a computed rig.
class RigArguments {
 public:
  void add_to(CLI::App& command);
  bool wanted() const { return wanted_; }
  /// Writes OUT/TEST/capture.toml for each test. `with_noise` and `seed` are those of the command.
  void run(const Fabric& fabric, const std::string& out, bool with_noise, std::uint64_t seed,
           Existing existing) const;
  /// Options that only mean something with --rig.
  static const std::vector<std::string>& names();

 private:
  void check() const;

  bool wanted_ = false, known_forces_ = false;
  std::vector<std::string> tests_;
  RigOptions options_;
};

}  // namespace weft::app
