// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "colmap_ext/mapper/local_mapper_scene.h"
#include "core/sim3d.h"
#include "core/types.h"
#include "partition/align_similarity.h"

namespace adasfm {

// One part's reconstruction, in its own frame.
struct PartModel {
  int part_index = 0;
  colmap::Reconstruction reconstruction;
  // Registered images whose pose rests on priors alone.
  std::set<image_t> prior_only_images;
};

struct AlignPartsResult {
  // For each part; `success` is false for a part that does not fit.
  std::vector<AlignSimilarityResult> alignments;
  // Similarities of the fitting parts: the alignments, relaxed against each
  // other.
  std::vector<Sim3d> world_from_parts;
  // RMSE between the centres of images that parts share, after the alignment to
  // the coarse frame and after the relaxation.
  double separator_rmse_before = 0.0;
  double separator_rmse_after = 0.0;
  int num_separators = 0;
};

// Aligns each part to the coarse frame (Alg. 2), then moves the fitting parts
// as rigid pieces with a scale, so that they agree about shared images. Coarse
// poses constrain the whole, separators constrain neighbouring parts. In each
// round the similarity of one part after another is estimated against the
// coarse poses and the present poses of its neighbours.
AlignPartsResult AlignParts(const AlignSimilarityOptions& options,
                            const CoarsePoseMap& coarse,
                            const std::vector<PartModel>& parts);

}  // namespace adasfm
