#pragma once
#include <string>

#include "weft/report/html_parts.h"
#include "weft/report/mechanical_report.h"

namespace weft::detail {

/// Sections of a report's page; empty where there are no mechanical captures.
std::string mechanical_measured_section(const MechanicalReport& report);
std::string mechanical_match_section(const MechanicalReport& report, PlotPlacer& place);
/// Stress against strain of the fabric, which belongs to "How sure".
std::string response_figures(const MechanicalReport& report, PlotPlacer& place);

}  // namespace weft::detail
