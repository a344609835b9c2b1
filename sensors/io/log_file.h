// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <istream>
#include <string>
#include <string_view>
#include <vector>

#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// One line of a log that carries data, cut into fields.
struct LogLine {
  size_t number = 0;  // from 1, as editors count
  std::vector<std::string_view> fields;
};

// Skips the byte order mark with which editors of Windows begin a text, if
// there is one. The stream is at its begin.
void SkipByteOrderMark(std::istream* stream);

// A text log in memory. Fields are separated by commas when the first data line
// has any, else by white space. '#' begins a comment line; lines before the
// data that begin with a letter and have no digit are headers. Lines may end in
// LF or CR LF.
class LogFile {
 public:
  // An error for a missing, unreadable or empty file (no data line).
  static StatusOr<LogFile> Read(const std::string& path);
  // The same for a text that is already in memory; path is for messages.
  static StatusOr<LogFile> Parse(const std::string& path, std::string text);

  const std::string& path() const { return path_; }
  // The first comment or header line, without its '#'; empty without one.
  const std::string& header() const { return header_; }
  bool has_commas() const { return has_commas_; }
  size_t num_lines() const { return line_begins_.size(); }
  LogLine Line(size_t index) const;
  // The same line in one piece, without white space around it.
  std::string_view Text(size_t index) const;
  size_t LineNumber(size_t index) const { return line_numbers_[index]; }

  // "path, line 7: text".
  Status Error(size_t line_number, const std::string& text) const;
  std::string Locate(size_t line_number) const;

 private:
  std::string path_;
  std::string header_;
  std::string text_;
  bool has_commas_ = false;
  // Of the data lines.
  std::vector<size_t> line_begins_;
  std::vector<size_t> line_numbers_;
};

// Locale-independent; the whole field must be a finite number.
bool ParseDouble(std::string_view field, double* value);
bool ParseInt64(std::string_view field, int64_t* value);
// Whole nanoseconds; never negative, so that differences cannot overflow.
bool ParseNanoseconds(std::string_view field, timestamp_t* timestamp_ns);
// Decimal seconds to nanoseconds without a detour over double: "1600000003.25"
// keeps all its digits. False when negative or beyond the range of int64.
bool ParseSeconds(std::string_view field, timestamp_t* timestamp_ns);

// An error when the number of fields is wrong, with both numbers.
Status CheckNumFields(const LogFile& file, const LogLine& line,
                      size_t num_fields, const std::string& meaning);

// The first field as whole nanoseconds.
Status ParseTime(const LogFile& file, const LogLine& line,
                 timestamp_t* timestamp_ns);

// Parses count fields from first on as numbers; an error names the field.
Status ParseNumbers(const LogFile& file, const LogLine& line, size_t first,
                    size_t count, double* values);

}  // namespace adasfm
