#include "weft/estimate/sqlite_file.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <cstring>

#include "weft/base/error.h"

namespace weft::detail {
namespace {

constexpr int kPatience = 10000;  // ms, for other processes to finish writing

/// Ready for the next run, whatever ends this one: a statement in the middle of its rows keeps the
/// file from being tidied up.
struct Reset {
  sqlite3_stmt* statement;
  explicit Reset(sqlite3_stmt* running) : statement(running) {}
  Reset(const Reset&) = delete;
  Reset& operator=(const Reset&) = delete;
  ~Reset() { sqlite3_reset(statement); }
};

}  // namespace

double Row::number(int column) const { return sqlite3_column_double(statement_, column); }

std::int64_t Row::integer(int column) const { return sqlite3_column_int64(statement_, column); }

VecX Row::numbers(int column) const {
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
  const std::size_t count = size / sizeof(double);
  VecX numbers(static_cast<Eigen::Index>(count));
  if (count > 0)
    std::memcpy(numbers.data(), sqlite3_column_blob(statement_, column), count * sizeof(double));
  return numbers;
}

Statement::Statement(const Database& database, sqlite3_stmt* statement)
    : database_(&database), statement_(statement) {}

void Statement::Finalize::operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }

void Statement::bind(int at, std::string_view text) {
  sqlite3_bind_text(statement_.get(), at, text.data(), static_cast<int>(text.size()),
                    SQLITE_TRANSIENT);
}

void Statement::bind(int at, double number) { sqlite3_bind_double(statement_.get(), at, number); }

void Statement::bind(int at, int number) { sqlite3_bind_int(statement_.get(), at, number); }

void Statement::bind(int at, const VecX& numbers) {
  const std::size_t size = static_cast<std::size_t>(numbers.size()) * sizeof(double);
  sqlite3_bind_blob(statement_.get(), at, numbers.data(), static_cast<int>(size), SQLITE_TRANSIENT);
}

void Statement::run(const std::function<void(const Row&)>& each) {
  const Reset reset(statement_.get());
  int status = SQLITE_OK;
  while ((status = sqlite3_step(statement_.get())) == SQLITE_ROW)
    if (each) each(Row(statement_.get()));
  if (status == SQLITE_DONE) return;
  if (status == SQLITE_NOTADB) database_->fail("not a " + database_->what_);
  database_->fail(sqlite3_stmt_readonly(statement_.get()) ? "cannot be read" : "cannot be written");
}

Database::Database(std::filesystem::path path, std::string what)
    : path_(std::move(path)), what_(std::move(what)) {
  open(SQLITE_OPEN_READWRITE);
}

Database::Database(std::filesystem::path path, std::string what, const Schema& schema)
    : path_(std::move(path)), what_(std::move(what)) {
  open(SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  const bool unnumbered = schema.version > 0 && version_of_file(schema.version) == 0;
  // A commit is on the disk before the search goes on: its cost is nothing against a simulation.
  execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;");
  execute(schema.sql);
  if (unnumbered) execute(fmt::format("PRAGMA user_version = {};", schema.version));
}

void Database::open(int flags) {
  sqlite3* opened = nullptr;
  const int status =
      sqlite3_open_v2(path_.c_str(), &opened, flags | SQLITE_OPEN_FULLMUTEX, nullptr);
  handle_.reset(opened);
  if (status != SQLITE_OK) fail("cannot be opened");
  sqlite3_busy_timeout(opened, kPatience);
}

std::int64_t Database::version_of_file(int expected) const {
  std::int64_t found = 0;
  prepare("PRAGMA user_version").run([&](const Row& row) { found = row.integer(0); });
  if (found != 0 && found != expected)
    throw Error(fmt::format("{}: version {} of the store, this program reads version {}",
                            path_.string(), found, expected));
  return found;
}

void Database::Close::operator()(sqlite3* handle) const { sqlite3_close(handle); }

void Database::fail(const std::string& problem) const {
  throw Error(fmt::format("{}: {}: {}", path_.string(), problem,
                          handle_ ? sqlite3_errmsg(handle_.get()) : "out of memory"));
}

void Database::execute(const std::string& sql) const {
  if (sqlite3_exec(handle_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
    fail("not a " + what_ + ", or it cannot be written");
}

Statement Database::prepare(const std::string& sql) const {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(handle_.get(), sql.c_str(), -1, &statement, nullptr) != SQLITE_OK)
    fail("not a " + what_);
  return {*this, statement};
}

}  // namespace weft::detail
