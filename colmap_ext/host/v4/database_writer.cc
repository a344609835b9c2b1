// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database_writer.h"

#include <colmap/geometry/essential_matrix.h>
#include <colmap/geometry/pose_prior.h>
#include <colmap/scene/database.h>
#include <colmap/scene/two_view_geometry.h>

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

colmap::sensor_t SensorOf(camera_t camera_id) {
  return colmap::sensor_t(colmap::SensorType::CAMERA, camera_id);
}

colmap::Image MakeImage(const std::string& name, camera_t camera_id) {
  colmap::Image image;
  image.SetName(name);
  image.SetCameraId(camera_id);
  return image;
}

void WriteRig(camera_t camera_id, colmap::Database* database) {
  colmap::Rig rig;
  rig.SetRigId(camera_id);
  rig.AddRefSensor(SensorOf(camera_id));
  database->WriteRig(rig, /*use_rig_id=*/true);
}

void WriteFrame(image_t image_id, camera_t camera_id,
                colmap::Database* database) {
  colmap::Frame frame;
  frame.SetFrameId(image_id);
  frame.SetRigId(camera_id);
  frame.AddDataId(colmap::data_t(SensorOf(camera_id), image_id));
  database->WriteFrame(frame, /*use_frame_id=*/true);
}

}  // namespace

struct DatabaseWriter::Host {
  explicit Host(const std::string& path)
      : database(colmap::Database::Open(path)), transaction(database.get()) {}

  std::shared_ptr<colmap::Database> database;
  std::optional<colmap::DatabaseTransaction> transaction;
};

DatabaseWriter::DatabaseWriter(const std::string& path)
    : host_(std::make_unique<Host>(path)) {}

DatabaseWriter::~DatabaseWriter() = default;

void DatabaseWriter::Commit() {
  host_->transaction.reset();
  host_->transaction.emplace(host_->database.get());
}

void DatabaseWriter::WriteCamera(const colmap::Camera& camera) {
  host_->database->WriteCamera(camera, /*use_camera_id=*/true);
  WriteRig(camera.camera_id, host_->database.get());
}

camera_t DatabaseWriter::WriteNewCamera(const colmap::Camera& camera) {
  const camera_t camera_id = host_->database->WriteCamera(camera);
  WriteRig(camera_id, host_->database.get());
  return camera_id;
}

void DatabaseWriter::WriteImage(const DatabaseImage& image) {
  colmap::Image host_image = MakeImage(image.name, image.camera_id);
  host_image.SetImageId(image.image_id);
  host_->database->WriteImage(host_image, /*use_image_id=*/true);
  WriteFrame(image.image_id, image.camera_id, host_->database.get());
}

void DatabaseWriter::WriteNewImage(
    const std::string& name, camera_t camera_id,
    const std::optional<Eigen::Vector3d>& position) {
  const image_t image_id =
      host_->database->WriteImage(MakeImage(name, camera_id));
  WriteFrame(image_id, camera_id, host_->database.get());
  if (!position) return;
  colmap::PosePrior prior;
  prior.corr_data_id = colmap::data_t(SensorOf(camera_id), image_id);
  prior.position = *position;
  prior.coordinate_system = colmap::PosePrior::CoordinateSystem::WGS84;
  host_->database->WritePosePrior(prior);
}

void DatabaseWriter::WriteKeypoints(
    image_t image_id, const std::vector<Eigen::Vector2d>& keypoints) {
  colmap::FeatureKeypoints host_keypoints;
  for (const Eigen::Vector2d& keypoint : keypoints) {
    host_keypoints.emplace_back(keypoint.x(), keypoint.y());
  }
  host_->database->WriteKeypoints(image_id, host_keypoints);
}

void DatabaseWriter::WriteMatches(const ImagePair& pair,
                                  const std::vector<FeatureMatch>& matches) {
  host_->database->WriteMatches(pair.image_id1, pair.image_id2,
                                ConvertMatches(matches));
}

void DatabaseWriter::WriteTwoViewGeometry(
    const ImagePair& pair, const std::vector<FeatureMatch>& inlier_matches,
    const Rigid3d& cam2_from_cam1) {
  colmap::TwoViewGeometry geometry;
  geometry.config = colmap::TwoViewGeometry::CALIBRATED;
  geometry.inlier_matches = ConvertMatches(inlier_matches);
  geometry.cam2_from_cam1 =
      colmap::Rigid3d(cam2_from_cam1.rotation, cam2_from_cam1.translation);
  geometry.E = colmap::EssentialMatrixFromPose(*geometry.cam2_from_cam1);
  host_->database->WriteTwoViewGeometry(pair.image_id1, pair.image_id2,
                                        geometry);
}

}  // namespace adasfm
