#include "weft/estimate/number_store.h"

#include <fmt/format.h>

#include <mutex>
#include <string>
#include <unordered_set>

#include "weft/base/error.h"
#include "weft/estimate/sqlite_file.h"

namespace weft {
namespace {

constexpr const char* kNumbersSchema = R"(
CREATE TABLE IF NOT EXISTS numbers (
  problem TEXT NOT NULL,
  key TEXT NOT NULL,
  value BLOB NOT NULL,
  PRIMARY KEY (problem, key)
);
)";

}  // namespace

struct NumberStore::Impl {
  Impl(const std::filesystem::path& path, std::string_view whose)
      : problem(whose), database(path, "store of numbers", {kNumbersSchema}) {
    for (detail::Statement* statement : {&select, &insert, &remove, &counter})
      statement->bind(1, problem);
  }

  struct Counts {
    std::int64_t all = 0, own = 0;
  };
  Counts counts() {
    Counts found;
    counter.run([&](const detail::Row& row) { found = {row.integer(0), row.integer(1)}; });
    return found;
  }

  std::string problem;
  detail::Database database;
  detail::Statement select =
      database.prepare("SELECT value FROM numbers WHERE problem = ?1 AND key = ?2");
  detail::Statement insert =
      database.prepare("INSERT OR IGNORE INTO numbers (problem, key, value) VALUES (?1, ?2, ?3)");
  detail::Statement remove = database.prepare(
      "DELETE FROM numbers WHERE problem = ?1 AND substr(key, 1, length(?2)) = ?2 AND key <> ?3");
  detail::Statement counter =
      database.prepare("SELECT count(*), count(*) FILTER (WHERE problem = ?1) FROM numbers");
  std::mutex mutex;
  std::size_t replayed = 0;
  std::unordered_set<std::string> added;  ///< since it was opened
};

NumberStore::NumberStore(const std::filesystem::path& path, std::string_view problem)
    : impl_(std::make_unique<Impl>(path, problem)) {
  const Impl::Counts counts = impl_->counts();
  if (counts.all > counts.own)
    throw Error(
        fmt::format("{}: of another run (other captures, or other options); name another "
                    "folder, or give --overwrite",
                    path.string()));
}
NumberStore::~NumberStore() = default;

std::optional<VecX> NumberStore::find(std::string_view key) const {
  const std::lock_guard lock(impl_->mutex);
  detail::Statement& select = impl_->select;
  select.bind(2, key);
  std::optional<VecX> found;
  select.run([&](const detail::Row& row) { found = row.numbers(0); });
  if (found && !impl_->added.contains(std::string(key))) ++impl_->replayed;
  return found;
}

void NumberStore::add(std::string_view key, const VecX& numbers) {
  const std::lock_guard lock(impl_->mutex);
  detail::Statement& insert = impl_->insert;
  insert.bind(2, key);
  insert.bind(3, numbers);
  insert.run();
  impl_->added.emplace(key);
}

void NumberStore::remove_all_but(std::string_view prefix, std::string_view kept) {
  const std::lock_guard lock(impl_->mutex);
  detail::Statement& remove = impl_->remove;
  remove.bind(2, prefix);
  remove.bind(3, kept);
  remove.run();
}

std::size_t NumberStore::replayed() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->replayed;
}

std::size_t NumberStore::count() const {
  const std::lock_guard lock(impl_->mutex);
  return static_cast<std::size_t>(impl_->counts().own);
}

}  // namespace weft
