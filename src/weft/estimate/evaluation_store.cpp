#include "weft/estimate/evaluation_store.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <mutex>

#include "weft/base/error.h"

namespace weft {
namespace {

constexpr int kVersion = 1;

constexpr const char* kSchema = R"(
CREATE TABLE IF NOT EXISTS evaluation (
  id INTEGER PRIMARY KEY,
  problem TEXT NOT NULL,
  model TEXT NOT NULL,
  phase TEXT NOT NULL,
  parameters TEXT NOT NULL,
  frame_count INTEGER NOT NULL,
  error REAL,
  error_per_frame REAL,
  fold REAL,
  silhouette REAL,
  diverged INTEGER NOT NULL,
  wall_s REAL NOT NULL,
  UNIQUE (problem, model, frame_count, parameters)
);
)";

/// {"stretch_stiffness":50,...} with 17 significant digits: reads well, and each double comes back
/// exactly and is the only one that is written so.
std::string parameters_text(const Fabric& fabric) {
  std::string text = "{";
  for (int i = 0; i < fabric.values.size(); ++i)
    text +=
        fmt::format("{}\"{}\":{:.17g}", i > 0 ? "," : "", fabric.info(i).name, fabric.values[i]);
  return text + "}";
}

}  // namespace

struct EvaluationStore::Impl {
  explicit Impl(const std::filesystem::path& file) : path(file) {}
  ~Impl() {
    sqlite3_finalize(select);
    sqlite3_finalize(insert);
    sqlite3_finalize(counter);
    sqlite3_finalize(total);
    sqlite3_close(database);
  }

  [[noreturn]] void fail(const char* what) const {
    throw Error(fmt::format("{}: {}: {}", path.string(), what,
                            database ? sqlite3_errmsg(database) : "out of memory"));
  }

  void execute(const char* sql) const {
    if (sqlite3_exec(database, sql, nullptr, nullptr, nullptr) != SQLITE_OK)
      fail("not a store of evaluations, or it cannot be written");
  }

  sqlite3_stmt* prepare(const char* sql) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database, sql, -1, &statement, nullptr) != SQLITE_OK)
      fail("not a store of evaluations");
    return statement;
  }

  int user_version() const {
    sqlite3_stmt* statement = prepare("PRAGMA user_version");
    if (sqlite3_step(statement) != SQLITE_ROW) {
      sqlite3_finalize(statement);
      fail("not a store of evaluations");
    }
    const int version = sqlite3_column_int(statement, 0);
    sqlite3_finalize(statement);
    return version;
  }

  void open() {
    const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX;
    if (sqlite3_open_v2(path.c_str(), &database, flags, nullptr) != SQLITE_OK)
      fail("cannot be opened");
    sqlite3_busy_timeout(database, 10000);
    const int version = user_version();
    if (version != 0 && version != kVersion)
      throw Error(fmt::format("{}: version {} of the store, this program reads version {}",
                              path.string(), version, kVersion));
    // A commit is on the disk before the search goes on: its cost is nothing against a simulation.
    execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;");
    execute(kSchema);
    if (version == 0) execute("PRAGMA user_version = 1;");
    select = prepare(
        "SELECT error, error_per_frame, fold, silhouette, diverged, wall_s FROM evaluation "
        "WHERE problem = ?1 AND model = ?2 AND frame_count = ?3 AND parameters = ?4");
    insert = prepare(
        "INSERT OR IGNORE INTO evaluation (problem, model, frame_count, parameters, phase, error, "
        "error_per_frame, fold, silhouette, diverged, wall_s) "
        "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)");
    counter = prepare("SELECT count(*) FROM evaluation WHERE problem = ?1");
    total = prepare("SELECT count(*) FROM evaluation");
  }

  std::size_t counted(sqlite3_stmt* statement) const {
    const int status = sqlite3_step(statement);
    const auto count =
        status == SQLITE_ROW ? static_cast<std::size_t>(sqlite3_column_int64(statement, 0)) : 0;
    sqlite3_reset(statement);
    if (status != SQLITE_ROW) fail("cannot be read");
    return count;
  }

  static void bind_text(sqlite3_stmt* statement, int at, std::string_view text) {
    sqlite3_bind_text(statement, at, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
  }

  static void bind_key(sqlite3_stmt* statement, const Problem& problem, const Fabric& fabric,
                       int frame_count) {
    bind_text(statement, 1, problem.fingerprint());
    bind_text(statement, 2, fabric.model);
    sqlite3_bind_int(statement, 3, frame_count);
    bind_text(statement, 4, parameters_text(fabric));
  }

  std::filesystem::path path;
  sqlite3* database = nullptr;
  sqlite3_stmt* select = nullptr;
  sqlite3_stmt* insert = nullptr;
  sqlite3_stmt* counter = nullptr;
  sqlite3_stmt* total = nullptr;
  std::mutex mutex;
};

EvaluationStore::EvaluationStore(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(path)) {
  impl_->open();
}
EvaluationStore::~EvaluationStore() = default;
EvaluationStore::EvaluationStore(EvaluationStore&&) noexcept = default;

std::optional<ProblemEvaluation> EvaluationStore::find(const Problem& problem, const Fabric& fabric,
                                                       int frame_count) const {
  const std::lock_guard lock(impl_->mutex);
  sqlite3_stmt* statement = impl_->select;
  Impl::bind_key(statement, problem, fabric, frame_count);
  std::optional<ProblemEvaluation> found;
  const int status = sqlite3_step(statement);
  if (status == SQLITE_ROW) {
    ProblemEvaluation& e = found.emplace();
    e.error = sqlite3_column_double(statement, 0);
    e.error_per_frame = sqlite3_column_double(statement, 1);
    e.fold = sqlite3_column_double(statement, 2);
    e.silhouette = sqlite3_column_double(statement, 3);
    e.diverged = sqlite3_column_int(statement, 4) != 0;
    e.wall_s = sqlite3_column_double(statement, 5);
  }
  sqlite3_reset(statement);
  if (status != SQLITE_ROW && status != SQLITE_DONE) impl_->fail("cannot be read");
  return found;
}

void EvaluationStore::add(const Problem& problem, const Fabric& fabric, int frame_count,
                          std::string_view phase, const ProblemEvaluation& evaluation) {
  const std::lock_guard lock(impl_->mutex);
  sqlite3_stmt* statement = impl_->insert;
  Impl::bind_key(statement, problem, fabric, frame_count);
  Impl::bind_text(statement, 5, phase);
  sqlite3_bind_double(statement, 6, evaluation.error);
  sqlite3_bind_double(statement, 7, evaluation.error_per_frame);
  sqlite3_bind_double(statement, 8, evaluation.fold);
  sqlite3_bind_double(statement, 9, evaluation.silhouette);
  sqlite3_bind_int(statement, 10, evaluation.diverged ? 1 : 0);
  sqlite3_bind_double(statement, 11, evaluation.wall_s);
  const int status = sqlite3_step(statement);
  sqlite3_reset(statement);
  if (status != SQLITE_DONE) impl_->fail("cannot be written");
}

std::size_t EvaluationStore::count(const Problem& problem) const {
  const std::lock_guard lock(impl_->mutex);
  Impl::bind_text(impl_->counter, 1, problem.fingerprint());
  return impl_->counted(impl_->counter);
}

std::size_t EvaluationStore::count() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->counted(impl_->total);
}

StoredEvaluation evaluate_stored(const Problem& problem, const Fabric& fabric, int frame_count,
                                 std::string_view phase, EvaluationStore* store, int threads) {
  if (store) {
    if (const auto found = store->find(problem, fabric, frame_count)) return {*found, true};
  }
  const ProblemEvaluation evaluation = evaluate(problem, fabric, frame_count, threads);
  if (store) store->add(problem, fabric, frame_count, phase, evaluation);
  return {evaluation, false};
}

}  // namespace weft
