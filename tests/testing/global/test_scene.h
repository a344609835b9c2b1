// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "core/random.h"
#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

// A small scene with known truth: cameras looking at random points.
struct TestScene {
  std::map<image_t, Rigid3d> cams_from_world;
  ViewGraph graph;  // noise-free relative poses, unit translations
  GlobalCorrespondences correspondences;
  // Keypoint k of every image is landmark k.
  std::vector<Eigen::Vector3d> landmarks;
};

struct TestSceneOptions {
  int num_images = 8;
  int num_landmarks = 150;
  double noise_px = 0.0;
  // Share of matches in every pair that are replaced by random ones.
  double outlier_ratio = 0.0;
  bool fisheye = false;
  // Centres on a straight line instead of an arc.
  bool collinear = false;
  // Pairs up to this far apart in the sequence.
  int max_gap = 4;
};

TestScene BuildTestScene(const TestSceneOptions& options, uint64_t seed);

// A random graph of num_images nodes: a ring and random chords.
std::vector<ImagePair> BuildRandomPairs(int num_images, int num_chords,
                                        Random* random);

ViewGraphEdge BuildEdge(const ImagePair& pair, const Rigid3d& cam2_from_cam1);

// A prior of the true motion with white noise of these sigmas; dt 0.1 s.
RelativePosePrior BuildPrior(image_t image_id1, image_t image_id2,
                             const Rigid3d& cam2_from_cam1,
                             double rotation_sigma_rad,
                             double translation_sigma_m, Random* random);

}  // namespace adasfm
