#include "weft/estimate/evaluation_store.h"

#include <fmt/format.h>

#include <mutex>

#include "weft/estimate/sqlite_file.h"

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
CREATE TABLE IF NOT EXISTS numbers (
  problem TEXT NOT NULL,
  model TEXT NOT NULL,
  frame_count INTEGER NOT NULL,
  parameters TEXT NOT NULL,
  key TEXT NOT NULL,
  value BLOB NOT NULL,
  PRIMARY KEY (problem, model, frame_count, parameters, key)
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
  Impl(const std::filesystem::path& path, std::string_view whose)
      : program(whose), database(path, "store of evaluations", {kSchema, kVersion}) {}

  static void bind_key(detail::Statement& statement, const Problem& problem, const Fabric& fabric,
                       int frame_count) {
    statement.bind(1, problem.fingerprint());
    statement.bind(2, fabric.model);
    statement.bind(3, frame_count);
    statement.bind(4, parameters_text(fabric));
  }

  static std::size_t counted(detail::Statement& statement) {
    std::size_t count = 0;
    statement.run(
        [&](const detail::Row& row) { count = static_cast<std::size_t>(row.integer(0)); });
    return count;
  }

  void bind_numbers(detail::Statement& statement, const Problem& problem, const Fabric& fabric,
                    int frame_count, std::string_view key) const {
    bind_key(statement, problem, fabric, frame_count);
    statement.bind(5, program.empty() ? std::string(key) : fmt::format("{}: {}", program, key));
  }

  std::string program;
  detail::Database database;
  detail::Statement select = database.prepare(
      "SELECT error, error_per_frame, fold, silhouette, diverged, wall_s FROM evaluation "
      "WHERE problem = ?1 AND model = ?2 AND frame_count = ?3 AND parameters = ?4");
  detail::Statement insert = database.prepare(
      "INSERT OR IGNORE INTO evaluation (problem, model, frame_count, parameters, phase, error, "
      "error_per_frame, fold, silhouette, diverged, wall_s) "
      "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)");
  detail::Statement select_numbers = database.prepare(
      "SELECT value FROM numbers WHERE problem = ?1 AND model = ?2 AND frame_count = ?3 AND "
      "parameters = ?4 AND key = ?5");
  detail::Statement insert_numbers = database.prepare(
      "INSERT OR IGNORE INTO numbers (problem, model, frame_count, parameters, key, value) "
      "VALUES (?1, ?2, ?3, ?4, ?5, ?6)");
  detail::Statement counter =
      database.prepare("SELECT count(*) FROM evaluation WHERE problem = ?1");
  detail::Statement total = database.prepare("SELECT count(*) FROM evaluation");
  std::mutex mutex;
};

EvaluationStore::EvaluationStore(const std::filesystem::path& path, std::string_view program)
    : impl_(std::make_unique<Impl>(path, program)) {}
EvaluationStore::~EvaluationStore() = default;
EvaluationStore::EvaluationStore(EvaluationStore&&) noexcept = default;

std::optional<ProblemEvaluation> EvaluationStore::find(const Problem& problem, const Fabric& fabric,
                                                       int frame_count) const {
  const std::lock_guard lock(impl_->mutex);
  Impl::bind_key(impl_->select, problem, fabric, frame_count);
  std::optional<ProblemEvaluation> found;
  impl_->select.run([&](const detail::Row& row) {
    ProblemEvaluation& e = found.emplace();
    e.error = row.number(0);
    e.error_per_frame = row.number(1);
    e.fold = row.number(2);
    e.silhouette = row.number(3);
    e.diverged = row.integer(4) != 0;
    e.wall_s = row.number(5);
  });
  return found;
}

void EvaluationStore::add(const Problem& problem, const Fabric& fabric, int frame_count,
                          std::string_view phase, const ProblemEvaluation& evaluation) {
  const std::lock_guard lock(impl_->mutex);
  detail::Statement& insert = impl_->insert;
  Impl::bind_key(insert, problem, fabric, frame_count);
  insert.bind(5, phase);
  insert.bind(6, evaluation.error);
  insert.bind(7, evaluation.error_per_frame);
  insert.bind(8, evaluation.fold);
  insert.bind(9, evaluation.silhouette);
  insert.bind(10, evaluation.diverged ? 1 : 0);
  insert.bind(11, evaluation.wall_s);
  insert.run();
}

std::optional<VecX> EvaluationStore::find_numbers(const Problem& problem, const Fabric& fabric,
                                                  int frame_count, std::string_view key) const {
  const std::lock_guard lock(impl_->mutex);
  impl_->bind_numbers(impl_->select_numbers, problem, fabric, frame_count, key);
  std::optional<VecX> found;
  impl_->select_numbers.run([&](const detail::Row& row) { found = row.numbers(0); });
  return found;
}

void EvaluationStore::add_numbers(const Problem& problem, const Fabric& fabric, int frame_count,
                                  std::string_view key, const VecX& numbers) {
  const std::lock_guard lock(impl_->mutex);
  impl_->bind_numbers(impl_->insert_numbers, problem, fabric, frame_count, key);
  impl_->insert_numbers.bind(6, numbers);
  impl_->insert_numbers.run();
}

std::size_t EvaluationStore::count(const Problem& problem) const {
  const std::lock_guard lock(impl_->mutex);
  impl_->counter.bind(1, problem.fingerprint());
  return Impl::counted(impl_->counter);
}

std::size_t EvaluationStore::count() const {
  const std::lock_guard lock(impl_->mutex);
  return Impl::counted(impl_->total);
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
