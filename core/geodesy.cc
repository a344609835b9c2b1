// SPDX-License-Identifier: BSD-3-Clause
#include "core/geodesy.h"

#include <algorithm>
#include <cmath>

#include "core/so3.h"

namespace adasfm {
namespace {

// WGS 84: semi-major axis and flattening.
constexpr double kA = 6378137.0;
constexpr double kF = 1.0 / 298.257223563;
constexpr double kE2 = kF * (2.0 - kF);
// UTM: scale on the central meridian, false easting and northing.
constexpr double kUtmScale = 0.9996;
constexpr double kUtmEasting = 500000.0;
constexpr double kUtmNorthing = 10000000.0;

// Radius of curvature in the prime vertical.
double PrimeVerticalRadius(double sin_latitude) {
  return kA / std::sqrt(1.0 - kE2 * sin_latitude * sin_latitude);
}

}  // namespace

Eigen::Vector3d EcefFromGeodetic(const GeodeticPosition& position) {
  const double latitude = DegToRad(position.latitude_deg);
  const double longitude = DegToRad(position.longitude_deg);
  const double radius = PrimeVerticalRadius(std::sin(latitude));
  const double across = (radius + position.height_m) * std::cos(latitude);
  return {across * std::cos(longitude), across * std::sin(longitude),
          (radius * (1.0 - kE2) + position.height_m) * std::sin(latitude)};
}

GeodeticPosition GeodeticFromEcef(const Eigen::Vector3d& ecef_m) {
  const double across = ecef_m.head<2>().norm();
  // The reduced latitude; each iteration computes the geodetic one from it.
  double reduced = std::atan2(ecef_m.z(), (1.0 - kF) * across);
  double latitude = 0.0;
  for (int iteration = 0; iteration < 5; ++iteration) {
    const double sin3 = std::pow(std::sin(reduced), 3);
    const double cos3 = std::pow(std::cos(reduced), 3);
    latitude = std::atan2(ecef_m.z() + kE2 / (1.0 - kF) * kA * sin3,
                          across - kE2 * kA * cos3);
    reduced = std::atan2((1.0 - kF) * std::sin(latitude), std::cos(latitude));
  }
  const double sine = std::sin(latitude), cosine = std::cos(latitude);
  // Along the normal, which is well conditioned at the poles too.
  const double height = across * cosine + ecef_m.z() * sine -
                        kA * std::sqrt(1.0 - kE2 * sine * sine);
  return {RadToDeg(latitude), RadToDeg(std::atan2(ecef_m.y(), ecef_m.x())),
          height};
}

EnuFrame::EnuFrame(const GeodeticPosition& origin)
    : origin_(EcefFromGeodetic(origin)) {
  const double latitude = DegToRad(origin.latitude_deg);
  const double longitude = DegToRad(origin.longitude_deg);
  const double sin_lat = std::sin(latitude), cos_lat = std::cos(latitude);
  const double sin_lon = std::sin(longitude), cos_lon = std::cos(longitude);
  ecef_from_enu_ << -sin_lon, -sin_lat * cos_lon, cos_lat * cos_lon,  //
      cos_lon, -sin_lat * sin_lon, cos_lat * sin_lon,                 //
      0.0, cos_lat, sin_lat;
}

UtmZone FindUtmZone(const GeodeticPosition& position) {
  const int number =
      static_cast<int>(std::floor((position.longitude_deg + 180.0) / 6.0)) + 1;
  return {std::clamp(number, 1, 60), position.latitude_deg >= 0.0};
}

std::string UtmEpsgCode(const UtmZone& zone) {
  return "EPSG:" +
         std::to_string((zone.is_north ? 32600 : 32700) + zone.number);
}

Eigen::Vector3d UtmFromGeodetic(const UtmZone& zone,
                                const GeodeticPosition& position) {
  const double n = kF / (2.0 - kF);
  const double n2 = n * n, n3 = n2 * n, n4 = n3 * n;
  const double rectifying_radius =
      kA / (1.0 + n) * (1.0 + n2 / 4.0 + n4 / 64.0 + n4 * n2 / 256.0);
  const double alpha[] = {
      n / 2.0 - 2.0 / 3.0 * n2 + 5.0 / 16.0 * n3 + 41.0 / 180.0 * n4,
      13.0 / 48.0 * n2 - 3.0 / 5.0 * n3 + 557.0 / 1440.0 * n4,
      61.0 / 240.0 * n3 - 103.0 / 140.0 * n4, 49561.0 / 161280.0 * n4};
  const double latitude = DegToRad(position.latitude_deg);
  const double central_deg = 6.0 * zone.number - 183.0;
  const double longitude =
      DegToRad(std::remainder(position.longitude_deg - central_deg, 360.0));
  const double e = std::sqrt(kE2);
  const double sine = std::sin(latitude);
  // tan of the conformal latitude.
  const double t = std::sinh(std::atanh(sine) - e * std::atanh(e * sine));
  const double xi = std::atan2(t, std::cos(longitude));
  const double eta = std::atanh(std::sin(longitude) / std::hypot(1.0, t));
  double northing = xi, easting = eta;
  for (int j = 0; j < 4; ++j) {
    const double k = 2.0 * (j + 1);
    northing += alpha[j] * std::sin(k * xi) * std::cosh(k * eta);
    easting += alpha[j] * std::cos(k * xi) * std::sinh(k * eta);
  }
  const double scale = kUtmScale * rectifying_radius;
  return {kUtmEasting + scale * easting,
          (zone.is_north ? 0.0 : kUtmNorthing) + scale * northing,
          position.height_m};
}

}  // namespace adasfm
