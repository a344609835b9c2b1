// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_image_times.h"

#include <algorithm>
#include <set>

#include "sensors/io/log_file.h"

namespace adasfm {
namespace {

std::string WithoutFolder(std::string_view path) {
  return std::string(path.substr(path.find_last_of('/') + 1));
}

// EuRoC: "ns,filename", the name possibly with spaces inside.
Status ParseEuroc(const LogFile& file, const LogLine& line, ImageTime* time) {
  Status status = CheckNumFields(file, line, 2, "ns, filename");
  if (status.ok()) status = ParseTime(file, line, &time->timestamp_ns);
  if (!status.ok()) return status;
  time->name = line.fields[1];
  return Status::Ok();
}

Status ParseSpaced(const LogFile& file, const LogLine& line, ImageTime* time) {
  const size_t num_fields = line.fields.size();
  if (num_fields != 2 && num_fields != 3) {
    return file.Error(line.number,
                      "has " + std::to_string(num_fields) +
                          " columns; 'seconds filename' or 'id seconds "
                          "exposure' are expected");
  }
  const size_t time_field = num_fields == 2 ? 0 : 1;
  if (!ParseSeconds(line.fields[time_field], &time->timestamp_ns)) {
    return file.Error(line.number, "column " + std::to_string(time_field + 1) +
                                       " is '" +
                                       std::string(line.fields[time_field]) +
                                       "', not a time in seconds");
  }
  time->name = num_fields == 2 ? WithoutFolder(line.fields[1])
                               : std::string(line.fields[0]) + ".png";
  return Status::Ok();
}

}  // namespace

StatusOr<std::vector<ImageTime>> ReadImageTimes(const std::string& path) {
  StatusOr<LogFile> file_or = LogFile::Read(path);
  if (!file_or.ok()) return file_or.status();
  const LogFile& file = *file_or;
  std::vector<ImageTime> times;
  std::set<std::string> names;
  for (size_t i = 0; i < file.num_lines(); ++i) {
    const LogLine line = file.Line(i);
    ImageTime time;
    const Status status = file.has_commas() ? ParseEuroc(file, line, &time)
                                            : ParseSpaced(file, line, &time);
    if (!status.ok()) return status;
    if (time.name.empty()) {
      return file.Error(line.number, "the image's name is missing");
    }
    if (!names.insert(time.name).second) {
      return file.Error(line.number, "image '" + time.name +
                                         "' has a time already; remove one");
    }
    // Equal times are allowed: cameras of a rig take their images at one time.
    if (!times.empty() && time.timestamp_ns < times.back().timestamp_ns) {
      return file.Error(line.number,
                        "times must increase, and this one is before the line "
                        "above it; sort the file");
    }
    times.push_back(std::move(time));
  }
  return times;
}

bool ParseImageNameTime(const std::string& name, timestamp_t* timestamp_ns) {
  const size_t begin = name.find_last_of('/') + 1;
  const size_t end = std::min(name.size(), name.find('.', begin));
  const std::string_view stem(name.data() + begin, end - begin);
  // Nanoseconds since 1970 (or since a boot minutes ago) have many digits; a
  // frame counter such as 000123 has few.
  if (stem.size() < 12 || stem.size() > 19) return false;
  return ParseNanoseconds(stem, timestamp_ns);
}

}  // namespace adasfm
