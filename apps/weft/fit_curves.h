#pragma once
/// What `weft fit` offers for stiffness curves of mechanical captures.
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "options.h"
#include "weft/estimate/curve_fit.h"
#include "weft/report/mechanical_report.h"

namespace weft::app {

/// Setting in result.json of a fit in which warp has the values of weft.
inline constexpr const char* kSymmetrySetting = "symmetry";

class CurveFitArguments {
 public:
  void add_to(CLI::App& command);
  /// Options of `command` that only mean something for mechanical captures.
  static const std::vector<std::string>& names();
  /// Whether one of them was given: then the fit is one of curves.
  static bool given(const CLI::App& command);
  CurveFitOptions options() const;

 private:
  std::string order_ = "joint";
  bool subdivide_ = false, smooth_ = false, linear_ = false, isotropic_ = false;
  int points_ = CurveFitOptions().most_points;
};

/// "curves" of result.json: for each row that is searched and may be a curve its control points and
/// 21 points of the curve with its band; and "stages" of the fit.
void add_curves(const CurveFitResult& fit, nlohmann::json& result);
/// The stages for a report.
std::vector<ReportStage> report_stages(const CurveFitResult& fit);
/// One line a stage, for the terminal.
std::string stage_lines(const CurveFitResult& fit);

}  // namespace weft::app
