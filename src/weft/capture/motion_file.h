#pragma once
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "weft/capture/table_file.h"

namespace weft {

/// A motion CSV (docs/formats.md): a table with a column `time_s`.
class MotionFile {
 public:
  /// Throws Error (file, line, column) for what TableFile refuses, and if there is no `time_s`, no
  /// rows, or times that are not finite and strictly increasing.
  explicit MotionFile(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return table_.path(); }
  const std::vector<double>& times() const { return times_; }  ///< s
  const std::vector<std::string>& header() const { return table_.header(); }
  bool has(std::string_view column) const { return table_.has(column); }
  /// One coordinate a column of `columns` (which the header has); 3 x samples, m. Throws Error for
  /// a cell that is not a finite number.
  Points positions(const std::vector<std::string>& columns) const;

 private:
  void read_times();

  TableFile table_;
  std::vector<double> times_;
};

}  // namespace weft
