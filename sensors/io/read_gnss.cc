// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_gnss.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <limits>

#include "sensors/io/gnss_fixes.h"
#include "sensors/io/log_file.h"
#include "sensors/io/read_bag.h"
#include "sensors/io/read_kitti_oxts.h"
#include "sensors/io/read_nmea.h"

namespace adasfm {
namespace {

constexpr char kExpectedHeader[] =
    "'#timestamp [ns],latitude [deg],longitude [deg],altitude [m]', then "
    "'sigma_east [m],sigma_north [m],sigma_up [m]', "
    "'sigma_horizontal [m],sigma_vertical [m]', 'hdop', "
    "'cov_ee,cov_en,cov_eu,cov_nn,cov_nu,cov_uu' or nothing";

enum class Column {
  kTime,
  kLatitude,
  kLongitude,
  kHeight,
  kSigmaEast,
  kSigmaNorth,
  kSigmaUp,
  kSigmaHorizontal,
  kHdop,
  kCovariance,  // and five more
  kEnd = kCovariance + 6
};

// Names that loggers use, in lower case and without a unit.
const std::map<std::string, int>& ColumnNames() {
  static const auto* const kNames = new std::map<std::string, int>{
      {"timestamp", static_cast<int>(Column::kTime)},
      {"time", static_cast<int>(Column::kTime)},
      {"lat", static_cast<int>(Column::kLatitude)},
      {"latitude", static_cast<int>(Column::kLatitude)},
      {"lon", static_cast<int>(Column::kLongitude)},
      {"lng", static_cast<int>(Column::kLongitude)},
      {"longitude", static_cast<int>(Column::kLongitude)},
      {"alt", static_cast<int>(Column::kHeight)},
      {"altitude", static_cast<int>(Column::kHeight)},
      {"height", static_cast<int>(Column::kHeight)},
      {"sigma_east", static_cast<int>(Column::kSigmaEast)},
      {"sigma_north", static_cast<int>(Column::kSigmaNorth)},
      {"sigma_up", static_cast<int>(Column::kSigmaUp)},
      {"sigma_vertical", static_cast<int>(Column::kSigmaUp)},
      {"sigma_horizontal", static_cast<int>(Column::kSigmaHorizontal)},
      {"hdop", static_cast<int>(Column::kHdop)},
      {"cov_ee", static_cast<int>(Column::kCovariance)},
      {"cov_en", static_cast<int>(Column::kCovariance) + 1},
      {"cov_eu", static_cast<int>(Column::kCovariance) + 2},
      {"cov_nn", static_cast<int>(Column::kCovariance) + 3},
      {"cov_nu", static_cast<int>(Column::kCovariance) + 4},
      {"cov_uu", static_cast<int>(Column::kCovariance) + 5}};
  return *kNames;
}

std::string FixColumnName(std::string_view text) {
  std::string name;
  for (const char c : text) {
    if (c == '[' || c == '(') break;
    if (std::isspace(static_cast<unsigned char>(c))) {
      if (name.empty()) continue;
      break;
    }
    name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return name;
}

// The field of each column; -1 where the log has none.
using ColumnFields = std::vector<int>;

StatusOr<ColumnFields> FindColumns(const LogFile& file, size_t* num_fields) {
  ColumnFields fields(static_cast<int>(Column::kEnd), -1);
  std::string_view header = file.header();
  *num_fields = 0;
  while (!header.empty()) {
    const size_t end = header.find(',');
    const auto name = ColumnNames().find(FixColumnName(header.substr(0, end)));
    if (name != ColumnNames().end()) fields[name->second] = *num_fields;
    ++*num_fields;
    if (end == std::string_view::npos) break;
    header.remove_prefix(end + 1);
  }
  for (int column = 0; column <= static_cast<int>(Column::kHeight); ++column) {
    if (fields[column] >= 0) continue;
    return Status::Error(file.path() + ", line 1: the header '" +
                         file.header().substr(0, 120) +
                         "' does not name time, latitude, longitude and "
                         "altitude; expected are " +
                         kExpectedHeader);
  }
  return fields;
}

// NaN for an empty field, "nan" and "null".
bool ParseFieldOrNan(std::string_view field, double* value) {
  std::string word;
  for (const char c : field)
    word += std::tolower(static_cast<unsigned char>(c));
  if (word.empty() || word == "nan" || word == "-nan" || word == "null") {
    *value = std::numeric_limits<double>::quiet_NaN();
    return true;
  }
  return ParseDouble(field, value);
}

void TakeSigmas(const ColumnFields& fields, const std::vector<double>& values,
                RawFix* fix) {
  const auto value = [&](Column column, double fallback) {
    const int field = fields[static_cast<int>(column)];
    return field < 0 ? fallback : values[field];
  };
  const double horizontal = value(Column::kSigmaHorizontal, 0.0);
  fix->sigma_m << value(Column::kSigmaEast, horizontal),
      value(Column::kSigmaNorth, horizontal), value(Column::kSigmaUp, 0.0);
  fix->hdop = value(Column::kHdop, 0.0);
  const int first = static_cast<int>(Column::kCovariance);
  if (std::count(fields.begin() + first, fields.end(), -1) > 0) return;
  Eigen::Matrix3d covariance;
  int k = first;
  for (int row = 0; row < 3; ++row) {
    for (int column = row; column < 3; ++column, ++k) {
      covariance(row, column) = covariance(column, row) = values[fields[k]];
    }
  }
  fix->covariance = covariance;
}

StatusOr<GnssLog> ReadCsv(const LogFile& file, const GnssNoise& noise,
                          std::vector<std::string>* warnings) {
  size_t num_fields = 0;
  const StatusOr<ColumnFields> fields = FindColumns(file, &num_fields);
  if (!fields.ok()) return fields.status();
  FixCollector collector(file.path(), "line", noise);
  std::vector<double> values(num_fields);
  for (size_t i = 0; i < file.num_lines(); ++i) {
    const LogLine line = file.Line(i);
    Status status =
        CheckNumFields(file, line, num_fields, "as its header says");
    if (!status.ok()) return status;
    RawFix fix;
    const size_t time_field = (*fields)[static_cast<int>(Column::kTime)];
    if (!ParseNanoseconds(line.fields[time_field], &fix.timestamp_ns)) {
      return file.Error(line.number,
                        "the time '" +
                            std::string(line.fields[time_field].substr(0, 40)) +
                            "' is not in whole nanoseconds");
    }
    for (const int field : *fields) {
      if (field < 0 || field == static_cast<int>(time_field)) continue;
      if (ParseFieldOrNan(line.fields[field], &values[field])) continue;
      return file.Error(line.number,
                        "column " + std::to_string(field + 1) + " is '" +
                            std::string(line.fields[field].substr(0, 40)) +
                            "', not a number");
    }
    fix.latitude_deg = values[(*fields)[static_cast<int>(Column::kLatitude)]];
    fix.longitude_deg = values[(*fields)[static_cast<int>(Column::kLongitude)]];
    fix.height_m = values[(*fields)[static_cast<int>(Column::kHeight)]];
    TakeSigmas(*fields, values, &fix);
    status = collector.Add(fix, line.number);
    if (!status.ok()) return status;
  }
  return collector.Finish(warnings);
}

StatusOr<GnssLog> ReadBag(const std::string& path, const GnssNoise& noise,
                          std::vector<std::string>* warnings) {
  const StatusOr<std::vector<RosNavSatFix>> messages =
      ReadBagGnss(path, warnings);
  if (!messages.ok()) return messages.status();
  FixCollector collector(path, "message", noise);
  for (size_t i = 0; i < messages->size(); ++i) {
    const RosNavSatFix& message = (*messages)[i];
    RawFix fix;
    fix.timestamp_ns = message.header.stamp_ns;
    fix.latitude_deg = message.latitude;
    fix.longitude_deg = message.longitude;
    fix.height_m = message.altitude;
    if (message.covariance_type != 0) {
      fix.covariance =
          Eigen::Map<const Eigen::Matrix3d>(message.position_covariance.data());
    }
    const Status status = collector.Add(fix, i + 1);
    if (!status.ok()) return status;
  }
  return collector.Finish(warnings);
}

StatusOr<GnssLog> ReadOxts(const std::string& folder, const GnssNoise& noise,
                           std::vector<std::string>* warnings) {
  const StatusOr<std::vector<KittiOxtsFix>> packets =
      ReadKittiOxtsFixes(folder);
  if (!packets.ok()) return packets.status();
  FixCollector collector(folder, "packet", noise);
  for (size_t i = 0; i < packets->size(); ++i) {
    const KittiOxtsFix& packet = (*packets)[i];
    RawFix fix;
    fix.timestamp_ns = packet.timestamp_ns;
    fix.latitude_deg = packet.latitude_deg;
    fix.longitude_deg = packet.longitude_deg;
    fix.height_m = packet.height_m;
    fix.sigma_m.setConstant(packet.sigma_m);
    const Status status = collector.Add(fix, i + 1);
    if (!status.ok()) return status;
  }
  return collector.Finish(warnings);
}

}  // namespace

StatusOr<GnssLog> ReadGnss(const std::string& path, const GnssNoise& noise,
                           std::vector<std::string>* warnings) {
  if (IsBagPath(path)) return ReadBag(path, noise, warnings);
  std::error_code none;
  if (std::filesystem::is_directory(path, none)) {
    return ReadOxts(path, noise, warnings);
  }
  const StatusOr<LogFile> file = LogFile::Read(path);
  if (!file.ok()) return file.status();
  if (IsNmea(*file)) return ReadNmea(*file, noise, warnings);
  return ReadCsv(*file, noise, warnings);
}

}  // namespace adasfm
