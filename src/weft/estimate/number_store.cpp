#include "weft/estimate/number_store.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <mutex>
#include <string>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr const char* kSchema = R"(
PRAGMA journal_mode = WAL;
PRAGMA synchronous = FULL;
CREATE TABLE IF NOT EXISTS numbers (
  problem TEXT NOT NULL,
  key TEXT NOT NULL,
  value BLOB NOT NULL,
  PRIMARY KEY (problem, key)
);
)";

}  // namespace

struct NumberStore::Impl {
  ~Impl() {
    for (sqlite3_stmt* statement : {select, insert, counter}) sqlite3_finalize(statement);
    sqlite3_close(database);
  }
  [[noreturn]] void fail(const char* what) const {
    throw Error(fmt::format("{}: {}: {}", path.string(), what,
                            database ? sqlite3_errmsg(database) : "out of memory"));
  }
  sqlite3_stmt* prepare(const char* sql) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database, sql, -1, &statement, nullptr) != SQLITE_OK)
      fail("not a store of numbers");
    return statement;
  }
  void open() {
    const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX;
    if (sqlite3_open_v2(path.c_str(), &database, flags, nullptr) != SQLITE_OK)
      fail("cannot be opened");
    sqlite3_busy_timeout(database, 10000);
    if (sqlite3_exec(database, kSchema, nullptr, nullptr, nullptr) != SQLITE_OK)
      fail("not a store of numbers, or it cannot be written");
    select = prepare("SELECT value FROM numbers WHERE problem = ?1 AND key = ?2");
    insert = prepare("INSERT OR IGNORE INTO numbers (problem, key, value) VALUES (?1, ?2, ?3)");
    counter = prepare("SELECT count(*), count(*) FILTER (WHERE problem = ?1) FROM numbers");
  }
  static void bind(sqlite3_stmt* statement, int at, std::string_view text) {
    sqlite3_bind_text(statement, at, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
  }
  struct Counts {
    std::size_t all, own;
  };
  Counts counts() const {
    bind(counter, 1, problem);
    const int status = sqlite3_step(counter);
    const Counts found{static_cast<std::size_t>(sqlite3_column_int64(counter, 0)),
                       static_cast<std::size_t>(sqlite3_column_int64(counter, 1))};
    sqlite3_reset(counter);
    if (status != SQLITE_ROW) fail("cannot be read");
    return found;
  }

  std::filesystem::path path;
  std::string problem;
  sqlite3* database = nullptr;
  sqlite3_stmt* select = nullptr;
  sqlite3_stmt* insert = nullptr;
  sqlite3_stmt* counter = nullptr;
  std::mutex mutex;
};

NumberStore::NumberStore(const std::filesystem::path& path, std::string_view problem)
    : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  impl_->problem = problem;
  impl_->open();
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
  sqlite3_stmt* statement = impl_->select;
  Impl::bind(statement, 1, impl_->problem);
  Impl::bind(statement, 2, key);
  std::optional<VecX> found;
  const int status = sqlite3_step(statement);
  if (status == SQLITE_ROW) {
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement, 0));
    found.emplace(static_cast<Eigen::Index>(size / sizeof(double)));
    const auto* bytes = static_cast<const char*>(sqlite3_column_blob(statement, 0));
    std::copy_n(bytes, size / sizeof(double) * sizeof(double),
                reinterpret_cast<char*>(found->data()));
  }
  sqlite3_reset(statement);
  if (status != SQLITE_ROW && status != SQLITE_DONE) impl_->fail("cannot be read");
  return found;
}

void NumberStore::add(std::string_view key, const VecX& numbers) {
  const std::lock_guard lock(impl_->mutex);
  sqlite3_stmt* statement = impl_->insert;
  Impl::bind(statement, 1, impl_->problem);
  Impl::bind(statement, 2, key);
  sqlite3_bind_blob(statement, 3, numbers.data(),
                    static_cast<int>(static_cast<std::size_t>(numbers.size()) * sizeof(double)),
                    SQLITE_TRANSIENT);
  const int status = sqlite3_step(statement);
  sqlite3_reset(statement);
  if (status != SQLITE_DONE) impl_->fail("cannot be written");
}

std::size_t NumberStore::count() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->counts().own;
}

}  // namespace weft
