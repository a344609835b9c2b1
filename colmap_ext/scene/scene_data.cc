// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/scene_data.h"

#include <algorithm>
#include <utility>

#include "colmap_ext/database/inertial_tables.h"
#include "colmap_ext/database/prior_corrections.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/database/rig_table.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/camera_models.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/scene/drives.h"
#include "colmap_ext/scene/raw_matches.h"
#include "core/prior_lengths.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

void ReadSceneImages(SqliteConnection* database, SceneData* scene) {
  std::map<image_t, std::vector<Eigen::Vector2d>> keypoints =
      ReadKeypoints(database);
  for (DatabaseImage& row : ReadImages(database)) {
    if (scene->cameras.count(row.camera_id) == 0) {
      throw SqliteError("image " + row.name + " has a camera, id " +
                        std::to_string(row.camera_id) + ", that is missing");
    }
    if (!HasUsableParams(scene->cameras.at(row.camera_id))) {
      throw SqliteError("camera " + std::to_string(row.camera_id) +
                        ", that of image " + row.name +
                        ", has parameters that no camera has");
    }
    if (row.name.find('\0') != std::string::npos) {
      throw SqliteError("the name of image " + std::to_string(row.image_id) +
                        " has a zero byte");
    }
    SceneImage& image = scene->images[row.image_id];
    image.image_id = row.image_id;
    image.camera_id = row.camera_id;
    image.name = std::move(row.name);
    const auto points = keypoints.find(row.image_id);
    if (points != keypoints.end()) image.keypoints = std::move(points->second);
  }
}

void ReadScenePriors(SqliteConnection* database,
                     const SceneDataOptions& options, SceneData* scene) {
  LoadedPriorTables loaded = ReadPriorTables(database);
  for (const ImageTimeRow& row : loaded.tables.image_times) {
    scene->images.at(row.image_id).timestamp_ns = row.timestamp_ns;
  }
  scene->priors = std::move(loaded.tables.priors);
  scene->gyroscope_bias_covariance = loaded.tables.gyroscope_bias_covariance;
  scene->length_drift_ratio = loaded.tables.length_drift_ratio;
  scene->wheel_scale = loaded.tables.wheel_scale;
  scene->positions = std::move(loaded.tables.positions);
  scene->position_origin = loaded.tables.position_origin;
  scene->rigs = ReadCameraRigs(database);
  scene->frame_priors = ComputeFramePriors(scene->rigs);
  scene->inertial_motions = std::move(loaded.tables.inertial_motions);
  NumberDrives(scene);
  for (const GravityRow& row : loaded.tables.gravity) {
    scene->images.at(row.image_id).gravity_in_cam = row.gravity_in_cam;
  }
  if (!options.use_original_two_view_geometries) {
    const CameraImuCorrectionMap corrections =
        CorrectionsByDrive(*scene, ReadCameraImuCorrections(database));
    AddTimeShifts(CorrectionsByDrive(*scene, ReadTimeShifts(database)),
                  &scene->priors, &scene->inertial_motions);
    RotatePriors(corrections, &scene->priors);
    CorrectGyroscopeScales(
        CorrectionsByDrive(*scene, ReadGyroscopeScales(database)),
        &scene->priors);
    RotateGravityAndMotions(corrections, scene);
    scene->inertial_scale_sigma =
        AddInertialLengths(ReadInertialLengths(database), &scene->priors);
    // Inertial motions constrain nothing in a model without metres.
    if (!(scene->inertial_scale_sigma > 0.0) &&
        !HasMeasuredLengths(scene->priors)) {
      scene->inertial_motions.clear();
    }
  }
  if (loaded.num_ignored_rows > 0) {
    scene->warnings.push_back(
        std::to_string(loaded.num_ignored_rows) +
        " sensor rows belong to images that the database does not have any "
        "more; run adasfm_prior_importer again");
  }
}

// Whether the keypoint is finite; matches of other keypoints are removed.
bool IsUsable(const SceneImage& image, point2D_t index) {
  return image.keypoints[index].allFinite();
}

void DropUnusableMatches(const SceneData& scene, const ImagePair& pair,
                         std::vector<FeatureMatch>* matches) {
  const SceneImage& image1 = scene.images.at(pair.image_id1);
  const SceneImage& image2 = scene.images.at(pair.image_id2);
  const auto end = std::remove_if(
      matches->begin(), matches->end(), [&](const FeatureMatch& match) {
        return !IsUsable(image1, match.point2D_idx1) ||
               !IsUsable(image2, match.point2D_idx2);
      });
  matches->erase(end, matches->end());
}

// Replaces keypoints that are not numbers by zeros, so that the indices of
// others stay valid. The warning names the first image with such keypoints.
void ReplaceUnusableKeypoints(SceneData* scene) {
  size_t count = 0;
  std::string name;
  for (auto& [image_id, image] : scene->images) {
    for (Eigen::Vector2d& keypoint : image.keypoints) {
      if (keypoint.allFinite()) continue;
      if (count++ == 0) name = image.name;
      keypoint.setZero();
    }
  }
  if (count == 0) return;
  scene->warnings.push_back(std::to_string(count) +
                            " keypoints are not numbers (the first image " +
                            "with one is " + name + "); they were left out");
}

// The two-view geometries to use, by pair: the present rows, or the originals
// where adasfm_global replaced them.
std::map<ImagePair, DatabaseTwoViewGeometry> ReadRows(
    SqliteConnection* database, const SceneDataOptions& options) {
  std::map<ImagePair, DatabaseTwoViewGeometry> rows;
  for (DatabaseTwoViewGeometry& row : ReadTwoViewGeometries(
           database, "two_view_geometries", options.min_num_matches)) {
    const ImagePair pair = row.pair;
    rows[pair] = std::move(row);
  }
  if (!options.use_original_two_view_geometries) return rows;
  const std::vector<ImagePair> kept = FindKeptOriginals(database);
  if (kept.empty()) return rows;
  std::map<ImagePair, DatabaseTwoViewGeometry> originals;
  for (DatabaseTwoViewGeometry& row : ReadTwoViewGeometries(
           database, kTwoViewGeometryBackupTable, options.min_num_matches)) {
    const ImagePair pair = row.pair;
    originals[pair] = std::move(row);
  }
  for (const ImagePair& pair : kept) {
    const auto original = originals.find(pair);
    if (original == originals.end()) {
      rows.erase(pair);
    } else {
      rows[pair] = std::move(original->second);
    }
  }
  return rows;
}

void ReadScenePairs(SqliteConnection* database, const SceneDataOptions& options,
                    SceneData* scene) {
  int num_unknown = 0;
  for (auto& [pair, row] : ReadRows(database, options)) {
    if (pair.image_id1 == pair.image_id2) {
      throw SqliteError("an image, id " + std::to_string(pair.image_id1) +
                        ", is paired with itself");
    }
    // COLMAP leaves the pairs of deleted images in the table.
    if (scene->images.count(pair.image_id1) == 0 ||
        scene->images.count(pair.image_id2) == 0) {
      ++num_unknown;
      continue;
    }
    CheckIndices(*scene, pair, row.inlier_matches);
    DropUnusableMatches(*scene, pair, &row.inlier_matches);
    ScenePair scene_pair;
    scene_pair.image_id1 = pair.image_id1;
    scene_pair.image_id2 = pair.image_id2;
    scene_pair.config = row.config;
    scene_pair.inlier_matches = std::move(row.inlier_matches);
    scene_pair.cam2_from_cam1 = row.cam2_from_cam1;
    scene_pair.essential_matrix = row.essential_matrix;
    scene->pairs.push_back(std::move(scene_pair));
  }
  if (num_unknown == 0) return;
  scene->warnings.push_back(
      std::to_string(num_unknown) +
      " verified pairs belong to images that the database does not have any "
      "more; they were left out");
}

void ReadRawMatches(SqliteConnection* database, SceneData* scene) {
  auto next = scene->pairs.begin();
  ReadMatches(database,
              [&](const ImagePair& pair, std::vector<FeatureMatch> matches) {
                // Both are sorted by pair.
                while (next != scene->pairs.end() &&
                       ImagePair(next->image_id1, next->image_id2) < pair) {
                  ++next;
                }
                if (next == scene->pairs.end() ||
                    !(ImagePair(next->image_id1, next->image_id2) == pair)) {
                  return;
                }
                CheckIndices(*scene, pair, matches);
                DropUnusableMatches(*scene, pair, &matches);
                next->raw_matches = std::move(matches);
              });
}

}  // namespace

StatusOr<SceneData> ReadSceneData(const std::string& database_path,
                                  const SceneDataOptions& options) {
  const Status checked = CheckDatabase(database_path);
  if (!checked.ok()) return checked;
  SceneData scene;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    const Status models = CheckCameraModels(database_path, &database);
    if (!models.ok()) return models;
    scene.cameras = ReadCameras(&database);
    ReadSceneImages(&database, &scene);
    if (options.read_priors) ReadScenePriors(&database, options, &scene);
    ReadScenePairs(&database, options, &scene);
    if (options.read_raw_matches) ReadRawMatches(&database, &scene);
    ReplaceUnusableKeypoints(&scene);
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what() +
                         "; the database is damaged or out of step with "
                         "itself, extract and match again");
  }
  return scene;
}

StatusOr<ModelFrames> ReadModelFrames(const std::string& database_path,
                                      const SceneData& scene,
                                      std::vector<std::string>* warnings) {
  DatabaseFrames frames;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    frames = ReadDatabaseFrames(&database);
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  if (scene.rigs.empty()) return ModelFrames(frames);
  if (frames.has_tables && frames.rigs.empty()) {
    warnings->push_back(
        "the database's own frames have one image each, and so has the model; "
        "COLMAP's rig_configurator makes them frames of the rig");
    return ModelFrames(frames);
  }
  frames.rigs = scene.rigs;
  if (frames.has_tables) return ModelFrames(frames);
  const std::map<uint32_t, image_t> leaders = FindFrameLeaders(scene.rigs);
  for (const auto& [image_id, image] : scene.images) {
    FrameOfImage frame{image_id, image.camera_id};
    const auto rig_image = scene.rigs.images.find(image_id);
    if (rig_image != scene.rigs.images.end()) {
      frame = {leaders.at(rig_image->second.frame_id),
               scene.rigs.cameras.at(image.camera_id).rig_id};
    }
    frames.frames[image_id] = frame;
  }
  return ModelFrames(frames);
}

}  // namespace adasfm
