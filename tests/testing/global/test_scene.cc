// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/global/test_scene.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/so3.h"

namespace adasfm {
namespace {

Rigid3d PoseOnPath(const TestSceneOptions& options, int k, Random* random) {
  const double along = 1.0 * k - 0.5 * options.num_images;
  Eigen::Vector3d center(along, 0.0, 0.0);
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  if (!options.collinear) {
    center += Eigen::Vector3d(0.0, 0.3 * std::sin(k), 0.05 * along * along);
    turn = random->GaussianVector(0.1);
  }
  return CamFromWorldWithCenter(ExpSo3(turn), center);
}

}  // namespace

TestScene BuildTestScene(const TestSceneOptions& options, uint64_t seed) {
  Random random(seed);
  SyntheticCamera camera;
  if (options.fisheye) {
    camera.model = SyntheticCameraModel::kFisheye;
    camera.focal_px = 250.0;
    camera.fisheye_coeffs << 0.02, -0.004, 0.001, 0.0;
  }
  TestScene scene;
  for (int k = 0; k < options.num_landmarks; ++k) {
    scene.landmarks.emplace_back(random.Uniform(-8.0, 8.0),
                                 random.Uniform(-4.0, 4.0),
                                 random.Uniform(8.0, 20.0));
  }
  for (int k = 0; k < options.num_images; ++k) {
    const image_t image_id = k + 1;
    const Rigid3d pose = PoseOnPath(options, k, &random);
    scene.graph.images.push_back(image_id);
    scene.cams_from_world[image_id] = pose;
    for (const Eigen::Vector3d& landmark : scene.landmarks) {
      Eigen::Vector2d pixel;
      ProjectPoint(camera, pose * landmark, &pixel);
      pixel += Eigen::Vector2d(random.Gaussian(options.noise_px),
                               random.Gaussian(options.noise_px));
      scene.correspondences.bearings[image_id].push_back(
          ComputeBearing(camera, pixel));
    }
  }
  for (int i = 1; i <= options.num_images; ++i) {
    for (int j = i + 1; j <= std::min(options.num_images, i + options.max_gap);
         ++j) {
      Rigid3d motion = ComputeCam2FromCam1(scene.cams_from_world.at(i),
                                           scene.cams_from_world.at(j));
      motion.translation.normalize();
      scene.graph.edges.push_back(BuildEdge(ImagePair(i, j), motion));
      std::vector<FeatureMatch>& matches =
          scene.correspondences.matches[ImagePair(i, j)];
      for (int k = 0; k < options.num_landmarks; ++k) {
        const bool is_outlier = random.Uniform(0, 1) < options.outlier_ratio;
        const int other =
            is_outlier ? random.UniformInt(0, options.num_landmarks - 1) : k;
        matches.push_back(
            {static_cast<point2D_t>(k), static_cast<point2D_t>(other)});
      }
    }
  }
  return scene;
}

std::vector<ImagePair> BuildRandomPairs(int num_images, int num_chords,
                                        Random* random) {
  std::set<ImagePair> pairs;
  for (int k = 0; k < num_images; ++k) {
    pairs.insert(ImagePair(k + 1, (k + 1) % num_images + 1));
  }
  while (static_cast<int>(pairs.size()) < num_images + num_chords) {
    const std::vector<int> ends = random->Sample(2, num_images);
    pairs.insert(ImagePair(ends[0] + 1, ends[1] + 1));
  }
  return std::vector<ImagePair>(pairs.begin(), pairs.end());
}

ViewGraphEdge BuildEdge(const ImagePair& pair, const Rigid3d& cam2_from_cam1) {
  ViewGraphEdge edge;
  edge.image_id1 = pair.image_id1;
  edge.image_id2 = pair.image_id2;
  edge.cam2_from_cam1 = cam2_from_cam1;
  edge.num_inliers = 100;
  return edge;
}

RelativePosePrior BuildPrior(image_t image_id1, image_t image_id2,
                             const Rigid3d& cam2_from_cam1,
                             double rotation_sigma_rad,
                             double translation_sigma_m, Random* random) {
  RelativePosePrior prior;
  prior.image_id1 = image_id1;
  prior.image_id2 = image_id2;
  prior.dt_ns = 100000000;
  prior.flags = kPriorRotation | kPriorDirection | kPriorLength;
  prior.cam2_from_cam1 = Rigid3d(
      ExpSo3(random->GaussianVector(rotation_sigma_rad)) *
          cam2_from_cam1.rotation,
      cam2_from_cam1.translation + random->GaussianVector(translation_sigma_m));
  prior.covariance.setZero();
  prior.covariance.diagonal().head<3>().setConstant(
      std::pow(std::max(1e-9, rotation_sigma_rad), 2));
  prior.covariance.diagonal().tail<3>().setConstant(
      std::pow(std::max(1e-9, translation_sigma_m), 2));
  return prior;
}

}  // namespace adasfm
