#pragma once
#include <string>

namespace weft::app {

/// The command that this process was started with, quoted where a shell needs it: results say how
/// they were made.
std::string command_line();

}  // namespace weft::app
