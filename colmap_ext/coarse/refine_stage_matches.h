// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/scene/raw_matches.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/bearing.h"
#include "core/types.h"

namespace adasfm {

// RefineMatches on the raw matches of the pairs, or on the verified ones where
// the database has no raw ones, a block of pairs in memory at a time. Appends
// to the report.
void RefineRawMatches(const MatchRefinementOptions& options,
                      const RawMatchSource& source,
                      const std::map<image_t, Rigid3d>& cams_from_world,
                      const std::map<image_t, std::vector<Bearing>>& bearings,
                      const std::vector<const ScenePair*>& pairs,
                      MatchRefinementReport* total);

// How far the verified pairs agree with a model, with a threshold by the noise
// of its keypoints. bearings are those of the scene.
PairAgreement MeasureModelAgreement(
    const GlobalStageOptions& options, const SceneData& scene,
    const ViewGraph& graph,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    const CoarseModel& model);

// Sets pair_agreement of every model of the result (MeasureModelAgreement).
void MeasurePairAgreements(
    const GlobalStageOptions& options, const SceneData& scene,
    const std::map<image_t, std::vector<Bearing>>& bearings,
    GlobalStageResult* result);

// Step 8 of the coarse global stage: RefineRawMatches of the pairs within every
// model of the result, under the model's poses and, where its adjustment has
// refined them, its cameras (else the bearings of the scene). Fills the
// result's refinement (its pairs become geometries), geometries, removed_pairs
// and every model's mapper_start; pairs that the view graph rejected and pairs
// between two models are removed ones.
void RefineStageMatches(const GlobalStageOptions& options,
                        const SceneData& scene, const RawMatchSource& source,
                        const std::map<image_t, std::vector<Bearing>>& bearings,
                        GlobalStageResult* result);

}  // namespace adasfm
