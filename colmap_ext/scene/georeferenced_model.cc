// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/georeferenced_model.h"

#include <vector>

namespace adasfm {
namespace {

// Half the side of the grid of points that UTM is fitted at [m].
constexpr double kFitRadiusM = 100.0;

Sim3d EcefFromEnu(const GeodeticPosition& origin) {
  return Sim3d(1.0, Eigen::Quaterniond(EnuFrame(origin).EcefFromEnuRotation()),
               EcefFromGeodetic(origin));
}

StatusOr<Sim3d> UtmFromEnu(const UtmZone& zone,
                           const GeodeticPosition& origin) {
  const EnuFrame frame(origin);
  std::vector<Eigen::Vector3d> enu, utm;
  for (const double east : {-kFitRadiusM, 0.0, kFitRadiusM}) {
    for (const double north : {-kFitRadiusM, 0.0, kFitRadiusM}) {
      enu.emplace_back(east, north, 0.0);
      utm.push_back(UtmFromGeodetic(zone, frame.GeodeticFromEnu(enu.back())));
    }
  }
  Sim3d utm_from_enu;
  if (!EstimateSim3d(enu, utm, AlignmentOptions(), &utm_from_enu)) {
    return Status::Error("UTM has no plane at this origin");
  }
  return utm_from_enu;
}

}  // namespace

StatusOr<TargetFrame> FindTargetFrame(const std::string& frame,
                                      const GeodeticPosition& origin,
                                      const GeodeticPosition& enu_origin) {
  if (frame == "ecef") {
    return TargetFrame{EcefFromEnu(origin), "ECEF (WGS 84)"};
  }
  if (frame == "enu") {
    return TargetFrame{EcefFromEnu(enu_origin).Inverse() * EcefFromEnu(origin),
                       "east, north, up at the given origin"};
  }
  if (frame == "utm") {
    const UtmZone zone = FindUtmZone(origin);
    const StatusOr<Sim3d> utm_from_enu = UtmFromEnu(zone, origin);
    if (!utm_from_enu.ok()) return utm_from_enu.status();
    return TargetFrame{*utm_from_enu,
                       "UTM zone " + std::to_string(zone.number) +
                           (zone.is_north ? " north" : " south") + ", " +
                           UtmEpsgCode(zone)};
  }
  return Status::Error("frame = " + frame + " must be enu, ecef or utm");
}

}  // namespace adasfm
