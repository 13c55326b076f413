#pragma once
/// Mechanical captures beside videos of the same fabric, for `weft fit`.
#include <memory>
#include <string>
#include <vector>

#include "mechanical.h"
#include "weft/estimate/mechanical_data.h"
#include "weft/report/mechanical_report.h"

namespace weft::app {

/// Setting in result.json that names them; a command that cannot take them along refuses a result
/// with it.
inline constexpr const char* kMechanicalSetting = "mechanical captures";

class MechanicalBeside {
 public:
  /// Reads and prepares the captures of `arguments`, and fits them by themselves from `initial`,
  /// with progress: `free` are those of the joint problem; what the tests do not determine stays
  /// about where it was. Evaluations, also those of the joint problem, are kept in the output
  /// folder. Throws Error for captures that cannot be computed.
  MechanicalBeside(const MechanicalFitArguments& arguments, const Fabric& initial,
                   const std::vector<std::string>& free);

  /// Of the tests alone.
  const Fabric& fabric() const { return alone_.fabric; }
  /// Weighed at that fabric.
  OtherData data() const;

  /// The estimate on each test, with bands where there are intervals.
  struct Shown {
    MechanicalReport report;
    nlohmann::json json;             ///< one entry a capture, as under "mechanical" in result.json
    std::vector<std::string> lines;  ///< for the terminal
  };
  Shown show(const Fabric& estimate, const std::vector<ParameterInterval>& intervals,
             const MatX& correlation) const;

 private:
  int threads_;
  std::vector<MechanicalCapture> captures_;
  std::vector<std::shared_ptr<const MechanicalTrial>> trials_;
  std::shared_ptr<const MechanicalProblem> problem_;
  MechanicalFitResult alone_;
};

}  // namespace weft::app
