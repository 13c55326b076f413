#pragma once
#include <string_view>

namespace weft {

/// Style sheet and script of the HTML report.
extern const std::string_view report_css;
extern const std::string_view report_js;

}  // namespace weft
