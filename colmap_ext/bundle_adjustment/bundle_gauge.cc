// SPDX-License-Identifier: BSD-3-Clause
// How BundleProblem fixes the degrees of freedom that the data leave open.
#include <utility>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "core/median.h"

namespace adasfm {

std::vector<image_t> BundleProblem::ConstantImages() const {
  std::vector<image_t> image_ids;
  for (const auto& [image_id, block] : images_) {
    if (block.is_constant && block.IsUsed()) image_ids.push_back(image_id);
  }
  return image_ids;
}

void BundleProblem::FixFirstPose() {
  ImageBlock* first = nullptr;
  for (auto& [image_id, block] : images_) {
    if (!block.IsUsed()) continue;
    if (first == nullptr || block.num_observations > 0) first = &block;
    if (block.num_observations > 0) break;
  }
  if (first == nullptr) return;
  first->is_constant = true;
  problem_->SetParameterBlockConstant(first->SolvedPose()->parameters);
}

double BundleProblem::MedianNumObservations() const {
  std::vector<double> counts;
  for (const auto& [image_id, block] : images_) {
    if (block.IsUsed()) counts.push_back(block.num_observations);
  }
  return UpperMedian(&counts);
}

void BundleProblem::FixDistanceToFarthestPose(double sigma_ratio) {
  std::pair<image_t, ImageBlock*> first(kInvalidImageId, nullptr);
  for (auto& [image_id, block] : images_) {
    if (block.is_constant && block.IsUsed()) {
      first = {image_id, &block};
      break;
    }
  }
  if (first.second == nullptr) return;
  // A pose on few points may err by more than the size of the model, and would
  // move the model with it.
  const double min_num_observations = 0.5 * MedianNumObservations();
  std::pair<image_t, ImageBlock*> farthest(kInvalidImageId, nullptr);
  double max_distance = 0.0;
  for (auto& [image_id, block] : images_) {
    if (!block.IsUsed() || block.num_observations < min_num_observations) {
      continue;
    }
    const double distance =
        (block.pose->center - first.second->pose->center).norm();
    if (distance <= max_distance) continue;
    max_distance = distance;
    farthest = {image_id, &block};
  }
  if (farthest.second == nullptr) return;
  PosePriorEdge edge;
  edge.image_id1 = first.first;
  edge.image_id2 = farthest.first;
  edge.cam2_from_cam1.translation = Eigen::Vector3d(0.0, 0.0, max_distance);
  edge.length_sigma_m = sigma_ratio * max_distance;
  AddPrior(edge, PosePriorCost::Term::kLength, first.second, farthest.second,
           nullptr);
}

}  // namespace adasfm
