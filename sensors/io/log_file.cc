// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/log_file.h"

#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace adasfm {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

bool IsSpace(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view Trim(std::string_view text) {
  while (!text.empty() && IsSpace(text.front())) text.remove_prefix(1);
  while (!text.empty() && IsSpace(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view LineAt(std::string_view text, size_t begin) {
  const size_t end = text.find('\n', begin);
  return Trim(text.substr(begin, end - begin));
}

// A line of (bad) data may begin with "nan" or "inf", but contains digits.
bool IsHeader(std::string_view line) {
  return std::isalpha(static_cast<unsigned char>(line.front())) &&
         line.find_first_of("0123456789") == std::string_view::npos;
}

}  // namespace

StatusOr<LogFile> LogFile::Read(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    return Status::Error(path + ": no such file; check the path");
  }
  if (std::filesystem::is_directory(path, error)) {
    return Status::Error(path + ": is a folder; a file is expected");
  }
  if (!std::filesystem::is_regular_file(path, error)) {
    return Status::Error(path +
                         ": is no regular file (a pipe or a device, or a link "
                         "to itself); a file is expected");
  }
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    return Status::Error(path + ": cannot be opened; check its permissions");
  }
  std::string text((std::istreambuf_iterator<char>(stream)),
                   std::istreambuf_iterator<char>());
  return Parse(path, std::move(text));
}

void SkipByteOrderMark(std::istream* stream) {
  std::string begin(kByteOrderMark.size(), '\0');
  stream->read(begin.data(), begin.size());
  stream->clear();
  if (begin != kByteOrderMark) stream->seekg(0);
}

StatusOr<LogFile> LogFile::Parse(const std::string& path, std::string text) {
  LogFile file;
  file.path_ = path;
  // Editors of Windows begin a text with this mark.
  if (text.compare(0, kByteOrderMark.size(), kByteOrderMark) == 0) {
    text.erase(0, kByteOrderMark.size());
  }
  file.text_ = std::move(text);
  size_t number = 0;
  for (size_t begin = 0; begin < file.text_.size();) {
    ++number;
    const std::string_view line = LineAt(file.text_, begin);
    const bool is_header =
        !line.empty() && file.line_begins_.empty() && IsHeader(line);
    if (!line.empty() && (line.front() == '#' || is_header)) {
      if (file.header_.empty()) {
        file.header_ = Trim(line.substr(is_header ? 0 : 1));
      }
    } else if (!line.empty()) {
      if (file.line_begins_.empty()) {
        file.has_commas_ = line.find(',') != std::string_view::npos;
      }
      file.line_begins_.push_back(begin);
      file.line_numbers_.push_back(number);
    }
    const size_t end = file.text_.find('\n', begin);
    if (end == std::string::npos) break;
    begin = end + 1;
  }
  if (file.line_begins_.empty()) {
    return Status::Error(path + ": holds no data lines; was it exported?");
  }
  return file;
}

std::string_view LogFile::Text(size_t index) const {
  return LineAt(text_, line_begins_[index]);
}

LogLine LogFile::Line(size_t index) const {
  LogLine result;
  result.number = line_numbers_[index];
  std::string_view rest = Text(index);
  while (true) {
    const size_t end = has_commas_ ? rest.find(',') : rest.find_first_of(" \t");
    result.fields.push_back(Trim(rest.substr(0, end)));
    if (end == std::string_view::npos) break;
    rest.remove_prefix(end + 1);
    if (!has_commas_) rest = Trim(rest);
  }
  return result;
}

std::string LogFile::Locate(size_t line_number) const {
  return path_ + ", line " + std::to_string(line_number);
}

Status LogFile::Error(size_t line_number, const std::string& text) const {
  return Status::Error(Locate(line_number) + ": " + text);
}

bool ParseDouble(std::string_view field, double* value) {
  if (!field.empty() && field.front() == '+') field.remove_prefix(1);
  const auto [end, error] =
      std::from_chars(field.data(), field.data() + field.size(), *value);
  return error == std::errc() && end == field.data() + field.size() &&
         std::isfinite(*value);
}

bool ParseInt64(std::string_view field, int64_t* value) {
  const auto [end, error] =
      std::from_chars(field.data(), field.data() + field.size(), *value);
  return error == std::errc() && end == field.data() + field.size();
}

bool ParseNanoseconds(std::string_view field, timestamp_t* timestamp_ns) {
  return ParseInt64(field, timestamp_ns) && *timestamp_ns >= 0;
}

bool ParseSeconds(std::string_view field, timestamp_t* timestamp_ns) {
  const size_t point = field.find('.');
  const std::string_view whole = field.substr(0, point);
  int64_t seconds = 0;
  // An exponent (or a sign) is rare: there a conversion from double is good
  // enough.
  if (field.find_first_of("eE-+") != std::string_view::npos) {
    double value = 0.0;
    if (!ParseDouble(field, &value) || !(value >= 0.0 && value <= 9e9)) {
      return false;
    }
    *timestamp_ns = NsFromSeconds(value);
    return true;
  }
  if (!ParseInt64(whole, &seconds) || seconds > 9'000'000'000) return false;
  int64_t nanoseconds = 0;
  if (point != std::string_view::npos) {
    const std::string_view fraction = field.substr(point + 1);
    int64_t unit = 100'000'000;
    for (const char c : fraction) {
      if (c < '0' || c > '9') return false;
      nanoseconds += (c - '0') * unit;
      unit /= 10;
    }
  }
  *timestamp_ns = seconds * 1'000'000'000 + nanoseconds;
  return true;
}

Status CheckNumFields(const LogFile& file, const LogLine& line,
                      size_t num_fields, const std::string& meaning) {
  if (line.fields.size() == num_fields) return Status::Ok();
  return file.Error(line.number,
                    "has " + std::to_string(line.fields.size()) +
                        " columns where " + std::to_string(num_fields) +
                        " are expected (" + meaning +
                        "); was the file cut off or is it another format?");
}

Status ParseTime(const LogFile& file, const LogLine& line,
                 timestamp_t* timestamp_ns) {
  if (ParseNanoseconds(line.fields[0], timestamp_ns)) return Status::Ok();
  return file.Error(line.number, "column 1 is '" +
                                     std::string(line.fields[0].substr(0, 40)) +
                                     "', not a time in whole nanoseconds");
}

Status ParseNumbers(const LogFile& file, const LogLine& line, size_t first,
                    size_t count, double* values) {
  for (size_t i = 0; i < count; ++i) {
    const std::string_view field = line.fields[first + i];
    if (!ParseDouble(field, &values[i])) {
      return file.Error(line.number,
                        "column " + std::to_string(first + i + 1) + " is '" +
                            std::string(field.substr(0, 40)) +
                            "', not a finite number; drop the line or export "
                            "the log again");
    }
  }
  return Status::Ok();
}

}  // namespace adasfm
