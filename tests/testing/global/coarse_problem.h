// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/view_graph/correspondences.h"
#include "global/view_graph/view_graph.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {

// Input of EstimateCoarsePoses, and the truth.
struct CoarseProblem {
  ViewGraph graph;
  GlobalCorrespondences correspondences;
  std::vector<RelativePosePrior> priors;
  std::map<image_t, Rigid3d> truth;
  std::set<ImagePair> aliases;
};

// From a synthetic world. Priors: true motion with 0.02 deg and 1 % of white
// noise a step and 0.4 % of common scale.
CoarseProblem BuildCoarseProblem(const SyntheticWorldOptions& options);

// 160 images with aliased places and one blackout.
SyntheticWorldOptions AliasedWorld(uint64_t seed);

// Reduces a prior to what an IMU without wheels measures.
void DropPosition(RelativePosePrior* prior);

// The same images under ids in random order, with their order of capture.
CoarseProblem Shuffle(const CoarseProblem& problem, uint64_t seed);

struct KeptPairs {
  int num_aliases = 0;
  double share_of_true = 0.0;
};

KeptPairs CountKeptPairs(const CoarseProblem& problem, const ViewGraph& graph);

}  // namespace adasfm
