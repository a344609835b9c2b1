// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/trajectory_priors.h"

#include <algorithm>
#include <optional>

#include "core/interpolate_pose.h"
#include "core/option_checker.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Least errors of a trajectory: rounding, rolling shutter, clocks.
constexpr double kMinSigmaM = 1e-3;
constexpr double kMinSigmaRad = DegToRad(0.02);
constexpr double kRotationSigmaRatio = 0.01;

}  // namespace

bool TrajectoryPriorOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmTrajectory", error)
      .Positive({{"sigma_m_per_m", sigma_m_per_m},
                 {"sigma_deg_per_m", sigma_deg_per_m},
                 {"max_gap_s", max_gap_s}})
      .AllHold();
}

std::map<image_t, Rigid3d> InterpolateTrajectory(
    const std::vector<OdometryPose>& trajectory, const Rigid3d& cam_from_body,
    timestamp_t timeshift_ns, const std::vector<ImageStamp>& images,
    double max_gap_s) {
  std::map<image_t, Rigid3d> poses;
  for (const ImageStamp& image : images) {
    const std::optional<Rigid3d> world_from_body = InterpolatePose(
        trajectory, image.timestamp_ns + timeshift_ns, max_gap_s);
    if (!world_from_body) continue;
    poses[image.image_id] = cam_from_body * world_from_body->Inverse();
  }
  return poses;
}

std::vector<RelativePosePrior> ComputeTrajectoryPriors(
    const std::vector<ImageStamp>& images,
    const std::map<image_t, Rigid3d>& cams_from_world,
    const TrajectoryPriorOptions& options) {
  std::vector<RelativePosePrior> priors;
  for (size_t i = 1; i < images.size(); ++i) {
    const auto first = cams_from_world.find(images[i - 1].image_id);
    const auto second = cams_from_world.find(images[i].image_id);
    if (first == cams_from_world.end() || second == cams_from_world.end()) {
      continue;
    }
    RelativePosePrior prior;
    prior.image_id1 = first->first;
    prior.image_id2 = second->first;
    prior.dt_ns = images[i].timestamp_ns - images[i - 1].timestamp_ns;
    prior.cam2_from_cam1 = ComputeCam2FromCam1(first->second, second->second);
    prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
    const double distance_m = prior.cam2_from_cam1.translation.norm();
    const double turn_rad = LogSo3(prior.cam2_from_cam1.rotation).norm();
    const double sigma_m =
        std::max(kMinSigmaM, options.sigma_m_per_m * distance_m);
    const double sigma_rad =
        std::max({kMinSigmaRad, DegToRad(options.sigma_deg_per_m) * distance_m,
                  kRotationSigmaRatio * turn_rad});
    prior.covariance.setZero();
    prior.covariance.diagonal().head<3>().setConstant(sigma_rad * sigma_rad);
    prior.covariance.diagonal().tail<3>().setConstant(sigma_m * sigma_m);
    priors.push_back(prior);
  }
  return priors;
}

}  // namespace adasfm
