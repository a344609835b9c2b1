// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/odometry_gate.h"

#include <algorithm>
#include <cmath>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/database.h"

namespace adasfm {
namespace {

constexpr double kNumSigmas = 3.0;
constexpr double kMaxViewAngle = M_PI / 3.0;

// Of the image's corners; a right angle where they have no rays.
double HalfFieldOfView(const colmap::Camera& camera) {
  if (!HasUsableParams(camera)) return M_PI / 2.0;
  double angle = 0.0;
  for (const double x : {0.0, static_cast<double>(camera.Width())}) {
    for (const double y : {0.0, static_cast<double>(camera.Height())}) {
      const std::optional<Bearing> ray =
          ComputeBearing(camera, Eigen::Vector2d(x, y));
      if (!ray) return M_PI / 2.0;
      angle =
          std::max(angle, std::acos(std::clamp(ray->direction.z(), -1.0, 1.0)));
    }
  }
  return angle;
}

}  // namespace

bool OdometryGateOptions::IsValid(std::string* error) const {
  if (!(max_distance_m > 0.0)) {
    *error = "AdaSfmPairs.max_distance_m = " + std::to_string(max_distance_m) +
             " must be positive";
    return false;
  }
  return chain.IsValid(error);
}

StatusOr<OdometryGate> OdometryGate::Read(const OdometryGateOptions& options,
                                          const std::string& database_path) {
  OdometryGate gate;
  if (!options.enabled) return gate;
  const StatusOr<LoadedPriorTables> tables = ReadPriorTables(database_path);
  if (!tables.ok()) return tables.status();
  gate.options_ = options;
  gate.chain_ = OdometryChain(tables->tables.priors, options.chain);
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    std::map<camera_t, double> angles;
    for (const auto& [camera_id, camera] : ReadCameras(&database)) {
      angles[camera_id] = HalfFieldOfView(camera);
    }
    for (const DatabaseImage& image : ReadImages(&database)) {
      const auto angle = angles.find(image.camera_id);
      gate.half_fields_of_view_[image.image_id] =
          angle == angles.end() ? M_PI / 2.0 : angle->second;
    }
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return gate;
}

bool OdometryGate::MayOverlap(image_t image_id1, image_t image_id2) const {
  if (!chain_.IsConnected(image_id1, image_id2)) return true;
  const ChainMotion motion = chain_.Motion(image_id1, image_id2);
  if (!motion.has_rotation) return true;
  const Eigen::Vector3d axis1_in_cam2 =
      motion.cam2_from_cam1.rotation * Eigen::Vector3d::UnitZ();
  const double angle = std::acos(std::clamp(axis1_in_cam2.z(), -1.0, 1.0));
  const double rotation_sigma =
      std::sqrt(motion.covariance.topLeftCorner<3, 3>().trace());
  if (angle - kNumSigmas * rotation_sigma >
      half_fields_of_view_.at(image_id1) + half_fields_of_view_.at(image_id2) +
          kMaxViewAngle) {
    return false;
  }
  if (!motion.has_position) return true;
  const double distance = motion.cam2_from_cam1.translation.norm();
  if (distance <= options_.max_distance_m) return true;
  const Eigen::Vector3d direction =
      motion.cam2_from_cam1.translation / distance;
  const double sigma = std::sqrt(
      direction.dot(motion.covariance.bottomRightCorner<3, 3>() * direction));
  return distance - kNumSigmas * sigma <= options_.max_distance_m;
}

}  // namespace adasfm
