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
// Lower bounds of the sigmas: errors of the relative pose in a single frame,
// however well the frames agree.
constexpr double kMinRotationSigmaRad = 1e-4;
constexpr double kMinTranslationSigmaRatio = 1e-3;

// cam_from_reference of a camera, one per frame with poses of both cameras.
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

Eigen::Matrix<double, 6, 6> CovarianceOf(const RigCamera& camera) {
  Eigen::Matrix<double, 6, 1> sigmas;
  sigmas << Eigen::Vector3d::Constant(camera.rotation_sigma_rad),
      Eigen::Vector3d::Constant(camera.translation_sigma_m);
  return sigmas.cwiseAbs2().asDiagonal();
}

// Covariance of the camera's pose relative to the leader's, R = S2 S1^T and
// t = b2 - R b1, by the errors of both poses; the reference camera has none.
Eigen::Matrix<double, 6, 6> CovarianceFrom(const RigCamera& leader,
                                           const RigCamera& camera) {
  if (leader.is_reference) return CovarianceOf(camera);
  const Eigen::Matrix3d rotation = (camera.cam_from_rig->rotation *
                                    leader.cam_from_rig->rotation.conjugate())
                                       .toRotationMatrix();
  const Eigen::Vector3d& arm = leader.cam_from_rig->translation;
  Eigen::Matrix<double, 6, 6> by_camera =
      Eigen::Matrix<double, 6, 6>::Identity();
  by_camera.bottomLeftCorner<3, 3>() = Hat(rotation * arm);
  Eigen::Matrix<double, 6, 6> by_leader = Eigen::Matrix<double, 6, 6>::Zero();
  by_leader.topLeftCorner<3, 3>() = -rotation;
  by_leader.bottomLeftCorner<3, 3>() = -rotation * Hat(arm);
  by_leader.bottomRightCorner<3, 3>() = -rotation;
  return by_camera * CovarianceOf(camera) * by_camera.transpose() +
         by_leader * CovarianceOf(leader) * by_leader.transpose();
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
    prior.covariance = CovarianceFrom(leader_camera, camera);
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
