// SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>

#include "colmap_ext/host/database.h"
#include "colmap_ext/host/two_view.h"
#include "colmap_ext/io/double_blob.h"
#include "core/so3.h"

namespace adasfm {
namespace {

using RowMajorMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

void WriteTwoViewGeometry(const colmap::Camera& camera1,
                          const colmap::Camera& camera2,
                          const NewTwoViewGeometry& row,
                          SqliteStatement* statement) {
  if (row.cam2_from_cam1.translation.isZero()) {
    throw std::invalid_argument("NewTwoViewGeometry: translation is zero");
  }
  const Eigen::Quaterniond& rotation = row.cam2_from_cam1.rotation;
  const Eigen::Vector4d qvec(rotation.w(), rotation.x(), rotation.y(),
                             rotation.z());
  const Eigen::Vector3d tvec = row.cam2_from_cam1.translation.normalized();
  const RowMajorMatrix3d E = Hat(tvec) * rotation.toRotationMatrix();
  const RowMajorMatrix3d F = camera2.CalibrationMatrix().inverse().transpose() *
                             E * camera1.CalibrationMatrix().inverse();
  statement->Reset();
  statement->BindInt(1, PairIdFromImagePair(row.pair));
  statement->BindInt(2, row.inlier_matches.size());
  statement->BindBlob(3, row.inlier_matches.data(),
                      row.inlier_matches.size() * sizeof(FeatureMatch));
  statement->BindInt(4, kCalibratedConfiguration);
  BindDoubles(statement, 5, F.data(), 9);
  BindDoubles(statement, 6, E.data(), 9);
  BindDoubles(statement, 7, qvec.data(), 4);
  BindDoubles(statement, 8, tvec.data(), 3);
  statement->Step();
}

}  // namespace

void WriteTwoViewGeometries(SqliteConnection* database,
                            const std::vector<NewTwoViewGeometry>& rows) {
  const std::map<camera_t, colmap::Camera> cameras = ReadCameras(database);
  std::map<image_t, camera_t> camera_ids;
  for (const DatabaseImage& image : ReadImages(database)) {
    camera_ids[image.image_id] = image.camera_id;
  }
  SqliteStatement statement(
      database,
      "INSERT OR REPLACE INTO two_view_geometries (pair_id, rows, cols, data, "
      "config, F, E, H, qvec, tvec) VALUES (?, ?, 2, ?, ?, ?, ?, NULL, ?, ?)");
  for (const NewTwoViewGeometry& row : rows) {
    WriteTwoViewGeometry(cameras.at(camera_ids.at(row.pair.image_id1)),
                         cameras.at(camera_ids.at(row.pair.image_id2)), row,
                         &statement);
  }
}

}  // namespace adasfm
