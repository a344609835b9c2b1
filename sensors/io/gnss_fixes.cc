// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/gnss_fixes.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <sstream>
#include <utility>

namespace adasfm {
namespace {

// No receiver has a smaller error, and positions with a larger one are useless.
constexpr double kMinSigmaM = 1e-3;
constexpr double kMaxSigmaM = 1e3;
// No camera drives or flies higher; larger heights are in mm or garbage.
constexpr double kMaxHeightM = 1e5;
constexpr char kNotANumber[] = "not a number";
constexpr char kNoFix[] = "no fix (0, 0)";
constexpr char kPoorFix[] = "sigma beyond 1 km";

bool IsCovariance(const Eigen::Matrix3d& covariance) {
  if (!covariance.allFinite()) return false;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  return solver.eigenvalues()(0) >= 0.0 && covariance.trace() > 0.0;
}

Eigen::Matrix3d CovarianceOf(const RawFix& fix, const GnssNoise& noise) {
  if (fix.covariance.has_value() && IsCovariance(*fix.covariance)) {
    return *fix.covariance +
           kMinSigmaM * kMinSigmaM * Eigen::Matrix3d::Identity();
  }
  const double dilution =
      std::isfinite(fix.hdop) && fix.hdop > 0.0 ? fix.hdop : 1.0;
  const double stated[] = {dilution * noise.horizontal_m,
                           dilution * noise.horizontal_m,
                           dilution * noise.vertical_m};
  Eigen::Vector3d sigmas;
  for (int i = 0; i < 3; ++i) {
    const double sigma = fix.sigma_m(i);
    sigmas(i) = std::isfinite(sigma) && sigma > 0.0 ? sigma : stated[i];
    sigmas(i) = std::max(kMinSigmaM, sigmas(i));
  }
  return sigmas.cwiseAbs2().asDiagonal();
}

}  // namespace

FixCollector::FixCollector(const std::string& path, const char* unit,
                           const GnssNoise& noise)
    : noise_(noise) {
  origin_.path = path;
  origin_.unit = unit;
}

Status FixCollector::Add(const RawFix& raw, size_t number) {
  const auto error = [&](const std::string& text) {
    return Status::Error(origin_.path + ", " + origin_.unit + " " +
                         std::to_string(number) + ": " + text);
  };
  if (!std::isfinite(raw.latitude_deg) || !std::isfinite(raw.longitude_deg) ||
      !std::isfinite(raw.height_m)) {
    LeaveOut(kNotANumber);
    return Status::Ok();
  }
  // Receivers write 0, 0 before they have a fix.
  if (std::abs(raw.latitude_deg) < 1e-6 && std::abs(raw.longitude_deg) < 1e-6) {
    LeaveOut(kNoFix);
    return Status::Ok();
  }
  std::ostringstream value;
  value.precision(9);
  if (std::abs(raw.latitude_deg) > 90.0) {
    value << "a latitude of " << raw.latitude_deg << " deg; "
          << (std::abs(raw.longitude_deg) <= 90.0
                  ? "latitude and longitude seem to be swapped"
                  : "degrees are expected, not metres nor radians");
    return error(value.str());
  }
  if (std::abs(raw.longitude_deg) > 360.0) {
    value << "a longitude of " << raw.longitude_deg
          << " deg; degrees are expected, not metres";
    return error(value.str());
  }
  if (std::abs(raw.height_m) > kMaxHeightM) {
    value << "an altitude of " << raw.height_m << " m; metres are expected";
    return error(value.str());
  }
  GnssFix fix;
  fix.timestamp_ns = raw.timestamp_ns;
  fix.position = {raw.latitude_deg, std::remainder(raw.longitude_deg, 360.0),
                  raw.height_m};
  fix.covariance = CovarianceOf(raw, noise_);
  if (fix.covariance.trace() > 3.0 * kMaxSigmaM * kMaxSigmaM) {
    LeaveOut(kPoorFix);
    return Status::Ok();
  }
  log_.fixes.push_back(fix);
  origin_.line_numbers.push_back(number);
  return Status::Ok();
}

StatusOr<GnssLog> FixCollector::Finish(std::vector<std::string>* warnings) {
  if (log_.fixes.empty()) {
    std::string reasons;
    for (const auto& [reason, count] : log_.num_left_out) {
      reasons += (reasons.empty() ? ": " : ", ") + std::to_string(count) +
                 " with " + reason;
    }
    return Status::Error(origin_.path + ": no " + origin_.unit +
                         " has a position" + reasons);
  }
  std::vector<timestamp_t> times;
  for (const GnssFix& fix : log_.fixes) times.push_back(fix.timestamp_ns);
  const Status status = CheckLogTimes(times, origin_, warnings);
  if (!status.ok()) return status;
  return std::move(log_);
}

}  // namespace adasfm
