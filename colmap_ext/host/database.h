// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/rigid3d.h"
#include "core/sqlite.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// The database of any COLMAP since 3.6, read through our own SQLite connection:
// COLMAP's class converts a file when it opens it, and ends the process on bad
// rows and on files of a newer COLMAP.

// An error for a missing file, a file that is no SQLite database, and a
// database that is not COLMAP's. Changes nothing.
Status CheckDatabase(const std::string& database_path);

// The key of a pair in the host's tables, and the inverse.
int64_t PairIdFromImagePair(const ImagePair& pair);
ImagePair ImagePairFromPairId(int64_t pair_id);

struct DatabaseImage {
  image_t image_id = kInvalidImageId;
  camera_t camera_id = 0;
  std::string name;
};

struct DatabaseTwoViewGeometry {
  ImagePair pair;
  int config = 0;
  std::vector<FeatureMatch> inlier_matches;
  // None when the row has none (NULL or zeros).
  std::optional<Eigen::Matrix3d> essential_matrix;
  std::optional<Rigid3d> cam2_from_cam1;
};

// The functions below throw SqliteError, naming table and row, for rows that
// COLMAP could not have written.

// Models that the linked library lacks are converted (camera_models.h).
std::map<camera_t, colmap::Camera> ReadCameras(SqliteConnection* database);

// Sorted by id.
std::vector<DatabaseImage> ReadImages(SqliteConnection* database);
// Those without keypoints or descriptors, sorted by name.
std::vector<DatabaseImage> ReadImagesWithoutFeatures(
    SqliteConnection* database);

// Positions only, in pixels.
std::map<image_t, std::vector<Eigen::Vector2d>> ReadKeypoints(
    SqliteConnection* database);
// Of one image; empty when there are none.
std::vector<Eigen::Vector2d> ReadKeypointsOfImage(SqliteConnection* database,
                                                  image_t image_id);

// Calls function(pair, matches) for every pair in order of the pairs.
void ReadMatches(
    SqliteConnection* database,
    const std::function<void(const ImagePair&, std::vector<FeatureMatch>)>&
        function);

// Calls function(pair, number of matches), in order of the pairs, for every
// pair of `table` that has at least min_num_matches, without reading the
// matches. `table`: matches, two_view_geometries or one with the same columns.
void CountMatches(
    SqliteConnection* database, const std::string& table, int min_num_matches,
    const std::function<void(const ImagePair&, int64_t)>& function);

// The matches of one pair in such a table; empty when there are none.
std::vector<FeatureMatch> ReadMatchesOfPair(SqliteConnection* database,
                                            const std::string& table,
                                            const ImagePair& pair);

// The rows of `table`, which has the columns of two_view_geometries, with at
// least min_num_matches inliers; sorted by pair.
std::vector<DatabaseTwoViewGeometry> ReadTwoViewGeometries(
    SqliteConnection* database, const std::string& table, int min_num_matches);

// A new row for two_view_geometries: configuration CALIBRATED, E from the pose
// with a translation of unit length, F from E and the calibration matrices, and
// no H.
struct NewTwoViewGeometry {
  ImagePair pair;
  std::vector<FeatureMatch> inlier_matches;
  // Of image_id2 from image_id1; the translation must not be zero.
  Rigid3d cam2_from_cam1;
};
void WriteTwoViewGeometries(SqliteConnection* database,
                            const std::vector<NewTwoViewGeometry>& rows);

}  // namespace adasfm
