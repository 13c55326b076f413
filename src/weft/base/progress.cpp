#include "weft/base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>

namespace weft {
namespace {

std::string duration_text(double seconds) {
  const auto whole = std::lround(seconds);
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

/// "3/10", or "3" where the total is not known.
std::string count_text(std::size_t done, std::size_t total) {
  return total > 0 ? fmt::format("{}/{}", done, total) : fmt::format("{}", done);
}

}  // namespace

Progress::Progress(std::string label, std::size_t total, Options options)
    : label_(std::move(label)), total_(total), options_(options), start_(options.start) {
  terminal_ = isatty(fileno(options_.stream)) != 0;
  // The first update prints at once.
  last_print_ = Clock::now() - std::chrono::hours(1);
}

Progress::~Progress() {
  try {
    finish();
  } catch (...) {
    // A line of progress that cannot be printed is no reason to end the process.
  }
}

void Progress::update(std::size_t done, const std::string& note) {
  done_ = done;
  last_update_ = Clock::now();
  const auto interval = terminal_ ? options_.terminal_interval : options_.log_interval;
  if (finished_ || *last_update_ - last_print_ < interval) return;
  const double taken = seconds_between(start_, *last_update_);
  std::string line =
      fmt::format("{}: {}, {}", label_, count_text(done, total_), duration_text(taken));
  if (done > 0 && done < total_) {
    const double left = taken / static_cast<double>(done) * static_cast<double>(total_ - done);
    line += fmt::format(", {} left", duration_text(left));
  }
  if (!note.empty()) line += ", " + note;
  print(line, Place::passing);
}

void Progress::finish(const std::string& note) {
  if (finished_) return;
  finished_ = true;
  const Clock::time_point end = last_update_.value_or(Clock::now());
  std::string line = fmt::format("{}: {} in {}", label_, count_text(done_, total_),
                                 duration_text(seconds_between(start_, end)));
  if (!note.empty()) line += ", " + note;
  print(line, Place::last);
}

void Progress::print(const std::string& line, Place place) {
  last_print_ = Clock::now();
  if (options_.quiet) return;
  if (terminal_) {
    fmt::print(options_.stream, "\r\033[K{}{}", line, place == Place::last ? "\n" : "");
  } else {
    fmt::print(options_.stream, "{}\n", line);
  }
  std::fflush(options_.stream);
}

}  // namespace weft
