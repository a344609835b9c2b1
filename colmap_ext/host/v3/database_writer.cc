// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database_writer.h"

#include <estimators/two_view_geometry.h>

#include "core/so3.h"

namespace adasfm {
namespace {

colmap::FeatureMatches ConvertMatches(
    const std::vector<FeatureMatch>& matches) {
  colmap::FeatureMatches converted;
  converted.reserve(matches.size());
  for (const FeatureMatch& match : matches) {
    converted.emplace_back(match.point2D_idx1, match.point2D_idx2);
  }
  return converted;
}

colmap::Image MakeImage(const std::string& name, camera_t camera_id) {
  colmap::Image image;
  image.SetName(name);
  image.SetCameraId(camera_id);
  return image;
}

}  // namespace

struct DatabaseWriter::Host {
  explicit Host(const std::string& path)
      : database(path), transaction(&database) {}

  colmap::Database database;
  std::optional<colmap::DatabaseTransaction> transaction;
};

DatabaseWriter::DatabaseWriter(const std::string& path)
    : host_(std::make_unique<Host>(path)) {}

DatabaseWriter::~DatabaseWriter() = default;

void DatabaseWriter::Commit() {
  host_->transaction.reset();
  host_->transaction.emplace(&host_->database);
}

void DatabaseWriter::WriteCamera(const colmap::Camera& camera) {
  host_->database.WriteCamera(camera, /*use_camera_id=*/true);
}

camera_t DatabaseWriter::WriteNewCamera(const colmap::Camera& camera) {
  return host_->database.WriteCamera(camera);
}

void DatabaseWriter::WriteImage(const DatabaseImage& image) {
  colmap::Image host_image = MakeImage(image.name, image.camera_id);
  host_image.SetImageId(image.image_id);
  host_->database.WriteImage(host_image, /*use_image_id=*/true);
}

void DatabaseWriter::WriteNewImage(
    const std::string& name, camera_t camera_id,
    const std::optional<Eigen::Vector3d>& position) {
  colmap::Image image = MakeImage(name, camera_id);
  // COLMAP's feature_extractor stores the position here.
  if (position) image.SetTvecPrior(*position);
  host_->database.WriteImage(image);
}

void DatabaseWriter::WriteKeypoints(
    image_t image_id, const std::vector<Eigen::Vector2d>& keypoints) {
  colmap::FeatureKeypoints host_keypoints;
  for (const Eigen::Vector2d& keypoint : keypoints) {
    host_keypoints.emplace_back(keypoint.x(), keypoint.y());
  }
  host_->database.WriteKeypoints(image_id, host_keypoints);
}

void DatabaseWriter::WriteMatches(const ImagePair& pair,
                                  const std::vector<FeatureMatch>& matches) {
  host_->database.WriteMatches(pair.image_id1, pair.image_id2,
                               ConvertMatches(matches));
}

void DatabaseWriter::WriteTwoViewGeometry(
    const ImagePair& pair, const std::vector<FeatureMatch>& inlier_matches,
    const Rigid3d& cam2_from_cam1) {
  colmap::TwoViewGeometry geometry;
  geometry.config = colmap::TwoViewGeometry::CALIBRATED;
  geometry.inlier_matches = ConvertMatches(inlier_matches);
  const Eigen::Quaterniond& rotation = cam2_from_cam1.rotation;
  geometry.qvec << rotation.w(), rotation.x(), rotation.y(), rotation.z();
  geometry.tvec = cam2_from_cam1.translation;
  geometry.E = Hat(geometry.tvec) * rotation.toRotationMatrix();
  host_->database.WriteTwoViewGeometry(pair.image_id1, pair.image_id2,
                                       geometry);
}

}  // namespace adasfm
