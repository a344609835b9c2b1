// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/align_parts.h"

#include <cmath>
#include <map>

#include "colmap_ext/host/pose_conversion.h"

namespace adasfm {
namespace {

constexpr int kNumRelaxationRounds = 20;
// A shared image counts as often as this many coarse poses, since neighbours
// determine the separators better than the coarse model does.
constexpr int kSeparatorWeight = 5;

std::map<image_t, Rigid3d> FindWellConstrainedPoses(const PartModel& part) {
  std::map<image_t, Rigid3d> poses;
  for (const image_t image_id : part.reconstruction.RegImageIds()) {
    if (part.prior_only_images.count(image_id)) continue;
    poses[image_id] = CamFromWorld(part.reconstruction.Image(image_id));
  }
  return poses;
}

// A shared image as two fitting parts see it.
struct Separator {
  int part1 = 0;
  int part2 = 0;
  Rigid3d cam_from_part1;
  Rigid3d cam_from_part2;
};

class Relaxation {
 public:
  Relaxation(const std::vector<std::map<image_t, Rigid3d>>& poses,
             const CoarsePoseMap& coarse, AlignPartsResult* result)
      : poses_(poses), coarse_(coarse), result_(*result) {
    std::map<image_t, std::vector<int>> parts_of_image;
    for (size_t k = 0; k < poses.size(); ++k) {
      if (!result_.alignments[k].success) continue;
      for (const auto& [image_id, pose] : poses[k]) {
        parts_of_image[image_id].push_back(k);
      }
    }
    for (const auto& [image_id, parts] : parts_of_image) {
      for (size_t b = 1; b < parts.size(); ++b) {
        for (size_t a = 0; a < b; ++a) {
          separators_.push_back({parts[a], parts[b],
                                 poses[parts[a]].at(image_id),
                                 poses[parts[b]].at(image_id)});
        }
      }
    }
    result_.num_separators = static_cast<int>(separators_.size());
  }

  double Rmse() const {
    double sum_squares = 0.0;
    for (const Separator& separator : separators_) {
      sum_squares += (result_.world_from_parts[separator.part1] *
                          separator.cam_from_part1.TargetOriginInSource() -
                      result_.world_from_parts[separator.part2] *
                          separator.cam_from_part2.TargetOriginInSource())
                         .squaredNorm();
    }
    return separators_.empty() ? 0.0
                               : std::sqrt(sum_squares / separators_.size());
  }

  void Run() {
    if (separators_.empty()) return;
    for (int round = 0; round < kNumRelaxationRounds; ++round) {
      for (size_t k = 0; k < poses_.size(); ++k) {
        if (result_.alignments[k].success) MovePart(k);
      }
    }
  }

 private:
  void MovePart(int k) {
    std::vector<PosePair> pairs;
    size_t i = 0;
    for (const auto& [image_id, cam_from_part] : poses_[k]) {
      const auto coarse = coarse_.find(image_id);
      if (coarse == coarse_.end()) continue;
      // The mask's order is that of AlignParts.
      if (result_.alignments[k].inlier_mask[i++]) {
        pairs.push_back({cam_from_part, coarse->second});
      }
    }
    for (const Separator& separator : separators_) {
      PosePair pair;
      if (separator.part1 == k) {
        pair = {separator.cam_from_part1,
                TransformCamFromWorld(result_.world_from_parts[separator.part2],
                                      separator.cam_from_part2)};
      } else if (separator.part2 == k) {
        pair = {separator.cam_from_part2,
                TransformCamFromWorld(result_.world_from_parts[separator.part1],
                                      separator.cam_from_part1)};
      } else {
        continue;
      }
      pairs.insert(pairs.end(), kSeparatorWeight, pair);
    }
    Sim3d world_from_part;
    // An orientation error of 0.1 rad counts as much as a centre error of one
    // threshold.
    if (EstimatePoseSimilarity(pairs, std::vector<char>(pairs.size(), 1),
                               10.0 * result_.alignments[k].threshold,
                               &world_from_part)) {
      result_.world_from_parts[k] = world_from_part;
    }
  }

  const std::vector<std::map<image_t, Rigid3d>>& poses_;
  const CoarsePoseMap& coarse_;
  AlignPartsResult& result_;
  std::vector<Separator> separators_;
};

}  // namespace

AlignPartsResult AlignParts(const AlignSimilarityOptions& options,
                            const CoarsePoseMap& coarse,
                            const std::vector<PartModel>& parts) {
  AlignPartsResult result;
  std::vector<std::map<image_t, Rigid3d>> poses;
  for (const PartModel& part : parts) {
    poses.push_back(FindWellConstrainedPoses(part));
    std::vector<PosePair> pairs;
    for (const auto& [image_id, cam_from_part] : poses.back()) {
      const auto pose = coarse.find(image_id);
      if (pose != coarse.end()) pairs.push_back({cam_from_part, pose->second});
    }
    result.alignments.push_back(AlignSimilarity(options, pairs));
    result.world_from_parts.push_back(
        result.alignments.back().target_from_source);
  }
  Relaxation relaxation(poses, coarse, &result);
  result.separator_rmse_before = relaxation.Rmse();
  relaxation.Run();
  result.separator_rmse_after = relaxation.Rmse();
  return result;
}

}  // namespace adasfm
