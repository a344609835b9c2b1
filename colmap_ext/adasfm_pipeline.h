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

// The whole of AdaSfM. Three stages turn a COLMAP database with verified
// matches and the logs of cheap sensors into a metric model. Each stage reads
// and writes ordinary COLMAP files and can be run on its own.
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
//        2.4 rejection of edges             2.8 match refinement
//
//   3  MapParts             adasfm_mapper              partition/, colmap_ext/
//      coarse models + cleaned matches -> a model for each, and for each
//      component that these leave out (mapper_stage/leftover_components.h)
//        3.1 cut into overlapping parts     3.3 align and merge the parts
//        3.2 incremental SfM per part       3.4 refine the whole
//
// The sources and docs/reference/{sensors,global,mapper}.md number their steps
// in this way.
//
// The equations are in docs/reference/math.md, the files in
// docs/reference/formats.md. Beside the stages, adasfm_pair_generator chooses
// the pairs to match, and adasfm_automatic_reconstructor runs everything from a
// folder of photos (automatic_reconstruction.h).

// Stage 1. Writes the summary to summary_path, then the priors to the database
// at paths.database_path; on error the database is as it was.
StatusOr<PriorImport> ImportPriors(const PriorImportOptions& options,
                                   const PriorImportPaths& paths,
                                   const std::string& summary_path);

// What a run of stage 2 reports beside its files.
struct CoarseModelReport {
  GlobalStageResult result;
  std::vector<std::string> warnings;
  double seconds = 0.0;
};

// Stage 2. Writes the models to output_path/0, 1, ... (largest first),
// removed_pairs.txt and summary.json there, and the refined two-view geometries
// to the database. The database keeps the original geometries, from which every
// run starts: running twice equals running once. On error before that last
// write the database is unchanged. It is also an error when no images have
// verified matches, and when no points can be triangulated.
StatusOr<CoarseModelReport> EstimateCoarseModel(
    const GlobalStageOptions& options, const std::string& database_path,
    const std::string& output_path, const ProgressCallback& progress = {});

struct MapOptions {
  MapperStageOptions stage;
  // Whether stage.refine adjusts the intrinsics: 0, 1, or -1 for cameras whose
  // focal length nobody has measured. -1 leaves calibrated cameras unchanged,
  // also beside others, unless a 1 asks for some intrinsics.
  int refine_focal_length = -1;
  int refine_extra_params = -1;

  bool IsValid(std::string* error) const;
};

// input_path is the folder with the models 0, 1, ... of stage 2, or one of
// these models. The models of stage 3 go to output_path/0, 1, ..., most images
// first.
struct MapRequest {
  std::string database_path;
  std::string input_path;
  std::string output_path;
  // All steps, or one of them for runs spread over machines.
  MapperSteps steps = MapperSteps::kAll;
  // The part of kPart; parts are numbered through all models.
  int part_index = -1;
  // Folder of a model that is extended: its images keep their poses. Empty:
  // none.
  std::string existing_path = {};
};

// What a run of stage 3 reports beside its files.
struct MapReport {
  // With the steps kAll and kMerge: the models in the order written, and the
  // verdict on all of them, with the images in no model.
  std::vector<ModelSummary> models;
  std::optional<Verdict> verdict;
  std::vector<std::string> warnings;
};

// Stage 3. Writes the models and summary.json with the steps kAll and kMerge,
// checkpoints with all steps; after a crash the same call continues. Models
// with a failed verdict are written, too.
StatusOr<MapReport> MapParts(const MapOptions& options,
                             const MapRequest& request,
                             const ProgressCallback& progress = {});

}  // namespace adasfm
