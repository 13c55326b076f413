#include "weft/capture/motion_file.h"

#include <fmt/format.h>

namespace weft {
namespace {

constexpr std::string_view kTimeColumn = "time_s";

}  // namespace

MotionFile::MotionFile(const std::filesystem::path& path) : table_(path) {
  if (!has(kTimeColumn))
    throw error_at({path, table_.header_line(), std::string(kTimeColumn)}, "no such column");
  if (table_.row_count() == 0) throw error_at({path, 0, {}}, "no rows below the header");
  read_times();
}

void MotionFile::read_times() {
  const std::size_t column = table_.column_index(kTimeColumn);
  for (std::size_t row = 0; row < table_.row_count(); ++row) {
    const double time = table_.number(row, column);
    if (row > 0 && time <= times_.back()) {
      throw table_.fail(
          row, kTimeColumn,
          fmt::format("{:g} s is not after the {:g} s of the row before; times must increase", time,
                      times_.back()));
    }
    times_.push_back(time);
  }
}

Points MotionFile::positions(const std::vector<std::string>& columns) const {
  Points result(3, static_cast<Eigen::Index>(table_.row_count()));
  for (std::size_t axis = 0; axis < 3; ++axis)
    result.row(static_cast<Eigen::Index>(axis)) = table_.numbers(columns[axis]).transpose();
  return result;
}

}  // namespace weft
