// SPDX-License-Identifier: BSD-3-Clause
// Both text formats of positions: CSV and NMEA.
#include <Eigen/Cholesky>
#include <cmath>

#include "memory_file.h"
#include "sensors/io/read_gnss.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  const MemoryFile file(data, size);
  std::vector<std::string> warnings;
  const StatusOr<GnssLog> log = ReadGnss(file.path(), GnssNoise(), &warnings);
  if (!log.ok()) {
    Require(!log.status().message().empty());
    Require(log.status().message().find('\n') == std::string::npos);
    return 0;
  }
  RequireAscending(StatusOr<std::vector<GnssFix>>(log->fixes));
  for (const GnssFix& fix : log->fixes) {
    Require(std::abs(fix.position.latitude_deg) <= 90.0);
    Require(std::isfinite(fix.position.longitude_deg));
    Require(std::isfinite(fix.position.height_m));
    Require(fix.covariance.allFinite());
    Require(Eigen::LLT<Eigen::Matrix3d>(fix.covariance).info() ==
            Eigen::Success);
  }
  return 0;
}
