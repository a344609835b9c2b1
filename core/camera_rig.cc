// SPDX-License-Identifier: BSD-3-Clause
#include "core/camera_rig.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/median.h"
#include "core/nearest_rotation.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr size_t kMinNumFrames = 3;
// A frame's own relative pose is no better than this, whatever the frames'
// agreement says of their mean.
constexpr double kMinRotationSigmaRad = 1e-4;
constexpr double kMinTranslationSigmaRatio = 1e-3;

// cam_from_reference of a camera, one per frame of both.
using Samples = std::map<camera_t, std::vector<Rigid3d>>;

Samples CollectSamples(const std::map<image_t, Rigid3d>& cams_from_world,
                       const CameraRigs& rigs) {
  std::map<uint32_t, image_t> references;
  for (const auto& [image_id, image] : rigs.images) {
    if (rigs.cameras.at(image.camera_id).is_reference) {
      references[image.frame_id] = image_id;
    }
  }
  Samples samples;
  for (const auto& [image_id, image] : rigs.images) {
    const auto reference = references.find(image.frame_id);
    if (rigs.cameras.at(image.camera_id).cam_from_rig.has_value() ||
        reference == references.end()) {
      continue;
    }
    const auto pose = cams_from_world.find(image_id);
    const auto reference_pose = cams_from_world.find(reference->second);
    if (pose == cams_from_world.end() ||
        reference_pose == cams_from_world.end()) {
      continue;
    }
    samples[image.camera_id].push_back(
        ComputeCam2FromCam1(reference_pose->second, pose->second));
  }
  return samples;
}

Rigid3d ComputeMiddle(const std::vector<Rigid3d>& samples) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d translation;
  for (const Rigid3d& sample : samples) {
    sum += sample.rotation.toRotationMatrix();
  }
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Rigid3d& sample : samples) {
      values.push_back(sample.translation(axis));
    }
    translation(axis) = UpperMedian(&values);
  }
  return Rigid3d(NearestRotation(sum), translation);
}

}  // namespace

std::map<uint32_t, image_t> FindFrameLeaders(const CameraRigs& rigs) {
  std::map<uint32_t, image_t> leaders;
  const auto rank = [&rigs](image_t image_id) {
    const camera_t camera_id = rigs.images.at(image_id).camera_id;
    return std::make_tuple(!rigs.cameras.at(camera_id).is_reference, camera_id,
                           image_id);
  };
  for (const auto& [image_id, image] : rigs.images) {
    if (!rigs.cameras.at(image.camera_id).cam_from_rig.has_value()) continue;
    const auto [leader, is_new] = leaders.emplace(image.frame_id, image_id);
    if (!is_new && rank(image_id) < rank(leader->second)) {
      leader->second = image_id;
    }
  }
  return leaders;
}

std::vector<RelativePosePrior> ComputeFramePriors(const CameraRigs& rigs) {
  const std::map<uint32_t, image_t> leaders = FindFrameLeaders(rigs);
  std::map<std::pair<uint32_t, image_t>, RelativePosePrior> priors;
  for (const auto& [image_id, image] : rigs.images) {
    const auto leader = leaders.find(image.frame_id);
    const RigCamera& camera = rigs.cameras.at(image.camera_id);
    if (leader == leaders.end() || leader->second == image_id ||
        !camera.cam_from_rig.has_value()) {
      continue;
    }
    const RigCamera& leader_camera =
        rigs.cameras.at(rigs.images.at(leader->second).camera_id);
    RelativePosePrior prior;
    prior.image_id1 = leader->second;
    prior.image_id2 = image_id;
    prior.cam2_from_cam1 =
        ComputeCam2FromCam1(*leader_camera.cam_from_rig, *camera.cam_from_rig);
    prior.covariance.diagonal().head<3>().setConstant(
        camera.rotation_sigma_rad * camera.rotation_sigma_rad);
    prior.covariance.diagonal().tail<3>().setConstant(
        camera.translation_sigma_m * camera.translation_sigma_m);
    prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
    priors[{image.frame_id, image_id}] = prior;
  }
  std::vector<RelativePosePrior> result;
  for (const auto& [key, prior] : priors) result.push_back(prior);
  return result;
}

void EstimateUnknownRigCameras(
    const std::map<image_t, Rigid3d>& cams_from_world, CameraRigs* rigs) {
  for (const auto& [camera_id, samples] :
       CollectSamples(cams_from_world, *rigs)) {
    if (samples.size() < kMinNumFrames) continue;
    RigCamera& camera = rigs->cameras.at(camera_id);
    const Rigid3d middle = ComputeMiddle(samples);
    std::vector<double> angles, distances;
    for (const Rigid3d& sample : samples) {
      angles.push_back(AngleBetweenRad(sample.rotation, middle.rotation));
      distances.push_back((sample.translation - middle.translation).norm());
    }
    const double root = std::sqrt(static_cast<double>(samples.size()));
    camera.cam_from_rig = middle;
    camera.rotation_sigma_rad =
        std::max(kMinRotationSigmaRad, UpperMedian(&angles) / root);
    camera.translation_sigma_m =
        std::max(kMinTranslationSigmaRatio * middle.translation.norm(),
                 UpperMedian(&distances) / root);
  }
}

}  // namespace adasfm
