// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

struct sqlite3;
struct sqlite3_stmt;

namespace adasfm {

// An error of a database, with SQLite's message. Functions that return a Status
// catch it.
class SqliteError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

// A connection that can read a database without changing it. COLMAP's own
// connection creates missing tables and converts the file when it opens one.
class SqliteConnection {
 public:
  enum class Mode { kRead, kWrite };

  // The file must exist. With kRead nothing is written and no side files are
  // left behind, unless there is a -wal or -journal file: then SQLite must
  // write to recover the last committed state.
  SqliteConnection(const std::string& path, Mode mode);
  ~SqliteConnection();
  SqliteConnection(const SqliteConnection&) = delete;
  SqliteConnection& operator=(const SqliteConnection&) = delete;

  void Execute(const std::string& sql);
  bool HasTable(const std::string& table);
  // The column names of a table; empty when there is no such table.
  std::vector<std::string> Columns(const std::string& table);

  sqlite3* Handle() const { return handle_; }
  const std::string& Path() const { return path_; }

 private:
  std::string path_;
  sqlite3* handle_ = nullptr;
};

// A value of a row with its stored type: NULL, integer, real, text or blob.
using SqliteValue = std::variant<std::monostate, int64_t, double, std::string,
                                 std::vector<char>>;

// A prepared statement; columns count from 0, parameters from 1.
class SqliteStatement {
 public:
  SqliteStatement(SqliteConnection* connection, const std::string& sql);
  ~SqliteStatement();
  SqliteStatement(const SqliteStatement&) = delete;
  SqliteStatement& operator=(const SqliteStatement&) = delete;

  // True when a row is available.
  bool Step();
  // Makes the statement ready for new parameters.
  void Reset();

  void BindInt(int parameter, int64_t value);
  void BindDouble(int parameter, double value);
  void BindText(int parameter, const std::string& value);
  void BindBlob(int parameter, const void* data, size_t num_bytes);
  void BindValue(int parameter, const SqliteValue& value);

  bool IsNull(int column) const;
  int64_t Int(int column) const;
  double Double(int column) const;
  std::string Text(int column) const;
  // Valid until the next step.
  const void* Blob(int column) const;
  size_t NumBytes(int column) const;
  SqliteValue Value(int column) const;

 private:
  void CheckBinding(int code) const;

  SqliteConnection* connection_;
  sqlite3_stmt* handle_ = nullptr;
};

// All changes between construction and Commit() take effect, or none.
class SqliteTransaction {
 public:
  explicit SqliteTransaction(SqliteConnection* connection);
  ~SqliteTransaction();
  SqliteTransaction(const SqliteTransaction&) = delete;
  SqliteTransaction& operator=(const SqliteTransaction&) = delete;

  void Commit();

 private:
  SqliteConnection* connection_;
  bool open_ = true;
};

}  // namespace adasfm
