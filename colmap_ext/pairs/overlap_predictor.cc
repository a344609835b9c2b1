// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/overlap_predictor.h"

#include <algorithm>
#include <cmath>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/host/database.h"

namespace adasfm {
namespace {

constexpr double kNumSigmas = 3.0;
constexpr double kMaxRotationError = 10.0 / 180.0 * M_PI;
// The grid: pixels across and down, depths as multiples of the scene's depth.
constexpr int kNumColumns = 8;
constexpr int kNumRows = 6;
constexpr double kDepths[] = {0.25, 0.5, 1.0, 2.0, 4.0};
// Largest distance between images, as a multiple of the scene's depth.
constexpr double kMaxDistance = 2.5;
// Limits up to which SIFT recognises a point.
constexpr double kMaxDepthRatio = 2.5;
constexpr double kMaxRayAngle = 40.0 / 180.0 * M_PI;

double AngleTo(const Eigen::Vector3d& direction, const Eigen::Vector3d& axis) {
  return std::acos(
      std::clamp(direction.dot(axis) / direction.norm(), -1.0, 1.0));
}

// Whether camera 2 shares a point of camera 1.
bool IsShared(const Eigen::Vector3d& point_in_cam1,
              const Rigid3d& cam2_from_cam1, const colmap::Camera& camera2) {
  const Eigen::Vector3d ray1_in_cam2 = cam2_from_cam1.rotation * point_in_cam1;
  const Eigen::Vector3d point_in_cam2 =
      ray1_in_cam2 + cam2_from_cam1.translation;
  const double ratio = point_in_cam2.norm() / point_in_cam1.norm();
  if (ratio > kMaxDepthRatio || ratio * kMaxDepthRatio < 1.0) return false;
  if (ray1_in_cam2.dot(point_in_cam2) <
      std::cos(kMaxRayAngle) * ray1_in_cam2.norm() * point_in_cam2.norm()) {
    return false;
  }
  const std::optional<Eigen::Vector2d> pixel =
      ProjectPoint(camera2, point_in_cam2);
  return pixel && pixel->minCoeff() >= 0.0 && pixel->x() <= WidthOf(camera2) &&
         pixel->y() <= HeightOf(camera2);
}

}  // namespace

bool OverlapPredictionOptions::IsValid(std::string* error) const {
  if (!(scene_depth_m > 0.0)) {
    *error = "AdaSfmPairs.scene_depth_m = " + std::to_string(scene_depth_m) +
             " must be positive";
    return false;
  }
  if (!(min_overlap > 0.0 && min_overlap <= 1.0)) {
    *error = "AdaSfmPairs.min_overlap = " + std::to_string(min_overlap) +
             " must be above 0, and at most 1";
    return false;
  }
  return chain.IsValid(error);
}

OverlapPredictor::View OverlapPredictor::BuildView(const colmap::Camera& camera,
                                                   double scene_depth_m) {
  View view;
  view.camera = camera;
  if (!HasUsableParams(camera)) return view;
  for (int row = 0; row < kNumRows; ++row) {
    for (int column = 0; column < kNumColumns; ++column) {
      const Eigen::Vector2d pixel(
          (column + 0.5) / kNumColumns * WidthOf(camera),
          (row + 0.5) / kNumRows * HeightOf(camera));
      const std::optional<Bearing> ray = ComputeBearing(camera, pixel);
      if (!ray) continue;
      view.half_angle = std::max(
          view.half_angle, AngleTo(ray->direction, Eigen::Vector3d::UnitZ()));
      for (const double depth : kDepths) {
        view.points_in_cam.push_back(depth * scene_depth_m * ray->direction);
      }
    }
  }
  return view;
}

StatusOr<OverlapPredictor> OverlapPredictor::Read(
    const OverlapPredictionOptions& options, const std::string& database_path) {
  OverlapPredictor predictor;
  if (!options.enabled) return predictor;
  const StatusOr<LoadedPriorTables> tables = ReadPriorTables(database_path);
  if (!tables.ok()) return tables.status();
  predictor.options_ = options;
  OdometryChainOptions chain = options.chain;
  chain.gyro_bias_covariance = tables->tables.gyroscope_bias_covariance;
  predictor.chain_ = OdometryChain(tables->tables.priors, chain);
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    for (const auto& [camera_id, camera] : ReadCameras(&database)) {
      predictor.views_[camera_id] = BuildView(camera, options.scene_depth_m);
    }
    for (const DatabaseImage& image : ReadImages(&database)) {
      predictor.camera_ids_[image.image_id] = image.camera_id;
    }
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return predictor;
}

double OverlapPredictor::SharedPart(const View& view1, const View& view2,
                                    const Rigid3d& cam2_from_cam1) {
  const int num_shared =
      std::count_if(view1.points_in_cam.begin(), view1.points_in_cam.end(),
                    [&](const Eigen::Vector3d& point) {
                      return IsShared(point, cam2_from_cam1, view2.camera);
                    });
  return static_cast<double>(num_shared) / view1.points_in_cam.size();
}

std::optional<double> OverlapPredictor::Predict(const ImagePair& pair) const {
  const auto& [image_id1, image_id2] = pair;
  if (!chain_.IsConnected(image_id1, image_id2)) return std::nullopt;
  const View& view1 = ViewOf(image_id1);
  const View& view2 = ViewOf(image_id2);
  if (view1.points_in_cam.empty() || view2.points_in_cam.empty()) {
    return std::nullopt;
  }
  const ChainMotion motion = chain_.Motion(image_id1, image_id2);
  if (!motion.has_rotation) return std::nullopt;
  const double rotation_error =
      kNumSigmas * std::sqrt(motion.covariance.topLeftCorner<3, 3>().trace());
  const double angle =
      AngleTo(motion.cam2_from_cam1.rotation * Eigen::Vector3d::UnitZ(),
              Eigen::Vector3d::UnitZ());
  if (angle - rotation_error >
      view1.half_angle + view2.half_angle + kMaxRayAngle) {
    return 0.0;
  }
  if (!motion.has_position) return std::nullopt;
  const Eigen::Matrix3d covariance =
      motion.covariance.bottomRightCorner<3, 3>();
  const Eigen::Vector3d& translation = motion.cam2_from_cam1.translation;
  const double distance = translation.norm();
  const double distance_error =
      kNumSigmas * std::sqrt(translation.dot(covariance * translation)) /
      std::max(distance, 1e-9);
  if (distance - distance_error > kMaxDistance * options_.scene_depth_m) {
    return 0.0;
  }
  if (rotation_error > kMaxRotationError ||
      kNumSigmas * std::sqrt(covariance.trace()) >
          kDepths[0] * options_.scene_depth_m) {
    return std::nullopt;
  }
  return std::min(SharedPart(view1, view2, motion.cam2_from_cam1),
                  SharedPart(view2, view1, motion.cam2_from_cam1.Inverse()));
}

}  // namespace adasfm
