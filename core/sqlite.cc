// SPDX-License-Identifier: BSD-3-Clause
#include "core/sqlite.h"

#include <sqlite3.h>

#include <cstdio>
#include <filesystem>

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// How long to wait for another process's lock.
constexpr int kBusyTimeoutMs = 10000;

bool IsNonEmptyFile(const std::string& path) {
  std::error_code error;
  const uintmax_t size = fs::file_size(path, error);
  return !error && size > 0;
}

// The path as an SQLite URI, with special characters escaped.
std::string UriFromPath(const std::string& path, const std::string& query) {
  std::string uri = "file:";
  for (const char c : fs::absolute(path).string()) {
    if (c == '%' || c == '?' || c == '#') {
      char code[4];
      std::snprintf(code, sizeof(code), "%%%02X", static_cast<unsigned>(c));
      uri += code;
    } else {
      uri += c;
    }
  }
  return uri + query;
}

sqlite3* Open(const std::string& uri, int flags) {
  sqlite3* handle = nullptr;
  if (sqlite3_open_v2(uri.c_str(), &handle, flags | SQLITE_OPEN_URI, nullptr) ==
      SQLITE_OK) {
    return handle;
  }
  const std::string message = sqlite3_errmsg(handle);
  sqlite3_close_v2(handle);
  throw SqliteError(message);
}

}  // namespace

SqliteConnection::SqliteConnection(const std::string& path, Mode mode)
    : path_(path) {
  if (mode == Mode::kWrite) {
    handle_ = Open(UriFromPath(path, ""), SQLITE_OPEN_READWRITE);
  } else if (IsNonEmptyFile(path + "-wal") ||
             IsNonEmptyFile(path + "-journal")) {
    // Another process is writing, or was killed while it did: SQLite must
    // recover the last committed state, for which it needs to write.
    handle_ = Open(UriFromPath(path, ""), SQLITE_OPEN_READWRITE);
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  } else {
    // Even a connection that only reads would leave -wal and -shm files beside
    // a database in COLMAP's journal mode.
    handle_ = Open(UriFromPath(path, "?immutable=1"), SQLITE_OPEN_READONLY);
  }
  sqlite3_busy_timeout(handle_, kBusyTimeoutMs);
}

SqliteConnection::~SqliteConnection() { sqlite3_close_v2(handle_); }

void SqliteConnection::Execute(const std::string& sql) {
  if (sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr) !=
      SQLITE_OK) {
    throw SqliteError(sqlite3_errmsg(handle_));
  }
}

bool SqliteConnection::HasTable(const std::string& table) {
  SqliteStatement statement(
      this, "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?");
  statement.BindText(1, table);
  return statement.Step();
}

std::vector<std::string> SqliteConnection::Columns(const std::string& table) {
  SqliteStatement statement(this, "SELECT name FROM pragma_table_info(?)");
  statement.BindText(1, table);
  std::vector<std::string> columns;
  while (statement.Step()) columns.push_back(statement.Text(0));
  return columns;
}

SqliteStatement::SqliteStatement(SqliteConnection* connection,
                                 const std::string& sql)
    : connection_(connection) {
  if (sqlite3_prepare_v2(connection->Handle(), sql.c_str(), -1, &handle_,
                         nullptr) != SQLITE_OK) {
    throw SqliteError(sqlite3_errmsg(connection->Handle()));
  }
}

SqliteStatement::~SqliteStatement() { sqlite3_finalize(handle_); }

bool SqliteStatement::Step() {
  const int code = sqlite3_step(handle_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  throw SqliteError(sqlite3_errmsg(connection_->Handle()));
}

void SqliteStatement::Reset() {
  sqlite3_reset(handle_);
  sqlite3_clear_bindings(handle_);
}

void SqliteStatement::CheckBinding(int code) const {
  if (code != SQLITE_OK) {
    throw SqliteError(sqlite3_errmsg(connection_->Handle()));
  }
}

void SqliteStatement::BindInt(int parameter, int64_t value) {
  CheckBinding(sqlite3_bind_int64(handle_, parameter, value));
}

void SqliteStatement::BindDouble(int parameter, double value) {
  CheckBinding(sqlite3_bind_double(handle_, parameter, value));
}

void SqliteStatement::BindText(int parameter, const std::string& value) {
  CheckBinding(sqlite3_bind_text(handle_, parameter, value.data(), value.size(),
                                 SQLITE_TRANSIENT));
}

void SqliteStatement::BindBlob(int parameter, const void* data,
                               size_t num_bytes) {
  // A null pointer would become NULL, which is not an empty blob.
  CheckBinding(sqlite3_bind_blob64(handle_, parameter,
                                   num_bytes == 0 ? "" : data, num_bytes,
                                   SQLITE_TRANSIENT));
}

void SqliteStatement::BindValue(int parameter, const SqliteValue& value) {
  if (const auto* integer = std::get_if<int64_t>(&value)) {
    BindInt(parameter, *integer);
  } else if (const auto* real = std::get_if<double>(&value)) {
    CheckBinding(sqlite3_bind_double(handle_, parameter, *real));
  } else if (const auto* text = std::get_if<std::string>(&value)) {
    BindText(parameter, *text);
  } else if (const auto* blob = std::get_if<std::vector<char>>(&value)) {
    BindBlob(parameter, blob->data(), blob->size());
  } else {
    CheckBinding(sqlite3_bind_null(handle_, parameter));
  }
}

bool SqliteStatement::IsNull(int column) const {
  return sqlite3_column_type(handle_, column) == SQLITE_NULL;
}

int64_t SqliteStatement::Int(int column) const {
  return sqlite3_column_int64(handle_, column);
}

double SqliteStatement::Double(int column) const {
  return sqlite3_column_double(handle_, column);
}

std::string SqliteStatement::Text(int column) const {
  const unsigned char* text = sqlite3_column_text(handle_, column);
  if (text == nullptr) return "";
  return std::string(reinterpret_cast<const char*>(text),
                     sqlite3_column_bytes(handle_, column));
}

const void* SqliteStatement::Blob(int column) const {
  return sqlite3_column_blob(handle_, column);
}

size_t SqliteStatement::NumBytes(int column) const {
  return sqlite3_column_bytes(handle_, column);
}

SqliteValue SqliteStatement::Value(int column) const {
  switch (sqlite3_column_type(handle_, column)) {
    case SQLITE_INTEGER:
      return Int(column);
    case SQLITE_FLOAT:
      return Double(column);
    case SQLITE_TEXT:
      return Text(column);
    case SQLITE_BLOB: {
      const char* data = static_cast<const char*>(Blob(column));
      return std::vector<char>(data, data + NumBytes(column));
    }
    default:
      return std::monostate();
  }
}

SqliteTransaction::SqliteTransaction(SqliteConnection* connection)
    : connection_(connection) {
  connection_->Execute("BEGIN IMMEDIATE");
}

SqliteTransaction::~SqliteTransaction() {
  if (!open_) return;
  try {
    connection_->Execute("ROLLBACK");
  } catch (const SqliteError&) {
    // SQLite has rolled back already, or does so when the file is next opened.
  }
}

void SqliteTransaction::Commit() {
  connection_->Execute("COMMIT");
  open_ = false;
}

}  // namespace adasfm
