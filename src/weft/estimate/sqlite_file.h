#pragma once
/// What the stores of this module need of SQLite; of no use outside of it.
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "weft/base/types.h"

struct sqlite3;
struct sqlite3_stmt;

namespace weft::detail {

class Database;

/// A row of a result; columns count from 0.
class Row {
 public:
  explicit Row(sqlite3_stmt* statement) : statement_(statement) {}
  double number(int column) const;
  std::int64_t integer(int column) const;
  VecX numbers(int column) const;  ///< of a blob; what is left over of a number is dropped

 private:
  sqlite3_stmt* statement_;
};

/// A prepared statement, to be run any number of times.
class Statement {
 public:
  /// Of the parameter ?`at`, from 1 on; stays until it is bound again.
  void bind(int at, std::string_view text);
  void bind(int at, double number);
  void bind(int at, int number);
  void bind(int at, const VecX& numbers);  ///< as a blob
  /// Calls `each` with every row of the result. Throws Error if the file cannot be read or written.
  void run(const std::function<void(const Row&)>& each = {});

 private:
  friend class Database;
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  Statement(const Database& database, sqlite3_stmt* statement);
  const Database* database_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

/// What a new file gets.
struct Schema {
  const char* sql;  ///< that changes nothing where it was run before
  int version = 0;  ///< > 0: kept in the file; files of another version are refused
};

/// An open file. Its statements must not outlive it.
class Database {
 public:
  /// A file that is there. `what` it should be, for messages: "store of numbers". Throws Error if
  /// it cannot be opened; whether it is an SQLite file shows at the first statement.
  Database(std::filesystem::path path, std::string what);
  /// Opens or creates; each change is on the disk before the next statement. Throws Error if it
  /// cannot be opened or written, or is no such file.
  Database(std::filesystem::path path, std::string what, const Schema& schema);
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// Throws Error if it is no such file.
  Statement prepare(const std::string& sql) const;

 private:
  friend class Statement;
  struct Close {
    void operator()(sqlite3* handle) const;
  };
  void open(int flags);
  /// 0 for a new file. Throws Error if it is another than `expected`.
  std::int64_t version_of_file(int expected) const;
  void execute(const std::string& sql) const;
  [[noreturn]] void fail(const std::string& problem) const;

  std::filesystem::path path_;
  std::string what_;
  std::unique_ptr<sqlite3, Close> handle_;
};

}  // namespace weft::detail
