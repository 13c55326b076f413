#include "weft/capture/motion_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <set>

namespace weft {
namespace {

constexpr std::string_view kTimeColumn = "time_s";

std::string trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(kBlank) - first + 1));
}

std::vector<std::string> split(std::string_view line) {
  std::vector<std::string> cells;
  for (;;) {
    const std::size_t comma = line.find(',');
    cells.push_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

}  // namespace

MotionFile::MotionFile(const std::filesystem::path& path) : path_(path) {
  read_rows();
  read_times();
}

void MotionFile::read_rows() {
  std::error_code status;
  if (!std::filesystem::is_regular_file(path_, status))
    throw error_at({path_, 0, {}}, "no such file");
  std::ifstream stream(path_);
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    if (number == 1 && line.starts_with("\xef\xbb\xbf")) line.erase(0, 3);
    if (trimmed(line).empty()) continue;
    std::vector<std::string> cells = split(line);
    if (header_.empty()) {
      header_ = std::move(cells);
      continue;
    }
    if (cells.size() != header_.size()) {
      throw error_at({path_, number, {}}, fmt::format("{} cells; the header has {} columns",
                                                      cells.size(), header_.size()));
    }
    rows_.push_back(std::move(cells));
    lines_.push_back(number);
  }
  if (!stream.eof()) throw error_at({path_, 0, {}}, "cannot be read");
  if (header_.empty()) throw error_at({path_, 0, {}}, "empty; a header row is needed");
  std::set<std::string> names;
  for (const std::string& name : header_) {
    if (!names.insert(name).second) throw error_at({path_, 1, name}, "two columns of this name");
  }
  if (!has(kTimeColumn)) throw error_at({path_, 1, std::string(kTimeColumn)}, "no such column");
  if (rows_.empty()) throw error_at({path_, 0, {}}, "no rows below the header");
}

void MotionFile::read_times() {
  const std::size_t column = column_index(kTimeColumn);
  for (std::size_t row = 0; row < rows_.size(); ++row) {
    const double time = number(row, column);
    if (row > 0 && time <= times_.back()) {
      throw fail(
          row, kTimeColumn,
          fmt::format("{:g} s is not after the {:g} s of the row before; times must increase", time,
                      times_.back()));
    }
    times_.push_back(time);
  }
}

bool MotionFile::has(std::string_view column) const {
  return std::find(header_.begin(), header_.end(), column) != header_.end();
}

std::size_t MotionFile::column_index(std::string_view column) const {
  return static_cast<std::size_t>(std::find(header_.begin(), header_.end(), column) -
                                  header_.begin());
}

Points MotionFile::positions(const std::vector<std::string>& columns) const {
  Points result(3, static_cast<Eigen::Index>(rows_.size()));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t column = column_index(columns[axis]);
    for (std::size_t row = 0; row < rows_.size(); ++row) {
      result(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(row)) = number(row, column);
    }
  }
  return result;
}

double MotionFile::number(std::size_t row, std::size_t column) const {
  const std::string& cell = rows_[row][column];
  double value = 0;
  const auto [end, status] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (status != std::errc() || end != cell.data() + cell.size() || !std::isfinite(value)) {
    throw fail(row, header_[column], fmt::format("\"{}\" is not a finite number", cell));
  }
  return value;
}

Error MotionFile::fail(std::size_t row, std::string_view column, std::string_view reason) const {
  return error_at({path_, lines_[row], std::string(column)}, reason);
}

}  // namespace weft
