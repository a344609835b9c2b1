// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>

#include "core/status.h"
#include "core/types.h"
#include "global/odometry/odometry_chain.h"

namespace adasfm {

struct OdometryGateOptions {
  // Otherwise all pairs may overlap.
  bool enabled = true;
  // Images further apart show nothing in common. SIFT on photos of a street
  // (kitti07-160): 30 to 50 m apart 98 % of the pairs verify, with 34 matches,
  // 50 to 100 m apart 2 %.
  double max_distance_m = 50.0;
  // Odometry: its errors besides those of the priors.
  OdometryChainOptions chain;

  bool IsValid(std::string* error) const;
};

// Which images can show the same place, by the priors in the database.
// Inputs: relative pose priors with covariance, and the cameras' fields of
// view.
// Method: the chain of priors gives the motion between two images and its
// covariance. A pair is excluded when, 3 sigma of the odometry granted, the
// images are further apart than max_distance_m, or look so far apart that no
// point is in both fields of view at less than 60 degrees between its rays,
// which is more than SIFT bears.
// Images that no chain of priors connects, and parts of the motion that the
// sensors do not observe, exclude nothing.
class OdometryGate {
 public:
  // Excludes nothing.
  OdometryGate() = default;

  // An error for a database or priors that cannot be read. Without priors
  // nothing is excluded.
  static StatusOr<OdometryGate> Read(const OdometryGateOptions& options,
                                     const std::string& database_path);

  bool MayOverlap(image_t image_id1, image_t image_id2) const;
  // Whether some pair can be excluded.
  bool HasOdometry() const { return !chain_.empty(); }

 private:
  OdometryGateOptions options_;
  OdometryChain chain_;
  // The greatest angle between the optical axis and a ray of the image [rad].
  std::map<image_t, double> half_fields_of_view_;
};

}  // namespace adasfm
