// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/rotation_triples.h"

#include <algorithm>

#include "core/so3.h"

namespace adasfm {
namespace {

Eigen::Quaterniond Directed(const TimedRotation& rotation,
                            timestamp_t from_ns) {
  return rotation.start_ns == from_ns ? rotation.cam2_from_cam1
                                      : rotation.cam2_from_cam1.conjugate();
}

}  // namespace

RotationTriples::RotationTriples(const std::vector<TimedRotation>& rotations) {
  for (const TimedRotation& rotation : rotations) {
    pairs_[{rotation.start_ns, rotation.end_ns}] = &rotation;
    partners_[rotation.start_ns].push_back(rotation.end_ns);
    partners_[rotation.end_ns].push_back(rotation.start_ns);
  }
}

const TimedRotation* RotationTriples::Find(timestamp_t time1_ns,
                                           timestamp_t time2_ns) const {
  const auto it = pairs_.find(std::minmax(time1_ns, time2_ns));
  return it == pairs_.end() ? nullptr : it->second;
}

bool RotationTriples::Closes(const TimedRotation& rotation,
                             double max_angle_rad) const {
  const auto partners = partners_.find(rotation.end_ns);
  if (partners == partners_.end()) return false;
  for (const timestamp_t third_ns : partners->second) {
    const TimedRotation* second = Find(rotation.end_ns, third_ns);
    const TimedRotation* third = Find(rotation.start_ns, third_ns);
    if (third_ns == rotation.start_ns || third == nullptr) continue;
    const Eigen::Quaterniond loop = Directed(*third, third_ns) *
                                    Directed(*second, rotation.end_ns) *
                                    rotation.cam2_from_cam1;
    if (LogSo3(loop).norm() < max_angle_rad) return true;
  }
  return false;
}

}  // namespace adasfm
