// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>

namespace adasfm {

// Positions on the Earth, all on the WGS 84 ellipsoid.
//
// Geodetic: latitude and longitude in degrees (north and east positive), height
// above the ellipsoid in m. ECEF: Earth-centred, Earth-fixed, m. ENU: east,
// north, up in m in the tangent plane of the ellipsoid at an origin. UTM:
// easting and northing in m of a zone, with the unchanged height.
struct GeodeticPosition {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double height_m = 0.0;
};

Eigen::Vector3d EcefFromGeodetic(const GeodeticPosition& position);

// The inverse, exact to less than 1 um from 10 km below the ellipsoid to 10,000
// km above it (Bowring's iteration).
GeodeticPosition GeodeticFromEcef(const Eigen::Vector3d& ecef_m);

// The tangent plane at an origin.
class EnuFrame {
 public:
  explicit EnuFrame(const GeodeticPosition& origin);

  Eigen::Vector3d EnuFromGeodetic(const GeodeticPosition& position) const {
    return ecef_from_enu_.transpose() * (EcefFromGeodetic(position) - origin_);
  }
  GeodeticPosition GeodeticFromEnu(const Eigen::Vector3d& enu_m) const {
    return GeodeticFromEcef(EcefFromEnu(enu_m));
  }
  Eigen::Vector3d EcefFromEnu(const Eigen::Vector3d& enu_m) const {
    return origin_ + ecef_from_enu_ * enu_m;
  }
  // Columns: east, north and up in the ECEF frame.
  const Eigen::Matrix3d& EcefFromEnuRotation() const { return ecef_from_enu_; }

 private:
  Eigen::Vector3d origin_;
  Eigen::Matrix3d ecef_from_enu_;
};

struct UtmZone {
  int number = 0;  // 1 to 60
  bool is_north = true;
};

// The zone by longitude alone. The exceptions around Norway are ignored: the
// plane of a neighbouring zone serves as well.
UtmZone FindUtmZone(const GeodeticPosition& position);

// "EPSG:32632" and the like.
std::string UtmEpsgCode(const UtmZone& zone);

// Easting, northing and height (Krueger's series to the fourth order: less than
// 1 mm within 10 degrees of the central meridian).
Eigen::Vector3d UtmFromGeodetic(const UtmZone& zone,
                                const GeodeticPosition& position);

}  // namespace adasfm
