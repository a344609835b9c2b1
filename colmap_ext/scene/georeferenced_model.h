// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/geodesy.h"
#include "core/sim3d.h"
#include "core/status.h"

namespace adasfm {

// The frames that a georeferenced model (ENU) is written in.
struct TargetFrame {
  Sim3d target_from_enu;
  std::string description;  // for the user
};

// `frame` is "enu" (of another origin, `enu_origin`), "ecef" or "utm" (the zone
// of the origin). ENU and ECEF are exact. UTM is no rigid frame: the similarity
// is the one that fits its plane at the origin best, off by 1 mm for positions
// 100 m and by 10 cm for positions 1 km away, and stretches heights by the
// plane's scale. An error for another name.
StatusOr<TargetFrame> FindTargetFrame(const std::string& frame,
                                      const GeodeticPosition& origin,
                                      const GeodeticPosition& enu_origin);

}  // namespace adasfm
