// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "colmap_ext/align_parts.h"
#include "colmap_ext/local_mapper.h"
#include "colmap_ext/merge_reconstructions.h"
#include "colmap_ext/part_checkpoint.h"
#include "colmap_ext/partition_plan.h"
#include "colmap_ext/refine_model.h"
#include "colmap_ext/scene_data.h"
#include "core/status.h"

namespace adasfm {

enum class MapperSteps { kAll, kPlan, kPart, kMerge };

// Nested by step, in order of their use (design 7.3 to 7.5).
struct MapperStageOptions {
  PartitionPlanOptions partition;
  LocalMapperOptions local;
  AlignSimilarityOptions align;
  RefineModelOptions refine;
  // Threads of the whole stage; parts that run at the same time share them.
  int num_threads = -1;
  // Bound of the parts that run at the same time; -1: as many as there are
  // threads and as fit into the machine's free memory.
  int max_num_parallel_parts = -1;

  bool IsValid(std::string* error) const;
};

struct MapperStageSummary {
  int num_images = 0;
  int num_points = 0;
  double mean_reproj_error_px = 0.0;
  PartitionPlan plan;
  // In the plan's order.
  std::vector<PartReport> parts;
  AlignPartsResult aligned;
  MergeSummary merge;
  RefineModelSummary refine;
  // The merged parts contradicted the priors far more than the coarse model
  // does; the model was refined from the coarse poses instead.
  bool started_from_coarse_poses = false;
  bool is_metric = false;
  bool is_level = false;
  double plan_seconds = 0.0;
  double parts_seconds = 0.0;
  double merge_seconds = 0.0;
  double refine_seconds = 0.0;
};

// One line of text and the share of the stage that is done, from any thread.
using MapperProgress = std::function<void(const std::string&, double)>;

// The mapper stage on a folder (design 7.3 to 7.5, 10). Every step leaves its
// result in output_path/checkpoints, complete or not at all, with a fingerprint
// of what it was made from; a step whose result is there is not done again.
//   1  plan     partition of the view graph     checkpoints/plan.json
//   2  part k   local reconstruction            checkpoints/part_k/
//   3  merge    alignment, merge, refinement    the model returned
class MapperStage {
 public:
  // `data` and `coarse` must outlive the stage.
  MapperStage(const MapperStageOptions& options, const SceneData& data,
              const CoarsePoseMap& coarse, const std::string& output_path,
              MapperProgress progress = {});

  // Makes the plan, or takes the one that is there.
  Status Plan();
  // Reconstructs one part of the plan. A part that throws is tried once more
  // with stricter settings; its report then says why.
  Status RunPart(int part_index);
  // All parts of the plan, the biggest first.
  Status RunAllParts();
  // Merges the parts that are there and refines the model. With
  // `require_all_parts` a missing part is an error that names it.
  StatusOr<colmap::Reconstruction> Merge(bool require_all_parts);

  const MapperStageSummary& Summary() const { return summary_; }
  const std::string& Fingerprint() const { return fingerprint_; }

 private:
  Status RunPartWithThreads(int part_index, int num_threads);
  int NumParallelParts() const;
  void Report(const std::string& line, double share_done) const;
  void AlignUnit(AlignSimilarityOptions* options) const;
  // So that the result is never worse than the prior trajectory.
  void FallBackToCoarsePoses(const RefineModelOptions& options,
                             std::unique_ptr<MapperScene>* scene);

  const MapperStageOptions options_;
  const SceneData& data_;
  const CoarsePoseMap& coarse_;
  const std::string checkpoint_path_;
  const std::string fingerprint_;
  const MapperProgress progress_;
  MapperStageSummary summary_;
};

// A hash of everything that the result depends on: the scene, the coarse poses
// and the options; not the number of threads.
std::string ComputeMapperFingerprint(const MapperStageOptions& options,
                                     const SceneData& data,
                                     const CoarsePoseMap& coarse);

// As JSON, and as the lines for the screen.
std::string FormatMapperSummaryJson(const MapperStageSummary& summary);
std::string FormatMapperSummaryText(const MapperStageSummary& summary);

}  // namespace adasfm
