// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "sensors/io/log_checks.h"
#include "sensors/io/read_gnss.h"

namespace adasfm {

// One position as a log states it; absent values are not finite.
struct RawFix {
  timestamp_t timestamp_ns = 0;
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double height_m = 0.0;
  // East, north, up; 0 and less: not stated.
  Eigen::Vector3d sigma_m = Eigen::Vector3d::Zero();
  // Replaces absent sigmas; 0: not stated.
  double hdop = 0.0;
  // Replaces sigmas and hdop.
  std::optional<Eigen::Matrix3d> covariance;
};

// Collects the usable fixes of a log. Unusable fixes (NaN; no fix, at 0, 0; a
// sigma beyond 1 km) are left out and counted; swapped columns are an error;
// absent sigmas are completed.
class FixCollector {
 public:
  FixCollector(const std::string& path, const char* unit,
               const GnssNoise& noise);

  // `number`: of the fix's line, from 1.
  Status Add(const RawFix& fix, size_t number);
  void LeaveOut(const std::string& reason) { ++log_.num_left_out[reason]; }
  // The log; an error without a fix or for times that do not increase.
  StatusOr<GnssLog> Finish(std::vector<std::string>* warnings);

 private:
  GnssNoise noise_;
  LogOrigin origin_;
  GnssLog log_;
};

}  // namespace adasfm
