#include "weft/estimate/stored_evaluations.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <cmath>
#include <memory>

#include "weft/base/error.h"

namespace weft {
namespace {

class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : path_(path) {
    sqlite3* opened = nullptr;
    const int status = sqlite3_open_v2(path.c_str(), &opened, SQLITE_OPEN_READWRITE, nullptr);
    database_.reset(opened);
    if (status != SQLITE_OK) fail();
  }

  /// Calls `row` with the statement at each row.
  template <typename Row>
  void query(const std::string& sql, const Row& row) const {
    sqlite3_stmt* prepared = nullptr;
    if (sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &prepared, nullptr) != SQLITE_OK)
      fail();
    const std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement(prepared,
                                                                          sqlite3_finalize);
    for (;;) {
      const int status = sqlite3_step(prepared);
      if (status == SQLITE_DONE) return;
      if (status != SQLITE_ROW) fail();
      row(prepared);
    }
  }

 private:
  [[noreturn]] void fail() const {
    throw Error(fmt::format("{}: not a store of evaluations: {}", path_.string(),
                            sqlite3_errmsg(database_.get())));
  }

  std::filesystem::path path_;
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> database_{nullptr, sqlite3_close};
};

}  // namespace

std::vector<StoredPoint> read_evaluations(const std::filesystem::path& path,
                                          const std::vector<std::string>& parameters) {
  const Reader reader(path);
  int problems = 0;
  reader.query("SELECT count(DISTINCT problem) FROM evaluation",
               [&](sqlite3_stmt* row) { problems = sqlite3_column_int(row, 0); });
  if (problems > 1)
    throw Error(fmt::format("{}: holds evaluations of {} problems (other captures or options)",
                            path.string(), problems));
  std::string columns;
  for (const std::string& name : parameters)
    columns += fmt::format(", json_extract(parameters, '$.{}')", name);
  std::vector<StoredPoint> points;
  reader.query(fmt::format("SELECT error{} FROM evaluation WHERE frame_count = 0 AND diverged = 0 "
                           "ORDER BY id",
                           columns),
               [&](sqlite3_stmt* row) {
                 StoredPoint point{VecX(static_cast<Eigen::Index>(parameters.size())),
                                   sqlite3_column_double(row, 0)};
                 for (Eigen::Index i = 0; i < point.values.size(); ++i)
                   point.values[i] = sqlite3_column_double(row, static_cast<int>(i) + 1);
                 if (std::isfinite(point.error)) points.push_back(std::move(point));
               });
  return points;
}

}  // namespace weft
