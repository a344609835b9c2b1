// SPDX-License-Identifier: BSD-3-Clause
#include "core/geodesy.h"

#include <gtest/gtest.h>

#include "core/random.h"

namespace adasfm {
namespace {

TEST(Geodesy, MatchesPublishedPoints) {
  EXPECT_LT(
      (EcefFromGeodetic({0.0, 0.0, 0.0}) - Eigen::Vector3d(6378137.0, 0.0, 0.0))
          .norm(),
      1e-9);
  // The semi-minor axis of WGS 84.
  EXPECT_LT((EcefFromGeodetic({90.0, 0.0, 0.0}) -
             Eigen::Vector3d(0.0, 0.0, 6356752.314245))
                .norm(),
            1e-6);
  // From the documentation of PROJ, cartesian coordinates on WGS 84.
  EXPECT_LT((EcefFromGeodetic({45.3935192042, 17.7562015132, 133.12}) -
             Eigen::Vector3d(4272922.1553, 1368283.0597, 4518261.3501))
                .norm(),
            5e-4);
}

TEST(Geodesy, UtmMatchesPublishedPoints) {
  // From the documentation of PROJ: 12 E, 55 N in zone 32.
  const GeodeticPosition position{55.0, 12.0, 7.0};
  const Eigen::Vector3d utm = UtmFromGeodetic({32, true}, position);
  EXPECT_NEAR(utm.x(), 691875.6321, 1e-3);
  EXPECT_NEAR(utm.y(), 6098907.8250, 1e-3);
  EXPECT_EQ(utm.z(), 7.0);
  EXPECT_EQ(FindUtmZone(position).number, 33);
  EXPECT_EQ(UtmEpsgCode({32, true}), "EPSG:32632");
  // South of the equator northings fall from 10,000 km.
  const Eigen::Vector3d south = UtmFromGeodetic({56, false}, {-33.0, 153.0, 0});
  EXPECT_NEAR(south.x(), 500000.0, 1e-6);
  const Eigen::Vector3d north = UtmFromGeodetic({56, true}, {33.0, 153.0, 0});
  EXPECT_NEAR(south.y() + north.y(), 1e7, 1e-6);
}

TEST(Geodesy, ConversionsInvertEachOther) {
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const GeodeticPosition position{random.Uniform(-90.0, 90.0),
                                    random.Uniform(-180.0, 180.0),
                                    random.Uniform(-1e4, 1e6)};
    const Eigen::Vector3d ecef = EcefFromGeodetic(position);
    const GeodeticPosition back = GeodeticFromEcef(ecef);
    EXPECT_LT((EcefFromGeodetic(back) - ecef).norm(), 1e-6);
    EXPECT_NEAR(back.height_m, position.height_m, 1e-6);
  }
}

TEST(Geodesy, TangentPlaneHasEastNorthAndUp) {
  for (const double latitude : {-80.0, -33.0, 0.0, 48.0, 89.0}) {
    const GeodeticPosition origin{latitude, 11.0, 500.0};
    const EnuFrame frame(origin);
    EXPECT_LT(frame.EnuFromGeodetic(origin).norm(), 1e-8);
    const Eigen::Vector3d up = frame.EnuFromGeodetic({latitude, 11.0, 510.0});
    EXPECT_LT((up - Eigen::Vector3d(0.0, 0.0, 10.0)).norm(), 1e-6);
    const Eigen::Vector3d east =
        frame.EnuFromGeodetic({latitude, 11.0001, 500.0});
    EXPECT_GT(east.x(), 0.0);
    EXPECT_LT(std::abs(east.y()) + std::abs(east.z()), 1e-3);
    const Eigen::Vector3d north =
        frame.EnuFromGeodetic({latitude + 1e-4, 11.0, 500.0});
    EXPECT_NEAR(north.y(), 11.1, 0.1);
    EXPECT_NEAR(frame.GeodeticFromEnu(north).latitude_deg, latitude + 1e-4,
                1e-9);
  }
}

}  // namespace
}  // namespace adasfm
