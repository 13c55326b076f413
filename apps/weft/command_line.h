#pragma once
#include <string>

namespace weft::app {

/// The command that this process was started with, quoted where a shell needs it: results say how
/// they were made.
std::string command_line();

/// Local date and time with its offset, as results state when they were made.
std::string now();

/// Exit status of a fit that was stopped: as the shell reports a program ended by Ctrl-C.
inline constexpr int stopped_early = 130;

}  // namespace weft::app
