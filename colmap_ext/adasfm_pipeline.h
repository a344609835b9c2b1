// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/coarse/global_stage.h"
#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "colmap_ext/mapper_stage/mapping_summary.h"
#include "colmap_ext/mapper_stage/verdict.h"
#include "colmap_ext/priors/prior_importer.h"
#include "core/progress.h"
#include "core/status.h"

namespace adasfm {

// AdaSfM from here to the end. A COLMAP database with verified matches and the
// logs of cheap sensors become one metric model, in three stages; each reads
// and leaves ordinary COLMAP files and can be run on its own.
//
//   1  ImportPriors         adasfm_prior_importer      sensors/
//      IMU and wheel logs -> relative pose priors in the database
//        1.1 read and check the logs        1.3 smooth the whole sequence
//        1.2 preintegrate between images    1.4 motion and covariance per pair
//
//   2  EstimateCoarseModel  adasfm_global              global/
//      view graph + priors -> coarse model, cleaned matches
//        2.1 view graph, calibration        2.5 directions, sensor edges
//        2.2 odometry, loop closures        2.6 camera positions
//        2.3 camera rotations               2.7 tracks, points, adjustment
//        2.4 edges off the rotations        2.8 match refinement
//
//   3  MapParts             adasfm_mapper              partition/, colmap_ext/
//      coarse models + cleaned matches -> a model each, and one of each
//      stretch that these leave out (mapper_stage/leftover_components.h)
//        3.1 cut into overlapping parts     3.3 align and merge the parts
//        3.2 incremental SfM per part       3.4 refine the whole
//
// The sources and docs/reference/{sensors,global,mapper}.md number their steps
// in this way.
//
// The equations stand in docs/reference/math.md, the files in
// docs/reference/formats.md. Around them adasfm_pair_generator chooses the
// pairs to match, and adasfm_automatic_reconstructor runs everything from a
// folder of photos (automatic_reconstruction.h).

// Stage 1. Writes the summary to summary_path, then the priors to the database
// at paths.database_path; on error the database is as it was.
StatusOr<PriorImport> ImportPriors(const PriorImportOptions& options,
                                   const PriorImportPaths& paths,
                                   const std::string& summary_path);

// What a run of stage 2 did beside its files.
struct CoarseModelReport {
  GlobalStageResult result;
  std::vector<std::string> warnings;
  double seconds = 0.0;
};

// Stage 2. Writes the models to output_path/0, 1, ... (largest first),
// removed_pairs.txt and summary.json there, and the refined two-view geometries
// to the database, whose originals it keeps and starts from: running twice
// equals running once. On error the database is as it was. An error, too, when
// no images have verified matches, and when no points come of them.
StatusOr<CoarseModelReport> EstimateCoarseModel(
    const GlobalStageOptions& options, const std::string& database_path,
    const std::string& output_path, const ProgressCallback& progress = {});

struct MapOptions {
  MapperStageOptions stage;
  // Whether stage.refine adjusts the intrinsics: 0, 1, or -1 for cameras whose
  // focal length nobody has measured. A calibrated robot's are left alone,
  // beside others, too, unless some intrinsics are asked for by a 1.
  int refine_focal_length = -1;
  int refine_extra_params = -1;

  bool IsValid(std::string* error) const;
};

// input_path is the folder that stage 2 wrote its models 0, 1, ... to, or one
// of these; the models go to output_path/0, 1, ..., most images first.
struct MapRequest {
  std::string database_path;
  std::string input_path;
  std::string output_path;
  // All steps, or one of them for runs spread over machines.
  MapperSteps steps = MapperSteps::kAll;
  // Of kPart; the parts of all models are numbered one after another.
  int part_index = -1;
};

// What a run of stage 3 did beside its files.
struct MapReport {
  // With the steps kAll and kMerge: as the models were written, and the verdict
  // on all together, with the images of no model.
  std::vector<ModelSummary> models;
  std::optional<Verdict> verdict;
  std::vector<std::string> warnings;
};

// Stage 3. Writes the models and summary.json with the steps kAll and kMerge,
// checkpoints with all; after a crash the same call continues. Models that
// failed by their verdict are written all the same.
StatusOr<MapReport> MapParts(const MapOptions& options,
                             const MapRequest& request,
                             const ProgressCallback& progress = {});

}  // namespace adasfm
