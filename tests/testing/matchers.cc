// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/matchers.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/so3.h"

namespace adasfm {

testing::AssertionResult RotationsNear(const Eigen::Quaterniond& a,
                                       const Eigen::Quaterniond& b,
                                       double tolerance_rad) {
  const double angle_rad = AngleBetweenRad(a, b);
  // Written so that NaN fails.
  if (angle_rad <= tolerance_rad) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "rotations differ by " << angle_rad
                                     << " rad, allowed " << tolerance_rad;
}

testing::AssertionResult PosesNear(const Rigid3d& a_from_world,
                                   const Rigid3d& b_from_world,
                                   double tolerance_rad, double tolerance_m) {
  const testing::AssertionResult rotations = RotationsNear(
      a_from_world.rotation, b_from_world.rotation, tolerance_rad);
  if (!rotations) return rotations;
  const double distance_m = (a_from_world.TargetOriginInSource() -
                             b_from_world.TargetOriginInSource())
                                .norm();
  if (distance_m <= tolerance_m) return testing::AssertionSuccess();
  return testing::AssertionFailure()
         << "centres differ by " << distance_m << " m, allowed " << tolerance_m;
}

AlignedErrors ComputeAlignedErrors(
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::map<image_t, Rigid3d>& true_cams_from_world,
    const AlignmentOptions& options) {
  std::vector<Eigen::Vector3d> centers;
  std::vector<Eigen::Vector3d> true_centers;
  std::vector<std::pair<Eigen::Quaterniond, Eigen::Quaterniond>> rotations;
  for (const auto& [image_id, cam_from_world] : cams_from_world) {
    const auto truth = true_cams_from_world.find(image_id);
    if (truth == true_cams_from_world.end()) continue;
    centers.push_back(cam_from_world.TargetOriginInSource());
    true_centers.push_back(truth->second.TargetOriginInSource());
    rotations.emplace_back(cam_from_world.rotation, truth->second.rotation);
  }
  AlignedErrors errors;
  errors.num_images = centers.size();
  Sim3d true_from_estimate;
  if (!EstimateSim3d(centers, true_centers, options, &true_from_estimate)) {
    errors.rmse_m = errors.max_m = errors.mean_rotation_rad = NAN;
    return errors;
  }
  errors.scale = true_from_estimate.scale;
  for (size_t i = 0; i < centers.size(); ++i) {
    const double error_m =
        (true_from_estimate * centers[i] - true_centers[i]).norm();
    errors.rmse_m += error_m * error_m / centers.size();
    // std::max would lose a NaN.
    if (!(error_m <= errors.max_m)) errors.max_m = error_m;
    errors.mean_rotation_rad +=
        AngleBetweenRad(
            Eigen::Quaterniond(rotations[i].first *
                               true_from_estimate.rotation.conjugate()),
            rotations[i].second) /
        centers.size();
  }
  errors.rmse_m = std::sqrt(errors.rmse_m);
  return errors;
}

double ComputeAlignedRotationError(
    const std::map<image_t, Eigen::Quaterniond>& cams_from_world,
    const std::map<image_t, Eigen::Quaterniond>& true_cams_from_world) {
  // Aligns the worlds by the chordal mean of R_i^T R_i,true.
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const auto& [image_id, rotation] : cams_from_world) {
    sum += (rotation.conjugate() * true_cams_from_world.at(image_id))
               .toRotationMatrix();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
  if (turn.determinant() < 0.0) {
    turn = svd.matrixU() * Eigen::Vector3d(1, 1, -1).asDiagonal() *
           svd.matrixV().transpose();
  }
  double mean_rad = 0.0;
  for (const auto& [image_id, rotation] : cams_from_world) {
    mean_rad +=
        AngleBetweenRad(Eigen::Quaterniond(rotation * Eigen::Quaterniond(turn)),
                        true_cams_from_world.at(image_id)) /
        cams_from_world.size();
  }
  return mean_rad;
}

}  // namespace adasfm
