#pragma once
#include <string>
#include <vector>

#include "options.h"
#include "weft/estimate/synthetic_scans.h"

namespace weft::app {

/// `weft synthesize --scan`: a capture of scanned shapes.
class SynthesizeScanArguments {
 public:
  void add_to(CLI::App& command);
  bool wanted() const { return wanted_; }
  /// Writes OUT/capture.toml. `with_noise` and `seed` are those of the command; the areal density
  /// is the fabric's.
  void run(const Fabric& fabric, const std::string& out, bool with_noise, std::uint64_t seed,
           Existing existing) const;
  /// Options that only mean something with --scan.
  static const std::vector<std::string>& names();

 private:
  bool wanted_ = false;
  bool clouds_ = false;
  std::string swatch_ = "0.15x0.15";
  std::vector<std::string> experiments_ = default_scan_experiments();
  SyntheticScanOptions options_;
};

}  // namespace weft::app
