#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "weft/base/error.h"
#include "weft/base/types.h"

namespace weft {

/// Closed range of valid values; the text of an error names it.
struct Range {
  double lower;
  double upper;
};

/// Reads one table of a TOML file and insists that every key in it is asked for: `finish()` throws
/// for a key that nobody read (with the nearest known key as a hint). All errors name file, line
/// and key, the value found and what is valid.
///
///     TomlTable file = TomlTable::parse_file("capture.toml");
///     TomlTable swatch = file.table("swatch");
///     double width = swatch.number("width", {1e-3, 10});
///     swatch.finish();
///     file.finish();
class TomlTable {
 public:
  static TomlTable parse_file(const std::filesystem::path& path);
  static TomlTable parse_string(std::string_view text, const std::filesystem::path& name);

  bool has(std::string_view key) const;
  std::vector<std::string> keys() const;
  const std::filesystem::path& file() const;
  /// Where `key` stands (or this table itself, if `key` is empty or absent).
  SourceLocation where(std::string_view key = {}) const;

  // Required values. Integers are accepted where numbers are asked for; NaN and infinity never.
  double number(std::string_view key, Range valid) const;
  int integer(std::string_view key, int lower, int upper) const;
  bool boolean(std::string_view key) const;
  std::string string(std::string_view key) const;
  /// One of `choices`.
  std::string choice(std::string_view key, const std::vector<std::string>& choices) const;
  std::vector<double> numbers(std::string_view key, std::size_t count, Range valid) const;
  std::vector<int> integers(std::string_view key, std::size_t count, int lower, int upper) const;
  std::vector<std::string> strings(std::string_view key, std::size_t count) const;
  /// Number of entries of an array, within [lower, upper].
  std::size_t array_size(std::string_view key, std::size_t lower, std::size_t upper) const;
  /// Whether the key is there and holds an array.
  bool is_array(std::string_view key) const;
  /// An array of `rows` arrays of `columns` numbers.
  MatX matrix(std::string_view key, int rows, int columns) const;
  /// Sub-table, and array of tables (empty vector if absent).
  TomlTable table(std::string_view key) const;
  std::vector<TomlTable> tables(std::string_view key) const;

  // Optional values.
  std::optional<double> optional_number(std::string_view key, Range valid) const;
  std::optional<int> optional_integer(std::string_view key, int lower, int upper) const;
  std::optional<bool> optional_boolean(std::string_view key) const;
  std::optional<std::string> optional_string(std::string_view key) const;
  std::optional<std::string> optional_choice(std::string_view key,
                                             const std::vector<std::string>& choices) const;
  std::optional<TomlTable> optional_table(std::string_view key) const;

  /// Marks `key` as known without reading it.
  void ignore(std::string_view key) const;
  /// Throws Error for the first key that was never asked for.
  void finish() const;

 private:
  struct Impl;
  explicit TomlTable(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;
};

}  // namespace weft
