#pragma once
#include <string>

#include "weft/report/html_parts.h"
#include "weft/report/mechanical_report.h"

namespace weft::detail {

/// Sections of a report's page under `id` ("tests-..." beside those of videos); empty where there
/// are no mechanical captures.
std::string mechanical_measured_section(const MechanicalReport& report, std::string_view id);
std::string mechanical_match_section(const MechanicalReport& report, std::string_view id,
                                     PlotPlacer& place);
/// What was found besides the parameters, which belongs to "What was found": moduli, friction of
/// cords.
std::string found_tables(const MechanicalReport& report);
/// The fits on the way, which belong to "Progress of the search".
std::string stage_table(const MechanicalReport& report);
/// Stress against strain of the fabric, which belongs to "How sure".
std::string response_figures(const MechanicalReport& report, PlotPlacer& place);

}  // namespace weft::detail
