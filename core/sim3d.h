// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "core/rigid3d.h"

namespace adasfm {

// A similarity, named target_from_source:
// x_in_target = scale * rotation * x_in_source + translation.
struct Sim3d {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Sim3d() = default;
  Sim3d(double scale, const Eigen::Quaterniond& rotation,
        const Eigen::Vector3d& translation)
      : scale(scale),
        rotation(rotation.normalized()),
        translation(translation) {}

  Sim3d Inverse() const {
    const Eigen::Quaterniond inverse_rotation = rotation.conjugate();
    return Sim3d(1.0 / scale, inverse_rotation,
                 inverse_rotation * translation / -scale);
  }
};

inline Eigen::Vector3d operator*(const Sim3d& target_from_source,
                                 const Eigen::Vector3d& x_in_source) {
  return target_from_source.scale *
             (target_from_source.rotation * x_in_source) +
         target_from_source.translation;
}

inline Sim3d operator*(const Sim3d& c_from_b, const Sim3d& b_from_a) {
  return Sim3d(c_from_b.scale * b_from_a.scale,
               c_from_b.rotation * b_from_a.rotation,
               c_from_b * b_from_a.translation);
}

// The pose of a camera after its world was transformed by new_from_old; the
// unit of length of the camera frame becomes that of the new world.
inline Rigid3d TransformCamFromWorld(const Sim3d& new_from_old,
                                     const Rigid3d& cam_from_old) {
  const Eigen::Quaterniond cam_from_new =
      cam_from_old.rotation * new_from_old.rotation.conjugate();
  return CamFromWorldWithCenter(
      cam_from_new, new_from_old * cam_from_old.TargetOriginInSource());
}

struct AlignmentOptions {
  // Whether the scale is estimated; otherwise it stays 1 (a rigid alignment).
  bool estimate_scale = true;
};

// The least-squares similarity target_from_source between corresponding points
// (Umeyama 1991). False with fewer than three points, or when the source points
// coincide. Collinear points leave the rotation about their line undetermined;
// the smallest such rotation is not guaranteed.
bool EstimateSim3d(const std::vector<Eigen::Vector3d>& source,
                   const std::vector<Eigen::Vector3d>& target,
                   const AlignmentOptions& options, Sim3d* target_from_source);

}  // namespace adasfm
