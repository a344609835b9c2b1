// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/global_warnings.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "colmap_ext/scene/drives.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Fewer pairs between two parts are not reported.
constexpr int kMinNumReportedPairs = 3;

std::string DescribeUnconfirmedClosure(const SceneData& scene,
                                       const SegmentClosure& closure) {
  std::ostringstream text;
  text << "a trajectory segment of " << closure.num_images
       << " images is connected to another only by " << closure.num_pairs
       << " pairs like " << scene.images.at(closure.image_id1).name << " and "
       << scene.images.at(closure.image_id2).name
       << "; neither sensors nor a second place confirm them, so they may be "
          "places that look alike: the segments become two models "
          "(--AdaSfmGlobal.split_unconfirmed_closures 0 joins them)";
  return text.str();
}

std::string DescribeClosureByVision(const SceneData& scene,
                                    const SegmentClosure& closure) {
  std::ostringstream text;
  text << "a trajectory segment of " << closure.num_images
       << " images is joined to another by " << closure.num_pairs
       << " pairs like " << scene.images.at(closure.image_id1).name << " and "
       << scene.images.at(closure.image_id2).name
       << ", which vision alone confirms: if these are streets that look alike "
          "around a corner the model is folded; look at both photos, or add "
          "sensors that cover the gap";
  return text.str();
}

bool HasSeveralDrives(const SceneData& scene) {
  return std::any_of(
      scene.priors.begin(), scene.priors.end(),
      [](const RelativePosePrior& prior) { return prior.drive > 0; });
}

void AppendLostImages(const SceneData& scene, const GlobalStageResult& result,
                      std::vector<std::string>* warnings) {
  size_t num_images = 0;
  for (const CoarseModel& model : result.models) {
    num_images += model.reconstruction.NumRegImages();
  }
  if (num_images < scene.images.size()) {
    warnings->push_back(
        std::to_string(scene.images.size() - num_images) + " of " +
        std::to_string(scene.images.size()) +
        " images are in no model: neither verified matches nor sensors "
        "connect them to others");
  }
  if (result.models.size() > 1) {
    warnings->push_back(
        "the images fall apart into " + std::to_string(result.models.size()) +
        " unconnected models, the largest of " +
        std::to_string(result.models[0].reconstruction.NumRegImages()) +
        " images: match more pairs, or add sensors that cover the gaps");
  }
}

// drive_name: empty for the only drive.
void AppendCameraImuWarning(const std::string& drive_name,
                            const CameraImuRotationReport& camera_imu,
                            std::vector<std::string>* warnings) {
  // Below this an error of the direction of driving is as likely, by the sigma
  // that the import states for it.
  constexpr double kMinNumSigmas = 3.0;
  if (!camera_imu.corrected ||
      camera_imu.rotation_rad.norm() < kMinNumSigmas * camera_imu.sigma_rad) {
    return;
  }
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << "the camera-IMU rotation ";
  if (!drive_name.empty()) text << "of the drive from " << drive_name << ' ';
  text << "is " << RadToDeg(camera_imu.rotation_rad.norm()) << " +- "
       << RadToDeg(camera_imu.sigma_rad)
       << " deg off what T_cam_imu says (turned by "
       << RadToDeg(camera_imu.rotation_rad.x()) << ", "
       << RadToDeg(camera_imu.rotation_rad.y()) << ", "
       << RadToDeg(camera_imu.rotation_rad.z())
       << " deg about the camera's x, y, z); priors were corrected. Put "
          "true_from_stated of summary.json, times T_cam_imu, into "
          "--sensors_path";
  warnings->push_back(text.str());
}

// drive_name: empty for the only drive.
void AppendTimeShiftWarning(const std::string& drive_name, double shift_s,
                            std::vector<std::string>* warnings) {
  // A smaller correction leaves no doubt in the model.
  constexpr double kMinShiftS = 0.01;
  if (std::abs(shift_s) < kMinShiftS) return;
  std::ostringstream text;
  text << std::fixed << std::setprecision(4) << "the camera's clock ";
  if (!drive_name.empty()) text << "of the drive from " << drive_name << ' ';
  text << "is off: add " << std::showpos << shift_s
       << " s to timeshift_cam_imu in --sensors_path";
  warnings->push_back(text.str());
}

void AppendGyroscopeWarning(const std::string& drive_name,
                            const Eigen::Vector3d& scales,
                            std::vector<std::string>* warnings) {
  // Small gyroscopes have less.
  constexpr double kMinScale = 0.02;
  const double largest = scales.cwiseAbs().maxCoeff();
  if (largest < kMinScale) return;
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the gyroscope ";
  if (!drive_name.empty()) text << "of the drive from " << drive_name << ' ';
  text << "errs by up to " << 100.0 * largest
       << " % of the rates, or the focal length by as much: calibrate them";
  warnings->push_back(text.str());
}

void AppendPriorWarnings(const CoarseModel& model,
                         std::vector<std::string>* warnings) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1);
  if (model.focal_length_error) {
    const FocalLengthError& error = *model.focal_length_error;
    const bool is_known =
        HasPriorFocalLength(model.reconstruction.Camera(error.camera_id));
    text << std::setprecision(2)
         << "vision and sensors agree on a focal length that is "
         << 100.0 * std::abs(error.ratio - 1.0) << " +- " << 100.0 * error.sigma
         << " % " << (error.ratio > 1.0 ? "longer" : "shorter")
         << " than the database says";
    if (model.reconstruction.NumCameras() > 1) {
      text << " of camera " << error.camera_id;
    }
    if (model.cameras_refined && !is_known) {
      text << "; it was refined, as it is not marked as known";
    } else {
      text << ": check the intrinsics, or have them refined "
              "(--AdaSfmGlobal.ba_refine_focal_length 1 and "
              "--AdaSfmMapper.refine_focal_length 1)";
    }
  } else if (!model.priors_agree) {
    text << "vision and sensors contradict each other (mean squared whitened "
            "residual of the priors: "
         << model.prior_chi2_per_dof << ", even with a keypoint sigma of "
         << model.keypoint_sigma_px
         << " px): check the intrinsics, T_cam_imu, timeshift_cam_imu and the "
            "noise figures of the sensors";
  } else {
    return;
  }
  warnings->push_back(text.str());
}

}  // namespace

std::vector<std::string> ListGlobalWarnings(const SceneData& scene,
                                            const GlobalStageResult& result) {
  std::vector<std::string> warnings;
  AppendLostImages(scene, result, &warnings);
  const CameraImuRotationReports& rotations = result.poses.camera_imu_rotations;
  for (const auto& [drive, camera_imu] : rotations) {
    AppendCameraImuWarning(
        rotations.size() > 1 ? DriveName(scene, drive) : std::string(),
        camera_imu, &warnings);
  }
  for (const auto& [drive, shift_s] : result.time_shifts) {
    AppendTimeShiftWarning(
        HasSeveralDrives(scene) ? DriveName(scene, drive) : std::string(),
        shift_s, &warnings);
  }
  for (const auto& [drive, scales] : result.gyroscope_scales) {
    AppendGyroscopeWarning(
        HasSeveralDrives(scene) ? DriveName(scene, drive) : std::string(),
        scales, &warnings);
  }
  for (const CoarseModel& model : result.models) {
    AppendPriorWarnings(model, &warnings);
    if (model.positions.failure.empty()) continue;
    warnings.push_back(
        "a model of " + std::to_string(model.reconstruction.NumRegImages()) +
        " images is not georeferenced: " + model.positions.failure);
  }
  for (const CoarseModel& model : result.models) {
    if (model.pair_agreement.IsSound()) continue;
    std::ostringstream text;
    text << std::fixed << std::setprecision(0)
         << "the coarse model contradicts vision: "
         << 100.0 * model.pair_agreement.share
         << " % of the verified pairs agree with its poses, "
         << 100.0 * model.pair_agreement.least_image_share
         << " % at the worst image; false pairs outweigh true ones, or the "
            "overlap is small: see the report (adasfm_reporter), add sensors "
            "or match more pairs";
    warnings.push_back(text.str());
  }
  const LoopClosureReport& loops = result.poses.loop_closures;
  for (const SegmentClosure& closure : loops.unconfirmed_closures) {
    if (loops.segments_were_split &&
        closure.num_pairs >= kMinNumReportedPairs) {
      warnings.push_back(DescribeUnconfirmedClosure(scene, closure));
    }
  }
  for (const SegmentClosure& closure : loops.closures_by_vision) {
    warnings.push_back(DescribeClosureByVision(scene, closure));
  }
  for (const CoarseComponent& component : result.poses.components) {
    for (const SegmentClosure& closure : component.unconfirmed_closures) {
      std::ostringstream text;
      text << closure.num_images
           << " images are connected to the rest at one place only ("
           << closure.num_pairs << " pairs like "
           << scene.images.at(closure.image_id1).name << " and "
           << scene.images.at(closure.image_id2).name
           << "); if these are two places that look alike the model is "
              "folded: add sensors (adasfm_prior_importer) or match more pairs";
      warnings.push_back(text.str());
    }
  }
  return warnings;
}

}  // namespace adasfm
