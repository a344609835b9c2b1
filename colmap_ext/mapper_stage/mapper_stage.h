// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "colmap_ext/mapper/align_parts.h"
#include "colmap_ext/mapper/local_mapper.h"
#include "colmap_ext/mapper/merge_reconstructions.h"
#include "colmap_ext/mapper/refine_model.h"
#include "colmap_ext/mapper_stage/part_checkpoint.h"
#include "colmap_ext/mapper_stage/partition_plan.h"
#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"

namespace adasfm {

enum class MapperSteps { kAll, kPlan, kPart, kMerge };

// Nested by step, in order of their use.
struct MapperStageOptions {
  PartitionPlanOptions partition;
  LocalMapperOptions local;
  AlignSimilarityOptions align;
  RefineModelOptions refine;
  // Threads of the whole stage; parts that run at the same time share them.
  int num_threads = -1;
  // Bound of the parts that run at the same time; -1: as many as there are
  // threads and as fit into the memory.
  int max_num_parallel_parts = -1;
  // Memory for the parts that run at the same time, in GB (1e9 bytes); -1: 70 %
  // of what the machine has available when they begin. One part always runs;
  // MapParts returns an error where the estimate of the refinement exceeds
  // this.
  double max_memory_gb = -1.0;

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
  // The merged parts contradicted more priors than the coarse model does; the
  // model was refined from the coarse poses instead.
  bool started_from_coarse_poses = false;
  bool is_metric = false;
  // Sources of metres: wheels or other odometry, and positions, whose frame is
  // then that of the model.
  bool has_metric_sensors = false;
  bool is_georeferenced = false;
  // Relative 1 sigma of the metres; 0 where it is unknown.
  double scale_sigma = 0.0;
  // Factor by which the accelerometer enlarged the finished model over the
  // lengths of the priors.
  double size_over_priors = 1.0;
  bool is_level = false;
  int num_parallel_parts = 0;
  // Memory of the biggest part, estimated before it runs.
  double max_part_memory_bytes = 0.0;
  double plan_seconds = 0.0;
  double parts_seconds = 0.0;
  double merge_seconds = 0.0;
  double refine_seconds = 0.0;
};

// One line of text and the share of the stage that is done, from any thread.
using MapperProgress = std::function<void(const std::string&, double)>;

// Reconstructs a part: ReconstructLocally, or a substitute in a test.
using PartMapper = std::function<LocalMapResult(
    const LocalMapperOptions&, const SceneData&, const CoarsePoseMap&,
    const std::set<image_t>&)>;

struct MergeCheckpoint;

// The mapper stage on a folder (adasfm_pipeline.h). Every step leaves its
// result in output_path/checkpoints, complete or not at all, with a fingerprint
// of what it was made from; a step whose result is there is not done again.
//   3.1  plan     partition of the view graph      checkpoints/plan.json
//   3.2  part k   local reconstruction             checkpoints/part_k/
//   3.3  merge    alignment, merge                 checkpoints/refine_0/
//   3.4           round r of the refinement        checkpoints/refine_r/
// Steps 3.3 and 3.4 give the model returned; only the last of their folders
// stays.
class MapperStage {
 public:
  // `data` and `coarse` must outlive the stage. If the data has positions, the
  // coarse poses are in their frame.
  MapperStage(const MapperStageOptions& options, const SceneData& data,
              const CoarsePoseMap& coarse, const std::string& output_path,
              MapperProgress progress = {},
              PartMapper part_mapper = ReconstructLocally);

  // Makes the plan, or reads the existing one.
  Status Plan();
  // The number of parts of the existing plan.
  StatusOr<int> ReadNumParts();
  // Reconstructs one part of the plan. A part that throws is tried once more
  // with stricter settings; its report then says why.
  Status RunPart(int part_index);
  // How many parts of the plan may run at the same time, as threads and memory
  // allow; reports it with the memory that the largest part may need.
  int FindNumParallelParts();
  // All parts of the plan, the biggest first.
  Status RunAllParts();
  // Merges the parts that are there and refines the model, which is empty when
  // no part has any images. With `require_all_parts` a missing part is an error
  // that names it.
  StatusOr<colmap::Reconstruction> Merge(bool require_all_parts);

  const MapperStageSummary& Summary() const { return summary_; }
  const std::string& Fingerprint() const { return fingerprint_; }

 private:
  Status ReadPlan(CheckpointCondition* condition = nullptr);
  Status RunPartWithThreads(int part_index, int num_threads);
  PartReport MapPart(int part_index, int num_threads,
                     LocalMapResult* result) const;
  void Report(const std::string& line, double share_done = 0.0) const;

  Status ReadPartReports(bool require_all_parts);
  Status MergePartModels(const std::string& fingerprint);
  std::unique_ptr<MapperScene> BuildWholeScene(bool with_matches) const;
  // Refines the merged model in the remaining rounds.
  Status RefineMerged(const std::string& fingerprint, MergeCheckpoint* merged);
  void SetMetres(colmap::Reconstruction* model);
  // Refines the coarse poses instead where the merged parts violate more
  // priors, so that the result is never worse than the prior trajectory.
  void FallBackToCoarsePoses(std::unique_ptr<MapperScene>* scene);

  const MapperStageOptions options_;
  const SceneData& data_;
  const CoarsePoseMap& coarse_;
  const std::string checkpoint_path_;
  const std::string fingerprint_;
  const MapperProgress progress_;
  const PartMapper part_mapper_;
  // The largest share reported.
  mutable std::atomic<double> share_done_{0.0};
  MapperStageSummary summary_;
};

}  // namespace adasfm
