#pragma once
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>

#include "weft/base/types.h"

namespace weft {

/// What a long computation has found so far, in an SQLite file: lists of numbers by keys, each on
/// the disk before add() returns. A computation that is started again asks for the same keys in the
/// same order and finds them here. Safe to use from several threads.
class NumberStore {
 public:
  /// Opens or creates. `problem`: what all keys belong to (a content hash). Throws Error if `path`
  /// cannot be written, is no such file, or holds numbers of another problem.
  NumberStore(const std::filesystem::path& path, std::string_view problem);
  ~NumberStore();

  std::optional<VecX> find(std::string_view key) const;
  /// What is there already stays.
  void add(std::string_view key, const VecX& numbers);
  /// Removes what belongs to keys that begin with `prefix`, but for `kept`.
  void remove_all_but(std::string_view prefix, std::string_view kept);
  std::size_t count() const;
  /// How often find() has found something that was there when the store was opened.
  std::size_t replayed() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace weft
