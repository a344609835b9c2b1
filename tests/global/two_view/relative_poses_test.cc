// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>

#include "core/so3.h"
#include "global/two_view/refine_relative_poses.h"
#include "global/two_view/relative_translation.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

std::map<image_t, Eigen::Quaterniond> TrueRotations(const TestScene& scene) {
  std::map<image_t, Eigen::Quaterniond> rotations;
  for (const auto& [image_id, pose] : scene.cams_from_world) {
    rotations[image_id] = pose.rotation;
  }
  return rotations;
}

Rigid3d TrueMotion(const TestScene& scene, const ViewGraphEdge& edge) {
  return ComputeCam2FromCam1(scene.cams_from_world.at(edge.image_id1),
                             scene.cams_from_world.at(edge.image_id2));
}

TEST(RelativeTranslations, AreExactWithoutNoiseOnPinholeAndFisheye) {
  for (const bool fisheye : {false, true}) {
    TestSceneOptions options;
    options.fisheye = fisheye;
    TestScene scene = BuildTestScene(options, 1);
    const ViewGraph truth = scene.graph;
    for (ViewGraphEdge& edge : scene.graph.edges) {
      edge.cam2_from_cam1.translation = -Eigen::Vector3d::UnitY();
    }
    const RelativeTranslationReport report = EstimateRelativeTranslations(
        RelativeTranslationOptions(), TrueRotations(scene),
        scene.correspondences, &scene.graph);
    EXPECT_EQ(report.num_refined, truth.edges.size());
    EXPECT_EQ(report.num_without_direction, 0);
    for (size_t e = 0; e < truth.edges.size(); ++e) {
      EXPECT_LT(AngleBetweenRad(scene.graph.edges[e].cam2_from_cam1.translation,
                                truth.edges[e].cam2_from_cam1.translation),
                1e-4);
    }
  }
}

// A third of wrong matches; errors must stay within the sigmas that the step
// reports (5 sigmas for the worst of a hundred edges).
TEST(RelativeTranslations, SurviveOutliersWithHonestSigmas) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    TestSceneOptions options;
    options.noise_px = 0.5;
    options.outlier_ratio = 0.33;
    options.fisheye = seed % 2 == 0;
    TestScene scene = BuildTestScene(options, seed);
    EstimateRelativeTranslations(RelativeTranslationOptions(),
                                 TrueRotations(scene), scene.correspondences,
                                 &scene.graph);
    for (const ViewGraphEdge& edge : scene.graph.edges) {
      EXPECT_TRUE(edge.has_translation);
      EXPECT_LT(AngleBetweenRad(edge.cam2_from_cam1.translation,
                                TrueMotion(scene, edge).translation),
                5.0 * edge.direction_sigma_rad)
          << "seed " << seed;
    }
  }
}

TEST(RelativeTranslations, NearZeroBaselineSaysNothing) {
  TestSceneOptions options;
  options.noise_px = 0.5;
  TestScene scene = BuildTestScene(options, 3);
  // Image 2 has the pose of image 1: the same rays with other noise.
  const Rigid3d pose = scene.cams_from_world.at(1);
  TestScene other = BuildTestScene(options, 3);
  other.correspondences.bearings[2] = scene.correspondences.bearings.at(1);
  Random random(5);
  for (Bearing& bearing : other.correspondences.bearings[2]) {
    bearing.direction =
        (bearing.direction +
         bearing.jacobian * random.GaussianVector(0.5).head<2>())
            .normalized();
  }
  other.cams_from_world[2] = pose;
  EstimateRelativeTranslations(RelativeTranslationOptions(),
                               TrueRotations(other), other.correspondences,
                               &other.graph);
  EXPECT_FALSE(other.graph.edges[0].has_translation);
  EXPECT_TRUE(other.graph.edges[1].has_translation);
}

// Image 2 has the position of image 1. A quarter of the matches has gross
// noise, or lies on a passing car; these agree very well with one direction
// that does not depend on the camera's motion.
TEST(RefineRelativePoses, StandstillHasNoBaselineWhateverMovesBeforeIt) {
  for (const bool is_car : {false, true}) {
    for (uint64_t seed = 1; seed <= 5; ++seed) {
      TestSceneOptions options;
      options.noise_px = 0.5;
      TestScene scene = BuildTestScene(options, seed);
      Random random(seed);
      const Eigen::Quaterniond turn = ExpSo3(random.GaussianVector(0.05));
      auto& bearings = scene.correspondences.bearings;
      bearings[2] = bearings.at(1);
      for (size_t k = 0; k < bearings[2].size(); ++k) {
        Bearing& bearing = bearings[2][k];
        Eigen::Vector2d offset_px = random.GaussianVector(0.5).head<2>();
        const bool is_other = k % 4 == 0;
        if (is_other && is_car) offset_px.x() += 12.0;
        if (is_other && !is_car) {
          offset_px += random.GaussianVector(8.0).head<2>();
        }
        bearing.direction =
            turn *
            (bearing.direction + bearing.jacobian * offset_px).normalized();
        bearing.jacobian = turn.toRotationMatrix() * bearing.jacobian;
      }
      ViewGraphEdge& still = scene.graph.edges.front();
      ASSERT_EQ(still.Pair(), ImagePair(1, 2));
      still.cam2_from_cam1 = Rigid3d(turn, random.UnitVector());
      ViewGraph graph = scene.graph;
      RefineRelativePoses(RelativePoseRefinementOptions(),
                          scene.correspondences, {}, &graph);
      EXPECT_FALSE(graph.edges.front().has_baseline) << "seed " << seed;
      std::map<image_t, Eigen::Quaterniond> rotations = TrueRotations(scene);
      rotations[2] = turn * rotations.at(1);
      EstimateRelativeTranslations(RelativeTranslationOptions(), rotations,
                                   scene.correspondences, &graph);
      EXPECT_FALSE(graph.edges.front().has_translation) << "seed " << seed;
      for (size_t e = 1; e < graph.edges.size(); ++e) {
        if (graph.edges[e].image_id1 == 2) continue;
        EXPECT_TRUE(graph.edges[e].has_baseline) << "seed " << seed;
      }
    }
  }
}

TEST(RefineRelativePoses, ReachesTheTruthFromAFewDegreesOff) {
  for (const bool fisheye : {false, true}) {
    for (uint64_t seed = 1; seed <= 3; ++seed) {
      TestSceneOptions options;
      options.noise_px = 0.3;
      options.fisheye = fisheye;
      TestScene scene = BuildTestScene(options, seed);
      Random random(seed);
      for (ViewGraphEdge& edge : scene.graph.edges) {
        edge.cam2_from_cam1 = Rigid3d(
            ExpSo3(random.GaussianVector(0.01)) * edge.cam2_from_cam1.rotation,
            (edge.cam2_from_cam1.translation + random.GaussianVector(0.05))
                .normalized());
      }
      RefineRelativePoses(RelativePoseRefinementOptions(),
                          scene.correspondences, {}, &scene.graph);
      for (const ViewGraphEdge& edge : scene.graph.edges) {
        const Rigid3d truth = TrueMotion(scene, edge);
        // Three components, up to about 5 sigmas each.
        EXPECT_LT(AngleBetweenRad(edge.cam2_from_cam1.rotation, truth.rotation),
                  7.0 * edge.rotation_sigma_rad);
        EXPECT_LT(
            AngleBetweenRad(edge.cam2_from_cam1.translation, truth.translation),
            6.0 * edge.direction_sigma_rad);
      }
    }
  }
}

// A prediction decides where few matches leave the rotation open, and is
// ignored where the matches clearly contradict it.
TEST(RefineRelativePoses, PredictionHelpsButCannotOverruleMatches) {
  TestSceneOptions options;
  options.noise_px = 0.5;
  options.num_landmarks = 12;
  TestScene scene = BuildTestScene(options, 2);
  const double sigma_rad = 1e-4;
  std::vector<std::optional<RotationPrediction>> predictions;
  for (const ViewGraphEdge& edge : scene.graph.edges) {
    predictions.push_back(RotationPrediction{
        TrueMotion(scene, edge).rotation,
        sigma_rad * sigma_rad * Eigen::Matrix3d::Identity()});
  }
  ViewGraph predicted = scene.graph;
  RefineRelativePoses(RelativePoseRefinementOptions(), scene.correspondences,
                      predictions, &predicted);
  int num_near = 0;
  for (const ViewGraphEdge& edge : predicted.edges) {
    num_near +=
        AngleBetweenRad(edge.cam2_from_cam1.rotation,
                        TrueMotion(scene, edge).rotation) < 5.0 * sigma_rad;
  }
  EXPECT_GT(num_near, 0.9 * predicted.edges.size());

  options.num_landmarks = 150;
  scene = BuildTestScene(options, 2);
  for (auto& prediction : predictions) {
    prediction->cam2_from_cam1 =
        ExpSo3(Eigen::Vector3d(0.2, 0.1, 0.0)) * prediction->cam2_from_cam1;
  }
  RefineRelativePoses(RelativePoseRefinementOptions(), scene.correspondences,
                      predictions, &scene.graph);
  for (const ViewGraphEdge& edge : scene.graph.edges) {
    EXPECT_LT(AngleBetweenRad(edge.cam2_from_cam1.rotation,
                              TrueMotion(scene, edge).rotation),
              0.05);
  }
}

}  // namespace
}  // namespace adasfm
