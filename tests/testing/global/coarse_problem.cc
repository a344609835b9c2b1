// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/global/coarse_problem.h"

#include <algorithm>
#include <limits>

#include "core/so3.h"

namespace adasfm {

CoarseProblem BuildCoarseProblem(const SyntheticWorldOptions& options) {
  const SyntheticWorld world = BuildSyntheticWorld(options);
  Random random(options.seed);
  CoarseProblem problem;
  const double scale = 1.0 + random.Gaussian(0.004);
  for (size_t k = 0; k < world.images.size(); ++k) {
    const SyntheticImage& image = world.images[k];
    problem.graph.images.push_back(image.image_id);
    problem.truth[image.image_id] = image.cam_from_world;
    problem.correspondences.bearings[image.image_id] =
        ComputeBearings(world.camera, image);
    if (k == 0) continue;
    const SyntheticImage& last = world.images[k - 1];
    Rigid3d motion =
        ComputeCam2FromCam1(last.cam_from_world, image.cam_from_world);
    const double sigma_m = 0.01 * motion.translation.norm() + 1e-3;
    motion.translation *= scale;
    problem.priors.push_back(BuildPrior(last.image_id, image.image_id, motion,
                                        DegToRad(0.02), sigma_m, &random));
    problem.priors.back().dt_ns = image.timestamp_ns - last.timestamp_ns;
  }
  for (const SyntheticPair& pair : world.pairs) {
    if (pair.inlier_matches.size() < 15) continue;
    ViewGraphEdge edge = BuildEdge(ImagePair(pair.image_id1, pair.image_id2),
                                   pair.cam2_from_cam1);
    edge.num_inliers = pair.inlier_matches.size();
    problem.graph.edges.push_back(edge);
    problem.correspondences.matches[edge.Pair()] = pair.inlier_matches;
    if (pair.is_alias) problem.aliases.insert(edge.Pair());
  }
  return problem;
}

SyntheticWorldOptions AliasedWorld(uint64_t seed) {
  SyntheticWorldOptions options;
  options.num_images = 160;
  options.seed = seed;
  options.alias_pair_ratio = 0.05;
  options.num_blackouts = 1;
  options.blackout_num_images = 12;
  return options;
}

void DropPosition(RelativePosePrior* prior) {
  prior->flags = kPriorRotation;
  prior->cam2_from_cam1.translation.setZero();
  prior->covariance.bottomRightCorner<3, 3>() =
      std::numeric_limits<double>::infinity() * Eigen::Matrix3d::Identity();
}

CoarseProblem Shuffle(const CoarseProblem& problem, uint64_t seed) {
  std::vector<image_t> ids = problem.graph.images;
  Random(seed).Shuffle(&ids);
  std::map<image_t, image_t> new_id;
  for (size_t k = 0; k < ids.size(); ++k) {
    new_id[problem.graph.images[k]] = ids[k];
  }
  CoarseProblem shuffled;
  shuffled.graph.images = problem.graph.images;
  shuffled.graph.capture_ranks.resize(ids.size());
  for (size_t k = 0; k < ids.size(); ++k) {
    shuffled.graph.capture_ranks[shuffled.graph.IndexOf(ids[k])] = k;
  }
  for (const auto& [image_id, bearings] : problem.correspondences.bearings) {
    shuffled.correspondences.bearings[new_id[image_id]] = bearings;
  }
  for (const auto& [image_id, pose] : problem.truth) {
    shuffled.truth[new_id[image_id]] = pose;
  }
  for (ViewGraphEdge edge : problem.graph.edges) {
    std::vector<FeatureMatch> matches =
        problem.correspondences.matches.at(edge.Pair());
    const bool is_alias = problem.aliases.count(edge.Pair()) > 0;
    edge.image_id1 = new_id[edge.image_id1];
    edge.image_id2 = new_id[edge.image_id2];
    if (edge.image_id1 > edge.image_id2) {
      std::swap(edge.image_id1, edge.image_id2);
      edge.cam2_from_cam1 = edge.cam2_from_cam1.Inverse();
      for (FeatureMatch& match : matches) {
        std::swap(match.point2D_idx1, match.point2D_idx2);
      }
    }
    if (is_alias) shuffled.aliases.insert(edge.Pair());
    shuffled.correspondences.matches[edge.Pair()] = std::move(matches);
    shuffled.graph.edges.push_back(edge);
  }
  std::sort(shuffled.graph.edges.begin(), shuffled.graph.edges.end(),
            [](const ViewGraphEdge& a, const ViewGraphEdge& b) {
              return a.Pair() < b.Pair();
            });
  return shuffled;
}

KeptPairs CountKeptPairs(const CoarseProblem& problem, const ViewGraph& graph) {
  KeptPairs kept;
  int num_true = 0;
  int num_true_kept = 0;
  for (const ViewGraphEdge& edge : graph.edges) {
    const bool is_kept = edge.IsKept() && edge.source != EdgeSource::kSensor;
    if (problem.aliases.count(edge.Pair())) {
      kept.num_aliases += is_kept && edge.num_inliers > 0;
    } else if (edge.num_inliers > 0) {
      ++num_true;
      num_true_kept += is_kept;
    }
  }
  kept.share_of_true = static_cast<double>(num_true_kept) / num_true;
  return kept;
}

}  // namespace adasfm
