#include "weft/estimate/sqlite_file.h"

#include <gmock/gmock.h>

#include <fstream>
#include <limits>
#include <vector>

#include "common/temporary_folder.h"
#include "weft/base/error.h"

namespace weft::detail::sqlite_file_test {
namespace {

using ::testing::HasSubstr;

constexpr Schema kSchema{"CREATE TABLE IF NOT EXISTS t (name TEXT PRIMARY KEY, x REAL, n, v BLOB)",
                         2};

std::string message(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

class SqliteFile : public ::testing::Test {
 protected:
  test::TemporaryFolder folder_;
  std::filesystem::path path_ = folder_.path() / "t.sqlite";
};

TEST_F(SqliteFile, GivesBackExactlyWhatWasPutIn) {
  VecX numbers(3);
  numbers << 1.0 / 3, -0.0, std::numeric_limits<double>::infinity();
  {
    const Database database(path_, "store", kSchema);
    Statement insert = database.prepare("INSERT INTO t (name, x, n, v) VALUES (?1, ?2, ?3, ?4)");
    insert.bind(1, std::string_view("a'b"));
    insert.bind(2, 0.1 + 0.2);
    insert.bind(3, -7);
    insert.bind(4, numbers);
    insert.run();
    insert.bind(1, std::string_view("c"));
    insert.bind(4, VecX());
    insert.run();
  }
  const Database database(path_, "store");
  Statement select = database.prepare("SELECT x, n, v FROM t WHERE name = ?1");
  for (int repeat = 0; repeat < 2; ++repeat) {
    int rows = 0;
    select.bind(1, std::string_view("a'b"));
    select.run([&](const Row& row) {
      ++rows;
      EXPECT_EQ(row.number(0), 0.1 + 0.2);
      EXPECT_EQ(row.integer(1), -7);
      EXPECT_EQ(row.numbers(2), numbers);
    });
    EXPECT_EQ(rows, 1);
  }
  select.bind(1, std::string_view("c"));
  select.run([&](const Row& row) { EXPECT_EQ(row.numbers(2).size(), 0); });
}

TEST_F(SqliteFile, AStatementThatAnObserverEndsCanRunAgain) {
  const Database database(path_, "store", kSchema);
  Statement rows = database.prepare("SELECT 1 UNION SELECT 2");
  EXPECT_THROW(rows.run([](const Row&) { throw Error("enough"); }), Error);
  std::vector<std::int64_t> found;
  rows.run([&](const Row& row) { found.push_back(row.integer(0)); });
  EXPECT_EQ(found, (std::vector<std::int64_t>{1, 2}));
}

TEST_F(SqliteFile, SaysWhatIsWrong) {
  EXPECT_THAT(message([&] { Database(path_, "store"); }), HasSubstr("t.sqlite: cannot be opened"));
  EXPECT_THAT(message([&] { Database(folder_.path() / "none" / "t", "store", kSchema); }),
              HasSubstr("cannot be opened"));
  { const Database made(path_, "store", kSchema); }
  EXPECT_THAT(message([&] {
                Database(path_, "store", {kSchema.sql, 3});
              }),
              HasSubstr("version 2 of the store, this program reads version 3"));
  const Database database(path_, "store of hats");
  EXPECT_THAT(message([&] { database.prepare("SELECT hat FROM t"); }),
              HasSubstr("not a store of hats: no such column: hat"));
  Statement insert = database.prepare("INSERT INTO t (name) VALUES ('x')");
  insert.run();
  EXPECT_THAT(message([&] { insert.run(); }), HasSubstr("cannot be written: UNIQUE"));
  Statement broken = database.prepare("SELECT json_extract('{', '$.x')");
  EXPECT_THAT(message([&] { broken.run(); }), HasSubstr("cannot be read: malformed JSON"));

  const auto text = folder_.path() / "text.sqlite";
  std::ofstream(text) << std::string(4096, 'x');
  EXPECT_THAT(message([&] { Database(text, "store", kSchema); }),
              HasSubstr("text.sqlite: not a store"));
}

}  // namespace
}  // namespace weft::detail::sqlite_file_test
