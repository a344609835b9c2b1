// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/cost_functions/rig_cost.h"

#include <gtest/gtest.h>

#include <deque>

#include "colmap_ext/cost_functions/pose_prior_cost.h"
#include "colmap_ext/cost_functions/reprojection_cost.h"
#include "core/random.h"
#include "tests/testing/colmap_ext/bundle_world.h"

namespace adasfm {
namespace {

AdjustedPose RandomPose(Random* random, double distance) {
  AdjustedPose pose(Rigid3d(ExpSo3(random->GaussianVector(0.3)),
                            random->GaussianVector(distance)));
  for (double& parameter : pose.parameters) parameter = random->Gaussian(0.2);
  pose.Update();
  return pose;
}

// Two frames and two cams_from_rig; image k has frame k / 2 and camera k % 2.
struct Rig {
  explicit Rig(Random* random) {
    for (int k = 0; k < 2; ++k) frames.push_back(RandomPose(random, 2.0));
    for (int k = 0; k < 2; ++k)
      cams_from_rig.push_back(RandomPose(random, 0.5));
    images.resize(4);
    for (int k = 0; k < 4; ++k) {
      poses.push_back({&images[k], &frames[k / 2], &cams_from_rig[k % 2]});
    }
    Update();
  }
  void Update() {
    for (AdjustedPose& frame : frames) frame.Update();
    for (AdjustedPose& cam_from_rig : cams_from_rig) cam_from_rig.Update();
    for (RigPose& pose : poses) pose.Update();
  }
  std::deque<AdjustedPose> frames, cams_from_rig, images;
  std::vector<RigPose> poses;
};

void ExpectNumericJacobians(const RigCost& cost,
                            std::vector<double*> parameters, Rig* rig) {
  const std::vector<int> sizes(cost.parameter_block_sizes().begin(),
                               cost.parameter_block_sizes().end());
  ASSERT_EQ(sizes.size(), parameters.size());
  const int num_residuals = cost.num_residuals();
  std::vector<std::vector<double>> values;
  std::vector<double*> jacobians;
  for (const int size : sizes) values.emplace_back(num_residuals * size);
  for (auto& jacobian : values) jacobians.push_back(jacobian.data());
  std::vector<double> residuals(num_residuals), plus(residuals);
  cost.Evaluate(parameters.data(), residuals.data(), jacobians.data());
  constexpr double kStep = 1e-6;
  for (size_t block = 0; block < sizes.size(); ++block) {
    for (int col = 0; col < sizes[block]; ++col) {
      double& parameter = parameters[block][col];
      const double value = parameter;
      parameter = value + kStep;
      rig->Update();
      cost.Evaluate(parameters.data(), plus.data(), nullptr);
      parameter = value - kStep;
      rig->Update();
      cost.Evaluate(parameters.data(), residuals.data(), nullptr);
      parameter = value;
      rig->Update();
      for (int row = 0; row < num_residuals; ++row) {
        const double numeric = (plus[row] - residuals[row]) / (2.0 * kStep);
        EXPECT_NEAR(values[block][row * sizes[block] + col], numeric,
                    1e-5 * std::max(1.0, std::abs(numeric)))
            << "block " << block << " column " << col;
      }
    }
  }
}

TEST(RigCost, JacobiansEqualNumericOnes) {
  for (int seed = 0; seed < 10; ++seed) {
    Random random(seed);
    Rig rig(&random);
    PosePriorEdge edge;
    edge.cam2_from_cam1 =
        Rigid3d(ExpSo3(random.GaussianVector(0.3)), random.GaussianVector(2.0));
    edge.rotation_sigma_rad = edge.translation_sigma_m = 0.5;
    for (const auto term :
         {PosePriorCost::Term::kRotation, PosePriorCost::Term::kTranslation}) {
      // Two images of one camera, and of two cameras. Below: a pose that is
      // itself a frame.
      for (const auto& [i, j] : {std::pair(1, 3), std::pair(0, 3)}) {
        const PosePriorCost inner(edge, term, 1.0, rig.poses[i].pose,
                                  rig.poses[j].pose);
        const RigCost cost(&inner, {rig.poses[i], rig.poses[j]});
        EXPECT_EQ(cost.Blocks().size(), i == 1 ? 3u : 4u);
        ExpectNumericJacobians(cost, cost.Blocks(), &rig);
      }
      const RigPose reference{&rig.frames[0]};
      const PosePriorCost inner(edge, term, 1.0, reference.pose,
                                rig.poses[2].pose);
      const RigCost cost(&inner, {reference, rig.poses[2]});
      ExpectNumericJacobians(cost, cost.Blocks(), &rig);
    }
    NormalizedKeypoint keypoint;
    keypoint.whitened_from_normalized.setIdentity();
    const ReprojectionCost inner(keypoint, rig.poses[1].pose);
    const RigCost cost(&inner, {rig.poses[1]});
    Eigen::Vector3d point =
        rig.images[1].center +
        rig.images[1].rotation.transpose() * Eigen::Vector3d(1.0, -2.0, 8.0);
    std::vector<double*> parameters = cost.Blocks();
    parameters.push_back(point.data());
    ExpectNumericJacobians(cost, parameters, &rig);
  }
}

// The images of a street as frames of a stereo rig: each even image is that of
// the right camera in the frame that the image before it begins.
TEST(RigCost, AdjustmentKeepsFramesRigidAndFindsTheExtrinsics) {
  BundleWorldOptions options;
  options.num_images = 20;
  options.num_keypoints_per_image = 60;
  options.pixel_noise_px = 0.3;
  colmap::Reconstruction world = BuildBundleWorld(options);
  // The right images are placed as the rig has them, with keypoints to match.
  const Rigid3d cam1_from_cam0(ExpSo3(Eigen::Vector3d(0.01, -0.02, 0.01)),
                               Eigen::Vector3d(-0.6, 0.01, 0.02));
  Random random(3);
  colmap::Camera camera = world.Camera(1);
  camera.SetCameraId(2);
  world.AddCamera(camera);
  for (image_t image_id = 2; image_id <= 20; image_id += 2) {
    colmap::Image& image = world.Image(image_id);
    image.SetCameraId(2);
    SetCamFromWorld(cam1_from_cam0 * CamFromWorld(world.Image(image_id - 1)),
                    &image);
    for (point2D_t k = 0; k < image.NumPoints2D(); ++k) {
      colmap::Point2D& point2D = image.Point2D(k);
      if (!point2D.HasPoint3D()) continue;
      const Eigen::Vector3d x =
          CamFromWorld(image) * world.Point3D(point2D.Point3DId()).XYZ();
      point2D.SetXY(camera.WorldToImage(x.hnormalized()) +
                    random.GaussianVector(0.3).head<2>());
    }
  }
  std::map<image_t, Rigid3d> truth = CamsFromWorld(world);
  PerturbBundleWorld(0.003, 0.03, 5, &world);

  PriorBundleAdjustmentProblem problem;
  RigCamera& reference = problem.rigs.cameras[1];
  reference.is_reference = true;
  reference.cam_from_rig = Rigid3d();
  // The calibration is off by some of its sigmas.
  RigCamera& other = problem.rigs.cameras[2];
  other.cam_from_rig =
      Rigid3d(ExpSo3(Eigen::Vector3d(0.002, -0.002, 0.002)), {0.0, 0.0, 0.0}) *
      cam1_from_cam0;
  other.rotation_sigma_rad = 2e-3;
  for (image_t image_id = 1; image_id <= 20; ++image_id) {
    problem.images.insert(image_id);
    problem.rigs.images[image_id] = {image_id % 2 == 1 ? 1u : 2u,
                                     (image_id + 1) / 2};
  }
  for (const RelativePosePrior& prior : ComputeFramePriors(problem.rigs)) {
    problem.priors.push_back(PosePriorEdgeFromPrior(prior));
  }
  const PriorBundleAdjustmentSummary summary =
      AdjustBundle(PriorBundleAdjustmentOptions(), problem, &world);
  ASSERT_TRUE(summary.success) << summary.message;
  const auto relative = [&world](image_t image_id) {
    return ComputeCam2FromCam1(CamFromWorld(world.Image(image_id)),
                               CamFromWorld(world.Image(image_id + 1)));
  };
  for (image_t image_id = 1; image_id < 20; image_id += 2) {
    EXPECT_LT((relative(image_id).ToMatrix() - relative(1).ToMatrix()).norm(),
              1e-12);
  }
  // Ten frames of 60 keypoints of 0.3 px determine the rotation far better than
  // the 2 mrad per axis by which the calibration is off.
  EXPECT_LT(AngleBetweenRad(relative(1).rotation, cam1_from_cam0.rotation),
            3e-4);
  EXPECT_NEAR(relative(1).translation.norm(), cam1_from_cam0.translation.norm(),
              4 * 2e-3);
  // Only the baseline determines the length of the drive.
  const double length =
      (truth.at(1).TargetOriginInSource() - truth.at(19).TargetOriginInSource())
          .norm();
  const double adjusted = (CamFromWorld(world.Image(1)).TargetOriginInSource() -
                           CamFromWorld(world.Image(19)).TargetOriginInSource())
                              .norm();
  EXPECT_NEAR(adjusted / length, 1.0, 0.02);
}

}  // namespace
}  // namespace adasfm
