// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_nmea.h"

#include <cmath>
#include <optional>

#include "sensors/io/calendar.h"
#include "sensors/io/gnss_fixes.h"

namespace adasfm {
namespace {

constexpr int64_t kDayNs = 86'400 * kSecondNs;
// Sigma of a height that the log does not state.
constexpr double kUnknownHeightSigmaM = 500.0;

// "$GPGGA,...*5B": the checksum is the exclusive or of all between $ and *. A
// sentence without a checksum is accepted.
bool HasValidChecksum(std::string_view sentence) {
  const size_t star = sentence.rfind('*');
  if (star == std::string_view::npos) return true;
  if (sentence.size() < star + 3) return false;
  unsigned sum = 0;
  for (size_t i = 1; i < star; ++i)
    sum ^= static_cast<unsigned char>(sentence[i]);
  unsigned stated = 0;
  for (const char c : sentence.substr(star + 1, 2)) {
    const int digit = c >= '0' && c <= '9'   ? c - '0'
                      : c >= 'A' && c <= 'F' ? c - 'A' + 10
                      : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                             : -1;
    if (digit < 0) return false;
    stated = 16 * stated + digit;
  }
  return stated == sum;
}

// "hhmmss.ss" since midnight.
bool ParseTimeOfDay(std::string_view field, int64_t* time_ns) {
  int64_t hours, minutes;
  timestamp_t seconds_ns;
  if (field.size() < 6 || !ParseInt64(field.substr(0, 2), &hours) ||
      !ParseInt64(field.substr(2, 2), &minutes) ||
      !ParseSeconds(field.substr(4), &seconds_ns) || hours < 0 || hours > 23 ||
      minutes < 0 || minutes > 59 || seconds_ns >= 61 * kSecondNs) {
    return false;
  }
  *time_ns = (hours * 60 + minutes) * 60 * kSecondNs + seconds_ns;
  return true;
}

// "ddmm.mmmm" and the hemisphere.
bool ParseAngle(std::string_view field, std::string_view hemisphere,
                double* angle_deg) {
  double value = 0.0;
  if (!ParseDouble(field, &value) || hemisphere.size() != 1) return false;
  const double degrees = std::floor(value / 100.0);
  *angle_deg = degrees + (value - 100.0 * degrees) / 60.0;
  if (hemisphere == "S" || hemisphere == "W") *angle_deg = -*angle_deg;
  return true;
}

// "ddmmyy"; years from 1980 to 2079.
bool ParseDate(std::string_view field, int64_t* days) {
  int64_t day, month, year;
  if (field.size() != 6 || !ParseInt64(field.substr(0, 2), &day) ||
      !ParseInt64(field.substr(2, 2), &month) ||
      !ParseInt64(field.substr(4, 2), &year) || day < 1 || day > 31 ||
      month < 1 || month > 12) {
    return false;
  }
  *days = DaysSinceEpoch(year < 80 ? 2000 + year : 1900 + year, month, day);
  return true;
}

double NumberOr(std::string_view field, double fallback) {
  double value = 0.0;
  return ParseDouble(field, &value) ? value : fallback;
}

std::vector<std::string_view> SplitFields(std::string_view sentence) {
  sentence = sentence.substr(0, sentence.rfind('*'));
  std::vector<std::string_view> fields;
  while (true) {
    const size_t end = sentence.find(',');
    fields.push_back(sentence.substr(0, end));
    if (end == std::string_view::npos) return fields;
    sentence.remove_prefix(end + 1);
  }
}

// Combines the sentences of an epoch.
class EpochReader {
 public:
  explicit EpochReader(FixCollector* collector) : collector_(collector) {}

  Status Read(const std::vector<std::string_view>& fields, size_t number) {
    const std::string_view name = fields[0];
    if (name.size() != 6) return Status::Ok();
    const std::string_view type = name.substr(3);
    const size_t num_fields = fields.size();
    int64_t time_ns = 0;
    if (num_fields < 2 || !ParseTimeOfDay(fields[1], &time_ns)) {
      return Status::Ok();
    }
    if (type != "GGA" && type != "RMC" && type != "GST" && type != "ZDA") {
      return Status::Ok();
    }
    if (time_ns != time_ns_) {
      const Status status = Flush();
      if (!status.ok()) return status;
      Begin(time_ns, number);
    }
    if (type == "GGA" && num_fields >= 12) ReadGga(fields);
    if (type == "RMC" && num_fields >= 10) ReadRmc(fields);
    if (type == "GST" && num_fields >= 9) {
      sigma_m_ =
          Eigen::Vector3d(NumberOr(fields[7], 0.0), NumberOr(fields[6], 0.0),
                          NumberOr(fields[8], 0.0));
    }
    if (type == "ZDA" && num_fields >= 5) ReadZda(fields);
    return Status::Ok();
  }

  Status Flush() {
    if (!time_ns_.has_value() || !has_sentence_) return Status::Ok();
    has_sentence_ = false;
    if (!has_fix_) {
      collector_->LeaveOut("no fix");
      return Status::Ok();
    }
    if (!days_.has_value()) {
      collector_->LeaveOut("no date yet");
      return Status::Ok();
    }
    fix_.timestamp_ns = *days_ * kDayNs + *time_ns_;
    fix_.sigma_m = sigma_m_;
    if (!has_height_) {
      fix_.height_m = 0.0;
      fix_.sigma_m.z() = kUnknownHeightSigmaM;
    }
    return collector_->Add(fix_, number_);
  }

 private:
  void Begin(int64_t time_ns, size_t number) {
    // Past midnight without a new date yet.
    if (time_ns_.has_value() && days_.has_value() &&
        time_ns < *time_ns_ - kDayNs / 2) {
      ++*days_;
    }
    time_ns_ = time_ns;
    number_ = number;
    fix_ = RawFix();
    sigma_m_.setZero();
    has_fix_ = has_height_ = has_sentence_ = false;
  }

  void ReadGga(const std::vector<std::string_view>& fields) {
    has_sentence_ = true;
    if (NumberOr(fields[6], 0.0) < 1.0 ||
        !ParseAngle(fields[2], fields[3], &fix_.latitude_deg) ||
        !ParseAngle(fields[4], fields[5], &fix_.longitude_deg)) {
      has_fix_ = false;
      return;
    }
    has_fix_ = true;
    fix_.hdop = NumberOr(fields[8], 0.0);
    double altitude = 0.0;
    has_height_ = ParseDouble(fields[9], &altitude);
    fix_.height_m = altitude + NumberOr(fields[11], 0.0);
  }

  void ReadRmc(const std::vector<std::string_view>& fields) {
    has_sentence_ = true;
    int64_t days = 0;
    if (ParseDate(fields[9], &days)) days_ = days;
    if (has_fix_ || fields[2] != "A") return;
    has_fix_ = ParseAngle(fields[3], fields[4], &fix_.latitude_deg) &&
               ParseAngle(fields[5], fields[6], &fix_.longitude_deg);
  }

  void ReadZda(const std::vector<std::string_view>& fields) {
    int64_t day, month, year;
    if (ParseInt64(fields[2], &day) && ParseInt64(fields[3], &month) &&
        ParseInt64(fields[4], &year) && day >= 1 && day <= 31 && month >= 1 &&
        month <= 12 && year >= 1980 && year <= 2200) {
      days_ = DaysSinceEpoch(year, month, day);
    }
  }

  FixCollector* collector_;
  std::optional<int64_t> days_;
  std::optional<int64_t> time_ns_;
  size_t number_ = 0;
  RawFix fix_;
  Eigen::Vector3d sigma_m_ = Eigen::Vector3d::Zero();
  bool has_sentence_ = false;
  bool has_fix_ = false;
  bool has_height_ = false;
};

}  // namespace

bool IsNmea(const LogFile& file) {
  const std::string_view field = file.Line(0).fields[0];
  return field.size() >= 6 && field[0] == '$';
}

StatusOr<GnssLog> ReadNmea(const LogFile& file, const GnssNoise& noise,
                           std::vector<std::string>* warnings) {
  FixCollector collector(file.path(), "line", noise);
  EpochReader reader(&collector);
  for (size_t i = 0; i < file.num_lines(); ++i) {
    const std::string_view sentence = file.Text(i);
    if (sentence.empty() || sentence[0] != '$') {
      collector.LeaveOut("no sentence");
      continue;
    }
    if (!HasValidChecksum(sentence)) {
      collector.LeaveOut("wrong checksum");
      continue;
    }
    const Status status =
        reader.Read(SplitFields(sentence), file.LineNumber(i));
    if (!status.ok()) return status;
  }
  const Status status = reader.Flush();
  if (!status.ok()) return status;
  return collector.Finish(warnings);
}

}  // namespace adasfm
