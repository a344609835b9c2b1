// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/host/database.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// Writes new rows into a database of the linked library's version, through
// COLMAP's own class. That class creates a missing file and its tables, and
// ends the process when it cannot open the file. A failed write is not
// reported: count the rows in the end.
class DatabaseWriter {
 public:
  explicit DatabaseWriter(const std::string& path);
  ~DatabaseWriter();

  // Ends the transaction of what was written so far; the destructor does, too.
  void Commit();

  // With the camera's id, or with an id that COLMAP chooses and that is
  // returned. Where the tables have rigs, each camera gets its own rig.
  void WriteCamera(const colmap::Camera& camera);
  camera_t WriteNewCamera(const colmap::Camera& camera);
  // The same; each image gets its own frame. position: latitude and longitude
  // in degrees, altitude in m.
  void WriteImage(const DatabaseImage& image);
  void WriteNewImage(const std::string& name, camera_t camera_id,
                     const std::optional<Eigen::Vector3d>& position);
  void WriteKeypoints(image_t image_id,
                      const std::vector<Eigen::Vector2d>& keypoints);
  void WriteMatches(const ImagePair& pair,
                    const std::vector<FeatureMatch>& matches);
  // Configuration CALIBRATED, with the essential matrix of the pose.
  void WriteTwoViewGeometry(const ImagePair& pair,
                            const std::vector<FeatureMatch>& inlier_matches,
                            const Rigid3d& cam2_from_cam1);

 private:
  struct Host;
  std::unique_ptr<Host> host_;
};

}  // namespace adasfm
