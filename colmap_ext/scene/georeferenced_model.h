// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/geodesy.h"
#include "core/sim3d.h"
#include "core/status.h"

namespace adasfm {

// A frame in which a georeferenced model (ENU) can be written.
struct TargetFrame {
  Sim3d target_from_enu;
  std::string description;  // for the user
};

// `frame` is "enu" (with another origin, `enu_origin`), "ecef" or "utm" (the
// zone of the origin). ENU and ECEF are exact. UTM is no rigid frame: the
// similarity is fitted to its plane at the origin. Its error is 1 mm for
// positions 100 m away and 10 cm for positions 1 km away, and it scales heights
// by the plane's scale. An error for another name.
StatusOr<TargetFrame> FindTargetFrame(const std::string& frame,
                                      const GeodeticPosition& origin,
                                      const GeodeticPosition& enu_origin);

}  // namespace adasfm
