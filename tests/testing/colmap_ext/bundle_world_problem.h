// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/sim3d.h"
#include "tests/testing/colmap_ext/bundle_world.h"

namespace adasfm {

// Adjustments of a bundle world, and their errors.

inline PriorBundleAdjustmentProblem ProblemOfAll(
    const colmap::Reconstruction& reconstruction) {
  PriorBundleAdjustmentProblem problem;
  for (const image_t id : reconstruction.RegImageIds()) {
    problem.images.insert(id);
  }
  return problem;
}

// The true motion between consecutive images, as priors.
inline std::vector<PosePriorEdge> TruePriors(
    const BundleWorldOptions& options) {
  std::vector<PosePriorEdge> edges;
  for (int i = 0; i + 1 < options.num_images; ++i) {
    PosePriorEdge edge;
    edge.image_id1 = i + 1;
    edge.image_id2 = i + 2;
    edge.cam2_from_cam1 = ComputeCam2FromCam1(BundleWorldPose(options, i),
                                              BundleWorldPose(options, i + 1));
    edge.rotation_sigma_rad = 2e-3;
    edge.direction_sigma_rad = 0.02;
    edge.length_sigma_m = 0.02;
    edges.push_back(edge);
  }
  return edges;
}

// Bends the model: winds its x axis around a circle.
inline void Bend(double radius_m, colmap::Reconstruction* reconstruction) {
  const auto bend = [radius_m](const Eigen::Vector3d& X) {
    const double angle_rad = X.x() / radius_m;
    const double to_center_m = radius_m - X.y();
    return Eigen::Vector3d(to_center_m * std::sin(angle_rad),
                           radius_m - to_center_m * std::cos(angle_rad), X.z());
  };
  for (const image_t id : reconstruction->RegImageIds()) {
    colmap::Image& image = reconstruction->Image(id);
    const Rigid3d pose = CamFromWorld(image);
    const Eigen::Vector3d center = pose.TargetOriginInSource();
    SetCamFromWorld(
        CamFromWorldWithCenter(
            pose.rotation * ExpSo3({0.0, 0.0, -center.x() / radius_m}),
            bend(center)),
        &image);
  }
  for (const auto point_id : reconstruction->Point3DIds()) {
    colmap::Point3D& point = reconstruction->Point3D(point_id);
    SetXyz(bend(XyzOf(point)), &point);
  }
}

// RMSE of the camera centres against the world's, without alignment.
inline double CenterError(const BundleWorldOptions& options,
                          const colmap::Reconstruction& reconstruction) {
  double sum = 0.0;
  for (const image_t id : reconstruction.RegImageIds()) {
    sum += (CamFromWorld(reconstruction.Image(id)).TargetOriginInSource() -
            BundleWorldPose(options, id - 1).TargetOriginInSource())
               .squaredNorm();
  }
  return std::sqrt(sum / reconstruction.NumRegImages());
}

// The same after the best similarity, whose scale is returned in `scale`.
inline double AlignedCenterError(const BundleWorldOptions& options,
                                 const colmap::Reconstruction& reconstruction,
                                 double* scale = nullptr) {
  std::vector<Eigen::Vector3d> estimated, truth;
  for (const image_t id : reconstruction.RegImageIds()) {
    estimated.push_back(
        CamFromWorld(reconstruction.Image(id)).TargetOriginInSource());
    truth.push_back(BundleWorldPose(options, id - 1).TargetOriginInSource());
  }
  Sim3d sim;
  EXPECT_TRUE(EstimateSim3d(estimated, truth, AlignmentOptions(), &sim));
  if (scale != nullptr) *scale = sim.scale;
  double sum = 0.0;
  for (size_t i = 0; i < truth.size(); ++i) {
    sum += (sim * estimated[i] - truth[i]).squaredNorm();
  }
  return std::sqrt(sum / truth.size());
}

inline PriorBundleAdjustmentOptions ConvergeFully() {
  PriorBundleAdjustmentOptions options;
  options.function_tolerance = 1e-12;
  options.max_num_iterations = 200;
  return options;
}

}  // namespace adasfm
