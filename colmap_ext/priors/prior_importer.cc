// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/priors/prior_importer.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/host/frames.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/priors/import_positions.h"
#include "colmap_ext/priors/read_sensor_logs.h"
#include "colmap_ext/priors/rig_frames.h"
#include "colmap_ext/priors/stamp_images.h"
#include "colmap_ext/scene/scene_data.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "core/median.h"
#include "core/option_checker.h"
#include "core/stopwatch.h"
#include "global/two_view/minimize_epipolar_distances.h"
#include "global/two_view/refine_relative_poses.h"
#include "sensors/bags/bag_reader.h"
#include "sensors/io/read_wheel.h"

namespace adasfm {
namespace {

// Two-view rotations are used between images at most this many images apart:
// rotations grow with the gap, but so does the probability of a wrong pair.
constexpr int kMaxVisualGap = 3;

// Adds the cameras of the calibration's rig to the import's tables. Without
// such a rig the host's rig is used, whose reference camera is then cam0.
Status FindRig(const RigOptions& options, const SceneData& scene,
               SensorCalibration* calibration, PriorImport* import) {
  StatusOr<std::map<camera_t, RigCamera>> cameras =
      FindRigCameras(options, scene, calibration, &import->warnings);
  if (!cameras.ok()) return cameras.status();
  import->tables.rig_cameras = std::move(*cameras);
  return Status::Ok();
}

// Assigns times to the images. Returns the stamps between which motion is
// estimated: all except those of the other cameras of a rig.
StatusOr<std::vector<ImageStamp>> StampFrames(const PriorImportPaths& paths,
                                              const SceneData& scene,
                                              PriorImport* import) {
  StatusOr<std::vector<ImageStamp>> stamps =
      StampImages(paths.image_times_path, scene, import);
  if (!stamps.ok()) return stamps;
  const auto& rig_cameras = import->tables.rig_cameras;
  std::vector<ImageStamp> frames = GroupFrames(
      scene, rig_cameras.empty() ? scene.rigs.cameras : rig_cameras, &*stamps);
  for (const ImageStamp& stamp : *stamps) {
    import->tables.image_times.push_back({stamp.image_id, stamp.timestamp_ns});
  }
  return frames;
}

// Sets the logs of the bag as paths with topics. Wheels are used only if the
// calibration has wheels.
Status UseBag(const SensorCalibration& calibration, PriorImportPaths* paths) {
  const std::string& bag_path = paths->bag_path;
  const StatusOr<std::unique_ptr<BagReader>> bag = OpenBag(bag_path);
  if (!bag.ok()) return bag.status();
  const auto use = [&](const StatusOr<std::optional<BagTopic>>& topic,
                       std::string* path) {
    if (!topic.ok()) return topic.status();
    if (topic->has_value()) *path = bag_path + ":" + (*topic)->name;
    return Status::Ok();
  };
  const std::vector<BagTopic>& topics = (*bag)->Topics();
  const BagTopicNames& names = paths->bag_topics;
  Status status;
  if (paths->imu_path.empty()) {
    status = use(FindImuTopic(bag_path, topics, names.imu), &paths->imu_path);
  }
  if (status.ok() && paths->wheel_path.empty() && calibration.has_wheel) {
    status = use(
        FindWheelTopic(bag_path, topics, names.wheel, calibration.wheel_type),
        &paths->wheel_path);
  }
  if (status.ok() && paths->gnss_path.empty()) {
    status =
        use(FindGnssTopic(bag_path, topics, names.gnss), &paths->gnss_path);
  }
  if (!status.ok()) return status;
  if (!paths->imu_path.empty() || !paths->wheel_path.empty() ||
      !paths->gnss_path.empty()) {
    return status;
  }
  return Status::Error(bag_path +
                       ": no topic of type sensor_msgs/Imu or NavSatFix, nor "
                       "of the wheels that the calibration has");
}

void KeepNearPairs(const std::vector<ImageStamp>& stamps,
                   std::vector<ScenePair>* pairs) {
  std::map<image_t, int> ranks;
  for (size_t i = 0; i < stamps.size(); ++i) ranks[stamps[i].image_id] = i;
  const auto is_far = [&](const ScenePair& pair) {
    const auto rank1 = ranks.find(pair.image_id1);
    const auto rank2 = ranks.find(pair.image_id2);
    return rank1 == ranks.end() || rank2 == ranks.end() ||
           std::abs(rank1->second - rank2->second) > kMaxVisualGap;
  };
  pairs->erase(std::remove_if(pairs->begin(), pairs->end(), is_far),
               pairs->end());
}

// The median angle between the rays of a pair's matches [rad].
double MedianMotion(const GlobalCorrespondences& correspondences,
                    const ImagePair& pair) {
  const std::vector<Bearing>& first =
      correspondences.bearings.at(pair.image_id1);
  const std::vector<Bearing>& second =
      correspondences.bearings.at(pair.image_id2);
  std::vector<double> angles;
  for (const FeatureMatch& match : correspondences.matches.at(pair)) {
    const Eigen::Vector3d& ray1 = first[match.point2D_idx1].direction;
    const Eigen::Vector3d& ray2 = second[match.point2D_idx2].direction;
    angles.push_back(std::atan2(ray1.cross(ray2).norm(), ray1.dot(ray2)));
  }
  return UpperMedian(&angles);
}

// The relative rotations of the scene's pairs.
std::vector<VisualRotation> ComputeVisualRotations(SceneData scene) {
  GlobalCorrespondences correspondences;
  for (const auto& [image_id, image] : scene.images) {
    correspondences.bearings[image_id] =
        ComputeBearings(scene.cameras.at(image.camera_id), image.keypoints);
  }
  ViewGraph graph =
      BuildInitialViewGraph(scene, correspondences.bearings).graph;
  for (ScenePair& pair : scene.pairs) {
    correspondences.matches[ImagePair(pair.image_id1, pair.image_id2)] =
        std::move(pair.inlier_matches);
  }
  // Verification fits a pose to few matches; on a straight road its noise would
  // hide the small rotations of the machine. There are few pairs here, so each
  // can use more matches than in the global stage, and a loss at the keypoints'
  // noise, since moving objects often have hardly larger errors. With both,
  // rotations around three images close four times better.
  RelativePoseRefinementOptions refinement;
  refinement.max_num_matches = 1000;
  refinement.loss_scale_px = kMinKeypointSigmaPx;
  refinement.max_num_iterations = 12;
  RefineRelativePoses(refinement, correspondences, {}, &graph);
  std::vector<VisualRotation> rotations;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (!edge.IsKept() || !edge.has_rotation) continue;
    rotations.push_back({edge.image_id1, edge.image_id2,
                         edge.cam2_from_cam1.rotation, edge.num_inliers,
                         MedianMotion(correspondences, edge.Pair())});
  }
  return rotations;
}

StatusOr<SceneData> ReadScene(const std::string& database_path) {
  SceneDataOptions options;
  options.use_original_two_view_geometries = true;
  // Priors are about to be replaced, even if they are damaged.
  options.read_priors = false;
  StatusOr<SceneData> scene = ReadSceneData(database_path, options);
  if (!scene.ok()) return scene;
  if (scene->images.empty()) {
    return Status::Error("the database " + database_path +
                         " has no images; run COLMAP's feature_extractor "
                         "first");
  }
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    scene->rigs = ReadDatabaseFrames(&database).rigs;
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return scene;
}

// An error for estimates that no later command could use.
Status CheckEstimate(const PriorEstimate& estimate,
                     const std::map<image_t, std::string>& names) {
  constexpr char kRemedy[] =
      "; check the noise figures of the calibration, the AdaSfmPriors options "
      "and the logs' readings";
  for (const RelativePosePrior& prior : estimate.priors) {
    const auto variances = prior.covariance.diagonal().array();
    if (prior.cam2_from_cam1.translation.allFinite() &&
        std::abs(prior.cam2_from_cam1.rotation.norm() - 1.0) < 1e-6 &&
        !prior.covariance.hasNaN() && (variances >= 0.0).all()) {
      continue;
    }
    return Status::Error(
        "the prior between the images " + names.at(prior.image_id1) + " and " +
        names.at(prior.image_id2) + " is not finite" + kRemedy);
  }
  for (const InertialMotion& motion : estimate.inertial_motions) {
    if (motion.dt_s > 0.0 && motion.delta_velocity.allFinite() &&
        motion.delta_position.allFinite() &&
        motion.velocity_by_bias.allFinite() &&
        motion.position_by_bias.allFinite() &&
        (!motion.by_wheels || (motion.by_wheels->translation.allFinite() &&
                               motion.by_wheels->covariance.allFinite()))) {
      continue;
    }
    return Status::Error("what the IMU integrates between the images " +
                         names.at(motion.image_id1) + " and " +
                         names.at(motion.image_id2) + " is not finite" +
                         kRemedy);
  }
  for (const auto& [image_id, gravity_in_cam] : estimate.gravity_in_cam) {
    if (std::abs(gravity_in_cam.norm() - 1.0) < 1e-6) continue;
    return Status::Error("the gravity of image " + names.at(image_id) +
                         " is not finite" + kRemedy);
  }
  const SensorSummary& summary = estimate.summary;
  if (std::isfinite(summary.distance_m) && std::isfinite(summary.wheel_scale) &&
      std::isfinite(summary.drift_per_100m_m)) {
    return Status::Ok();
  }
  return Status::Error(std::string("the estimate of the drive is not finite") +
                       kRemedy);
}

// None where neither a gyroscope nor wheels measure rotation.
std::optional<Eigen::Matrix3d> BiasCovarianceInCam(
    const SensorSummary& summary, const SensorCalibration& calibration) {
  if (summary.gyroscope_bias_covariance.isZero(0.0)) return std::nullopt;
  const Eigen::Matrix3d rotation =
      calibration.cam_from_imu.rotation.toRotationMatrix();
  const Eigen::Matrix3d covariance =
      rotation * summary.gyroscope_bias_covariance * rotation.transpose();
  return 0.5 * (covariance + covariance.transpose());
}

// The poses of the images, by a trajectory's times or by a model's names.
StatusOr<std::map<image_t, Rigid3d>> ReadTrajectoryPoses(
    const PriorImportPaths& paths, const SensorCalibration& calibration,
    const SceneData& scene, const std::vector<ImageStamp>& stamps,
    double max_gap_s) {
  const std::string& path = paths.trajectory_path;
  std::map<image_t, Rigid3d> poses;
  if (std::filesystem::is_directory(path)) {
    const StatusOr<colmap::Reconstruction> model = ReadModel(path);
    if (!model.ok()) return model.status();
    const ImageFinder finder = BuildImageFinder(scene);
    for (const auto& [model_id, cam_from_world] : CamsFromWorld(*model)) {
      const image_t image_id = finder.Find(model->Image(model_id).Name());
      if (image_id != kInvalidImageId) poses[image_id] = cam_from_world;
    }
  } else {
    const StatusOr<std::vector<OdometryPose>> trajectory = ReadOdometry(path);
    if (!trajectory.ok()) return trajectory.status();
    poses = InterpolateTrajectory(
        *trajectory, calibration.cam_from_imu,
        NsFromSeconds(calibration.timeshift_cam_imu_s), stamps, max_gap_s);
  }
  if (poses.size() > 1) return poses;
  return Status::Error(path + ": gives poses to " +
                       std::to_string(poses.size()) + " of " +
                       std::to_string(stamps.size()) +
                       " images; compare its names or its clock with the "
                       "images'");
}

bool HasMotionLogs(const PriorImportPaths& paths) {
  return !paths.imu_path.empty() || !paths.wheel_path.empty();
}

StatusOr<SensorCalibration> ReadCalibrationIfGiven(const std::string& path) {
  if (path.empty()) return SensorCalibration();
  return ReadSensorCalibration(path);
}

// Imports positions or a rig, without logs of motion.
StatusOr<PriorImport> ImportWithoutMotion(const PriorImportPaths& paths,
                                          const PriorImportOptions& options) {
  const Stopwatch watch;
  StatusOr<SensorCalibration> calibration =
      ReadCalibrationIfGiven(paths.sensors_path);
  if (!calibration.ok()) return calibration.status();
  const StatusOr<SceneData> scene = ReadScene(paths.database_path);
  if (!scene.ok()) return scene.status();
  PriorImport import;
  Status status = FindRig(options.rig, *scene, &*calibration, &import);
  if (!status.ok()) return status;
  // Positions stored in the database need no times.
  StatusOr<std::vector<ImageStamp>> stamps = std::vector<ImageStamp>();
  if (paths.gnss_path != kStoredPositionsPath ||
      !paths.image_times_path.empty() || !import.tables.rig_cameras.empty()) {
    stamps = StampFrames(paths, *scene, &import);
  }
  if (!stamps.ok()) return stamps.status();
  status = ImportPositions(paths, options.positions, *calibration, *scene,
                           *stamps, &import);
  if (!status.ok()) return status;
  import.summary.num_images = stamps->size();
  import.seconds = watch.Seconds();
  return import;
}

// Computes priors from a trajectory, without logs and without a smoother.
StatusOr<PriorImport> ImportTrajectory(const PriorImportPaths& paths,
                                       const PriorImportOptions& options) {
  if (HasMotionLogs(paths) || !paths.bag_path.empty()) {
    return Status::Error(
        "--trajectory_path stands for all logs; to smooth a trajectory "
        "with an IMU give it as --wheel_path of type odometry");
  }
  const Stopwatch watch;
  const StatusOr<SceneData> scene = ReadScene(paths.database_path);
  if (!scene.ok()) return scene.status();
  StatusOr<SensorCalibration> calibration =
      ReadCalibrationIfGiven(paths.sensors_path);
  if (!calibration.ok()) return calibration.status();
  PriorImport import;
  Status status = FindRig(options.rig, *scene, &*calibration, &import);
  if (!status.ok()) return status;
  const StatusOr<std::vector<ImageStamp>> stamps =
      StampFrames(paths, *scene, &import);
  if (!stamps.ok()) return stamps.status();
  const StatusOr<std::map<image_t, Rigid3d>> poses = ReadTrajectoryPoses(
      paths, *calibration, *scene, *stamps, options.trajectory.max_gap_s);
  if (!poses.ok()) return poses.status();
  import.tables.priors =
      ComputeTrajectoryPriors(*stamps, *poses, options.trajectory);
  status = ImportPositions(paths, options.positions, *calibration, *scene,
                           *stamps, &import);
  if (!status.ok()) return status;
  SensorSummary& summary = import.summary;
  summary.num_images = stamps->size();
  summary.num_images_in_logs = poses->size();
  summary.num_priors = import.tables.priors.size();
  summary.prior_ratio = static_cast<double>(summary.num_priors) /
                        std::max<size_t>(1, stamps->size() - 1);
  for (const RelativePosePrior& prior : import.tables.priors) {
    summary.distance_m += prior.cam2_from_cam1.translation.norm();
  }
  import.seconds = watch.Seconds();
  return import;
}

}  // namespace

bool PriorImportOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmPriors", error)
             .PositiveOrMinusOne("max_memory_gb", max_memory_gb)
             .AllHold() &&
         rig.IsValid(error) && estimation.IsValid(error) &&
         trajectory.IsValid(error) && positions.IsValid(error);
}

StatusOr<PriorImport> ComputePriorImport(const PriorImportPaths& given_paths,
                                         const PriorImportOptions& options) {
  PriorImportPaths paths = given_paths;
  Status status = CheckDatabase(paths.database_path);
  if (!status.ok()) return status;
  if (!paths.trajectory_path.empty()) return ImportTrajectory(paths, options);
  if (!HasMotionLogs(paths) && paths.bag_path.empty()) {
    const StatusOr<SensorCalibration> calibration =
        ReadCalibrationIfGiven(paths.sensors_path);
    if (!calibration.ok()) return calibration.status();
    if (!paths.gnss_path.empty() || !calibration->other_cams_from_imu.empty()) {
      return ImportWithoutMotion(paths, options);
    }
    return Status::Error(
        "no sensor log; give --imu_path, --wheel_path or both, --gnss_path, "
        "--bag_path or --trajectory_path, or the --sensors_path of a rig of "
        "cameras");
  }
  if (paths.sensors_path.empty()) {
    return Status::Error(
        "sensor logs need the calibration of the sensors; give --sensors_path");
  }
  StatusOr<SensorCalibration> calibration =
      ReadSensorCalibration(paths.sensors_path);
  if (!calibration.ok()) return calibration.status();
  const Stopwatch watch;
  if (!paths.bag_path.empty()) status = UseBag(*calibration, &paths);
  if (!status.ok()) return status;
  if (!HasMotionLogs(paths)) return ImportWithoutMotion(paths, options);
  PriorImport import;
  SensorLogs logs;
  status = ReadSensorLogs(paths, *calibration, &logs, &import);
  if (!status.ok()) return status;
  StatusOr<SceneData> scene = ReadScene(paths.database_path);
  if (!scene.ok()) return scene.status();

  status = FindRig(options.rig, *scene, &*calibration, &import);
  if (!status.ok()) return status;
  const StatusOr<std::vector<ImageStamp>> stamps =
      StampFrames(paths, *scene, &import);
  if (!stamps.ok()) return stamps.status();
  status = ImportPositions(paths, options.positions, *calibration, *scene,
                           *stamps, &import);
  if (!status.ok()) return status;
  std::map<image_t, std::string> names;
  for (const ImageStamp& stamp : *stamps) names[stamp.image_id] = stamp.name;
  for (const CalibratedFocalLength& calibrated :
       CalibrateFocalLengths(options.focal_lengths, &*scene)) {
    import.warnings.push_back(DescribeFocalLength(calibrated));
  }
  KeepNearPairs(*stamps, &scene->pairs);
  const std::vector<VisualRotation> rotations =
      ComputeVisualRotations(std::move(scene).value());
  import.num_visual_rotations = rotations.size();

  StatusOr<PriorEstimate> estimate = EstimatePriors(
      *stamps, logs, *calibration, rotations, options.estimation);
  if (!estimate.ok()) return estimate.status();
  status = CheckEstimate(*estimate, names);
  if (!status.ok()) return status;
  import.tables.priors = std::move(estimate->priors);
  import.tables.inertial_motions = std::move(estimate->inertial_motions);
  for (const auto& [image_id, gravity_in_cam] : estimate->gravity_in_cam) {
    import.tables.gravity.push_back({image_id, gravity_in_cam});
  }
  import.tables.gyroscope_bias_covariance =
      BiasCovarianceInCam(estimate->summary, *calibration);
  import.tables.length_drift_ratio = estimate->summary.length_drift_ratio;
  if (estimate->summary.wheel_scale_sigma > 0.0 &&
      options.estimation.fusion.wheel_scale_sigma > 0.0) {
    import.tables.wheel_scale = {estimate->summary.wheel_scale,
                                 estimate->summary.wheel_scale_sigma,
                                 options.estimation.fusion.wheel_scale_sigma};
  }
  import.summary = std::move(estimate->summary);
  import.warnings.insert(import.warnings.end(), import.summary.warnings.begin(),
                         import.summary.warnings.end());
  import.seconds = watch.Seconds();
  return import;
}

}  // namespace adasfm
