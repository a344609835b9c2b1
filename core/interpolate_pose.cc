// SPDX-License-Identifier: BSD-3-Clause
#include "core/interpolate_pose.h"

namespace adasfm {

std::optional<Rigid3d> InterpolatePose(
    const std::vector<OdometryPose>& trajectory, timestamp_t time_ns,
    double max_gap_s) {
  const auto after = FirstNotBefore(trajectory, time_ns);
  if (after == trajectory.end()) return std::nullopt;
  if (after->timestamp_ns == time_ns) return after->world_from_body;
  if (after == trajectory.begin()) return std::nullopt;
  const OdometryPose& before = *(after - 1);
  const double gap_s = SecondsFromNs(after->timestamp_ns - before.timestamp_ns);
  if (gap_s > max_gap_s) return std::nullopt;
  const double share = SecondsFromNs(time_ns - before.timestamp_ns) / gap_s;
  return Rigid3d(before.world_from_body.rotation.slerp(
                     share, after->world_from_body.rotation),
                 (1.0 - share) * before.world_from_body.translation +
                     share * after->world_from_body.translation);
}

}  // namespace adasfm
