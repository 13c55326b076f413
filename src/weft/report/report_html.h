#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "weft/report/mechanical_report.h"
#include "weft/report/pictures.h"
#include "weft/report/report.h"

namespace weft {

/// The report as one HTML page that needs nothing else: style, script, plots (with their data as
/// CSV) and pictures are inside, and it refers to no other address. Warnings come first. Sections
/// without content are left out; mechanical captures have sections of their own. `pictures` belong
/// to captures by name; their frames are shown beside each other under a slider.
std::string report_to_html(const Report& report, const std::vector<CapturePictures>& pictures = {},
                           const MechanicalReport& mechanical = {});

/// Throws Error if the file cannot be written.
void write_report_html(const std::filesystem::path& path, const Report& report,
                       const std::vector<CapturePictures>& pictures = {},
                       const MechanicalReport& mechanical = {});

}  // namespace weft
