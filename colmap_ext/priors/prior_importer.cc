// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/priors/prior_importer.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <tuple>
#include <utility>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/scene/image_finder.h"
#include "colmap_ext/scene/scene_data.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "global/two_view/refine_relative_poses.h"
#include "sensors/io/read_image_times.h"
#include "sensors/io/read_imu.h"
#include "sensors/io/read_wheel.h"

namespace adasfm {
namespace {

StatusOr<std::vector<ImageStamp>> StampsFromFile(
    const std::string& path, const SceneData& scene,
    std::vector<std::string>* warnings) {
  const StatusOr<std::vector<ImageTime>> times = ReadImageTimes(path);
  if (!times.ok()) return times.status();
  ImageFinder finder;
  for (const auto& [image_id, image] : scene.images) {
    finder.Add(image_id, image.name);
  }
  std::map<image_t, ImageStamp> stamps;
  std::vector<std::string> unknown;
  for (const ImageTime& time : *times) {
    const image_t image_id = finder.Find(time.name);
    if (image_id == kInvalidImageId) {
      unknown.push_back(time.name);
      continue;
    }
    const std::string& name = scene.images.at(image_id).name;
    if (!stamps.emplace(image_id, ImageStamp{image_id, name, time.timestamp_ns})
             .second) {
      return Status::Error(path + ": image " + name + " has two times");
    }
  }
  if (stamps.empty()) {
    return Status::Error(
        path + ": none of its " + std::to_string(times->size()) +
        " images is in the database (the first one is " + unknown.front() +
        ", the database's first one is " + scene.images.begin()->second.name +
        "); check --image_times_path");
  }
  if (!unknown.empty()) {
    warnings->push_back(path + ": " + std::to_string(unknown.size()) + " of " +
                        std::to_string(times->size()) +
                        " images are not in the database (the first one is " +
                        unknown.front() + ")");
  }
  std::vector<ImageStamp> result;
  for (auto& [image_id, stamp] : stamps) result.push_back(std::move(stamp));
  return result;
}

StatusOr<std::vector<ImageStamp>> StampsFromNames(const SceneData& scene) {
  std::vector<ImageStamp> stamps;
  for (const auto& [image_id, image] : scene.images) {
    ImageStamp stamp{image_id, image.name, 0};
    if (ParseImageNameTime(image.name, &stamp.timestamp_ns)) {
      stamps.push_back(std::move(stamp));
    }
  }
  if (!stamps.empty()) return stamps;
  return Status::Error("the image names of the database (the first one is " +
                       scene.images.begin()->second.name +
                       ") are not times in nanoseconds; give "
                       "--image_times_path");
}

StatusOr<std::vector<ImageStamp>> StampImages(const std::string& path,
                                              const SceneData& scene,
                                              PriorImport* import) {
  StatusOr<std::vector<ImageStamp>> stamps =
      path.empty() ? StampsFromNames(scene)
                   : StampsFromFile(path, scene, &import->warnings);
  if (!stamps.ok()) return stamps;
  import->num_images_without_time = scene.images.size() - stamps->size();
  if (import->num_images_without_time > 0) {
    import->warnings.push_back(std::to_string(import->num_images_without_time) +
                               " images of the database have no time, and so "
                               "no priors");
  }
  std::sort(stamps->begin(), stamps->end(),
            [](const ImageStamp& a, const ImageStamp& b) {
              return std::tie(a.timestamp_ns, a.image_id) <
                     std::tie(b.timestamp_ns, b.image_id);
            });
  for (const ImageStamp& stamp : *stamps) {
    import->tables.image_times.push_back({stamp.image_id, stamp.timestamp_ns});
  }
  return stamps;
}

Status ReadLogs(const PriorImportPaths& paths,
                const SensorCalibration& calibration, SensorLogs* logs,
                std::vector<std::string>* warnings) {
  if (!paths.imu_path.empty()) {
    StatusOr<std::vector<ImuSample>> imu = ReadImu(paths.imu_path, warnings);
    if (!imu.ok()) return imu.status();
    logs->imu = std::move(imu).value();
  }
  if (paths.wheel_path.empty()) return Status::Ok();
  if (!calibration.has_wheel) {
    return Status::Error(paths.sensors_path + " has no wheel0, which " +
                         paths.wheel_path + " needs; add it");
  }
  if (calibration.wheel_type == WheelType::kOdometry) {
    StatusOr<std::vector<OdometryPose>> odometry =
        ReadOdometry(paths.wheel_path, warnings);
    if (!odometry.ok()) return odometry.status();
    logs->odometry = std::move(odometry).value();
    return Status::Ok();
  }
  StatusOr<std::vector<WheelSample>> wheel =
      ReadWheel(paths.wheel_path, calibration.wheel_type, warnings);
  if (!wheel.ok()) return wheel.status();
  logs->wheel = std::move(wheel).value();
  return Status::Ok();
}

void KeepNearPairs(const std::vector<ImageStamp>& stamps, int max_gap,
                   std::vector<ScenePair>* pairs) {
  std::map<image_t, int> ranks;
  for (size_t i = 0; i < stamps.size(); ++i) ranks[stamps[i].image_id] = i;
  const auto is_far = [&](const ScenePair& pair) {
    const auto rank1 = ranks.find(pair.image_id1);
    const auto rank2 = ranks.find(pair.image_id2);
    return rank1 == ranks.end() || rank2 == ranks.end() ||
           std::abs(rank1->second - rank2->second) > max_gap;
  };
  pairs->erase(std::remove_if(pairs->begin(), pairs->end(), is_far),
               pairs->end());
}

// The relative rotations of the scene's pairs.
std::vector<VisualRotation> ComputeVisualRotations(SceneData scene) {
  GlobalCorrespondences correspondences;
  for (const auto& [image_id, image] : scene.images) {
    correspondences.bearings[image_id] =
        ComputeBearings(scene.cameras.at(image.camera_id), image.keypoints);
  }
  ViewGraph graph = BuildInitialViewGraph(TwoViewPoseOptions(), scene,
                                          correspondences.bearings)
                        .graph;
  for (ScenePair& pair : scene.pairs) {
    correspondences.matches[ImagePair(pair.image_id1, pair.image_id2)] =
        std::move(pair.inlier_matches);
  }
  // What verification left is fit to few matches: on a straight road its noise
  // would drown the little that the machine turns. There are few pairs here, so
  // that each can have more matches than the global stage gives it, and a loss
  // at the keypoints' noise: what moves in the scene is often hardly further
  // off. Rotations of three images close four times better for both.
  RelativePoseRefinementOptions refinement;
  refinement.max_num_matches = 1000;
  refinement.loss_scale_px = refinement.keypoint_sigma_px;
  refinement.max_num_iterations = 12;
  RefineRelativePoses(refinement, correspondences, {}, &graph);
  std::vector<VisualRotation> rotations;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept() || !edge.has_rotation) continue;
    rotations.push_back({edge.image_id1, edge.image_id2,
                         edge.cam2_from_cam1.rotation, edge.num_inliers});
  }
  return rotations;
}

StatusOr<SceneData> ReadScene(const std::string& database_path) {
  SceneDataOptions options;
  options.use_original_two_view_geometries = true;
  StatusOr<SceneData> scene = ReadSceneData(database_path, options);
  if (scene.ok() && scene->images.empty()) {
    return Status::Error("the database " + database_path +
                         " has no images; run COLMAP's feature_extractor "
                         "first");
  }
  return scene;
}

}  // namespace

bool PriorImportOptions::IsValid(std::string* error) const {
  if (max_visual_gap < 1) {
    *error = "AdaSfmPriors.max_visual_gap is " +
             std::to_string(max_visual_gap) + "; it must be positive";
    return false;
  }
  return estimation.IsValid(error);
}

StatusOr<PriorImport> ComputePriorImport(const PriorImportPaths& paths,
                                         const PriorImportOptions& options) {
  if (paths.imu_path.empty() && paths.wheel_path.empty()) {
    return Status::Error(
        "no sensor log; give --imu_path, --wheel_path or both");
  }
  Status status = CheckDatabase(paths.database_path);
  if (!status.ok()) return status;
  const StatusOr<SensorCalibration> calibration =
      ReadSensorCalibration(paths.sensors_path);
  if (!calibration.ok()) return calibration.status();
  const auto start = std::chrono::steady_clock::now();
  PriorImport import;
  SensorLogs logs;
  status = ReadLogs(paths, *calibration, &logs, &import.warnings);
  if (!status.ok()) return status;
  StatusOr<SceneData> scene = ReadScene(paths.database_path);
  if (!scene.ok()) return scene.status();

  const StatusOr<std::vector<ImageStamp>> stamps =
      StampImages(paths.image_times_path, *scene, &import);
  if (!stamps.ok()) return stamps.status();
  KeepNearPairs(*stamps, options.max_visual_gap, &scene->pairs);
  const std::vector<VisualRotation> rotations =
      ComputeVisualRotations(std::move(scene).value());
  import.num_visual_rotations = rotations.size();

  StatusOr<PriorEstimate> estimate = EstimatePriors(
      *stamps, logs, *calibration, rotations, options.estimation);
  if (!estimate.ok()) return estimate.status();
  import.tables.priors = std::move(estimate->priors);
  for (const auto& [image_id, gravity_in_cam] : estimate->gravity_in_cam) {
    import.tables.gravity.push_back({image_id, gravity_in_cam});
  }
  import.summary = std::move(estimate->summary);
  import.warnings.insert(import.warnings.end(), import.summary.warnings.begin(),
                         import.summary.warnings.end());
  import.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
          .count();
  return import;
}

}  // namespace adasfm
