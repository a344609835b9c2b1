// SPDX-License-Identifier: BSD-3-Clause
// Steps 3.3 and 3.4 of the mapper stage.
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper/prior_support.h"
#include "colmap_ext/mapper_stage/mapper_fingerprint.h"
#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "colmap_ext/mapper_stage/merge_checkpoint.h"
#include "colmap_ext/scene/align_to_gravity.h"
#include "colmap_ext/scene/keep_inertial_unit.h"
#include "core/median.h"
#include "core/prior_lengths.h"
#include "core/release_memory.h"
#include "core/sim3d.h"
#include "core/stopwatch.h"
#include "global/odometry/inertial_scale.h"

namespace adasfm {
namespace {

// The importer uses every reading of the log, and its size is better where both
// are about equally certain. On slow machines it is much less certain.
constexpr double kMaxSigmaOverImporter = 0.6;

// Combines the size of a model in the wheels' metres by the stated wheel scale
// with that by the accelerometer. The importer's estimate is not used, as it
// includes the accelerometer already.
InertialScale CombineWithWheels(const WheelScale& wheels,
                                const InertialScale& inertial) {
  const double weight = 1.0 / (wheels.stated_sigma * wheels.stated_sigma);
  const double inertial_weight =
      1.0 / (inertial.sigma_ratio * inertial.sigma_ratio);
  InertialScale scale;
  scale.metres_per_unit =
      std::exp((inertial_weight * std::log(inertial.metres_per_unit) -
                weight * std::log(wheels.scale)) /
               (inertial_weight + weight));
  scale.sigma_ratio = 1.0 / std::sqrt(inertial_weight + weight);
  return scale;
}

// The unit of thresholds where metres are unknown.
double ComputeNeighborDistance(const SceneData& data,
                               const CoarsePoseMap& coarse) {
  // The median distance between an image and the one it is matched to best.
  std::map<image_t, std::pair<size_t, image_t>> best;
  for (const ScenePair& pair : data.pairs) {
    if (!coarse.count(pair.image_id1) || !coarse.count(pair.image_id2)) {
      continue;
    }
    const size_t num_matches = pair.inlier_matches.size();
    best[pair.image_id1] =
        std::max(best[pair.image_id1], {num_matches, pair.image_id2});
    best[pair.image_id2] =
        std::max(best[pair.image_id2], {num_matches, pair.image_id1});
  }
  std::vector<double> distances;
  for (const auto& [image_id, neighbor] : best) {
    distances.push_back((coarse.at(image_id).TargetOriginInSource() -
                         coarse.at(neighbor.second).TargetOriginInSource())
                            .norm());
  }
  const double median = UpperMedian(&distances);
  return median > 0.0 ? median : 1.0;
}

// The smallest factor of the merged parts: the balance of the whole begins
// there, since it only raises the factor.
double FindSmallestSigmaFactor(const std::vector<PartReport>& parts,
                               const AlignPartsResult& aligned) {
  std::optional<double> smallest;
  for (size_t k = 0; k < parts.size(); ++k) {
    if (!aligned.alignments[k].success) continue;
    smallest = std::min(smallest.value_or(parts[k].keypoint_sigma_factor),
                        parts[k].keypoint_sigma_factor);
  }
  return smallest.value_or(1.0);
}

int CountViolatedPriors(const MapperScene& scene) {
  return std::count_if(
      scene.priors.begin(), scene.priors.end(),
      [&scene](const RelativePosePrior& prior) {
        return IsViolated(prior, scene.reconstruction).value_or(false);
      });
}

// A reset image rests on the priors alone and violates none; it counts as well.
int CountContradictions(const MapperScene& scene,
                        const RefineModelSummary& refined) {
  return CountViolatedPriors(scene) + refined.num_images_reset;
}

}  // namespace

Status MapperStage::ReadPartReports(bool require_all_parts) {
  std::string missing;
  summary_.parts.clear();
  for (size_t k = 0; k < summary_.plan.parts.size(); ++k) {
    const StatusOr<PartReport> report =
        ReadPartReport(PartCheckpointPath(checkpoint_path_, k), fingerprint_,
                       static_cast<int>(k));
    if (report.ok()) {
      summary_.parts.push_back(*report);
      continue;
    }
    missing += " " + std::to_string(k) + " (" + report.status().message() + ")";
    PartReport missing_report;
    missing_report.part_index = static_cast<int>(k);
    missing_report.num_images = static_cast<int>(summary_.plan.parts[k].size());
    missing_report.failure = report.status().message();
    summary_.parts.push_back(missing_report);
  }
  if (!require_all_parts || missing.empty()) return Status::Ok();
  return Status::Error("missing parts:" + missing +
                       "; run --AdaSfmMapper.stage part with each of them "
                       "as --AdaSfmMapper.part_index");
}

std::unique_ptr<MapperScene> MapperStage::BuildWholeScene(
    bool with_matches) const {
  std::set<image_t> images;
  for (const auto& [image_id, image] : data_.images) images.insert(image_id);
  return BuildMapperScene(data_, coarse_, images, with_matches);
}

Status MapperStage::MergePartModels(const std::string& fingerprint) {
  std::vector<PartModel> parts;
  for (const PartReport& report : summary_.parts) {
    PartModel part;
    part.part_index = report.part_index;
    part.prior_only_images = report.prior_only_images;
    if (report.failure.empty()) {
      StatusOr<colmap::Reconstruction> model = ReadPartModel(
          PartCheckpointPath(checkpoint_path_, report.part_index));
      if (!model.ok()) return model.status();
      part.reconstruction = std::move(*model);
    }
    parts.push_back(std::move(part));
  }
  AlignSimilarityOptions align = options_.align;
  // Scenes in metres by the accelerometer have any size; errors scale with it.
  if (!summary_.is_metric || data_.inertial_scale_sigma > 0.0) {
    align.unit = ComputeNeighborDistance(data_, coarse_);
  }
  summary_.aligned = AlignParts(align, coarse_, parts);
  summary_.refine.keypoint_sigma_factor =
      FindSmallestSigmaFactor(summary_.parts, summary_.aligned);
  const std::unique_ptr<MapperScene> scene =
      BuildWholeScene(/*with_matches=*/false);
  summary_.merge = MergeParts(summary_.aligned, parts, scene.get());
  return WriteMergeCheckpoint(checkpoint_path_, fingerprint, 0, summary_,
                              *scene);
}

void MapperStage::FallBackToCoarsePoses(std::unique_ptr<MapperScene>* scene) {
  if (!options_.local.use_priors_in_adjustment) return;
  const int num_contradictions = CountContradictions(**scene, summary_.refine);
  if (num_contradictions == 0) return;
  auto coarse_scene = BuildMapperScene(data_, coarse_, (*scene)->images);
  RegisterAtCoarsePoses(coarse_scene.get());
  // Priors that the coarse model violates, too, are wrong themselves.
  if (num_contradictions <= CountViolatedPriors(*coarse_scene)) return;
  Report("the parts contradict the priors; refining the coarse poses", 0.9);
  RefineModelOptions options = options_.refine;
  options.join_parts = false;
  RefineModelSummary refined;
  for (int round = 1; round <= kNumRefinementRounds; ++round) {
    if (round > 1) {
      auto next = BuildMapperScene(data_, coarse_, (*scene)->images);
      PutIntoScene(coarse_scene->reconstruction, next.get());
      coarse_scene = std::move(next);
    }
    RefineModel(options, options_.local, round, coarse_scene.get(), &refined);
  }
  if (CountContradictions(*coarse_scene, refined) >= num_contradictions) return;
  summary_.refine = refined;
  summary_.started_from_coarse_poses = true;
  *scene = std::move(coarse_scene);
}

Status MapperStage::RefineMerged(const std::string& fingerprint,
                                 MergeCheckpoint* merged) {
  RefineModelOptions options = options_.refine;
  options.join_parts =
      summary_.parts.size() > 1 || !summary_.merge.coarse_images.empty();
  while (merged->num_rounds < kNumRefinementRounds) {
    const int round = merged->num_rounds + 1;
    Report("refining " + std::to_string(merged->model.NumRegImages()) +
               " images, round " + std::to_string(round) + " of " +
               std::to_string(kNumRefinementRounds),
           0.65 + 0.3 * (round - 1) / kNumRefinementRounds);
    std::unique_ptr<MapperScene> scene = BuildWholeScene(NeedsMatches(round));
    PutIntoScene(merged->model, scene.get());
    merged->model = colmap::Reconstruction();
    ReleaseFreedMemory();
    RefineModel(options, options_.local, round, scene.get(), &summary_.refine);
    if (round == kNumRefinementRounds) FallBackToCoarsePoses(&scene);
    const Status status = WriteMergeCheckpoint(checkpoint_path_, fingerprint,
                                               round, summary_, *scene);
    if (!status.ok()) return status;
    // Reads the file, as a resumed run would: its points have other ids, and so
    // another order.
    scene.reset();
    ReleaseFreedMemory();
    StatusOr<MergeCheckpoint> read =
        ReadMergeCheckpoint(checkpoint_path_, fingerprint, &summary_);
    if (!read.ok()) return read.status();
    *merged = std::move(*read);
  }
  return Status::Ok();
}

// Scales the model by the accelerometer where that is more certain than the
// model's metres. The accelerometer determines the size of the final shape,
// which it helped to estimate, better than that of the coarse model, and on
// slow machines better than the importer. How well cannot be seen from the
// residuals of shape and accelerometer alone: the adjustment gives the sigma. A
// model that measured lengths constrain has their metres, whatever the coarse
// one had.
void MapperStage::SetMetres(colmap::Reconstruction* model) {
  const bool is_by_wheels = HasMeasuredLengths(data_.priors);
  if (is_by_wheels) {
    if (!data_.wheel_scale || summary_.is_georeferenced ||
        HasLengths(data_.frame_priors)) {
      return;
    }
    summary_.scale_sigma = data_.wheel_scale->sigma / data_.wheel_scale->scale;
  } else {
    if (!(data_.inertial_scale_sigma > 0.0)) return;
    summary_.scale_sigma = data_.inertial_scale_sigma;
    KeepInertialUnit(data_.priors, model);
  }
  if (!(summary_.refine.unit_sigma > 0.0)) return;
  std::optional<InertialScale> scale =
      EstimateInertialScale(data_.inertial_motions, CamsFromWorld(*model));
  if (!scale) return;
  scale->sigma_ratio =
      std::hypot(scale->sigma_ratio, summary_.refine.unit_sigma);
  double max_sigma = summary_.scale_sigma;
  if (is_by_wheels) {
    scale = CombineWithWheels(*data_.wheel_scale, *scale);
    max_sigma *= kMaxSigmaOverImporter;
  }
  if (scale->sigma_ratio >= max_sigma) return;
  TransformReconstruction(
      Sim3d(scale->metres_per_unit, Eigen::Quaterniond::Identity(),
            Eigen::Vector3d::Zero()),
      model);
  summary_.scale_sigma = scale->sigma_ratio;
  summary_.size_over_priors = scale->metres_per_unit;
}

StatusOr<colmap::Reconstruction> MapperStage::Merge(bool require_all_parts) {
  const Stopwatch watch;
  if (summary_.plan.parts.empty()) {
    const Status status = ReadPlan();
    if (!status.ok()) return status;
  }
  Status status = ReadPartReports(require_all_parts);
  if (!status.ok()) return status;
  const std::string fingerprint = ComputeMergeFingerprint(
      fingerprint_, options_.align, options_.refine, summary_.parts);
  StatusOr<MergeCheckpoint> merged =
      ReadMergeCheckpoint(checkpoint_path_, fingerprint, &summary_);
  if (!merged.ok()) {
    Report(merged.status().message() + ": merging the parts", 0.63);
    status = MergePartModels(fingerprint);
    if (!status.ok()) return status;
    ReleaseFreedMemory();
    merged = ReadMergeCheckpoint(checkpoint_path_, fingerprint, &summary_);
    if (!merged.ok()) return merged.status();
  }
  summary_.merge_seconds = watch.Seconds();
  colmap::Reconstruction& model = merged->model;
  if (model.NumRegImages() < 2) return colmap::Reconstruction();
  const Stopwatch refine_watch;
  status = RefineMerged(fingerprint, &*merged);
  if (!status.ok()) return status;
  if (data_.fixed_poses.empty()) {
    SetMetres(&model);
    summary_.is_level =
        summary_.is_georeferenced || AlignToGravity(data_, &model);
  }
  summary_.refine_seconds = refine_watch.Seconds();
  summary_.num_images = model.NumRegImages();
  summary_.num_points = model.NumPoints3D();
  summary_.mean_reproj_error_px = model.ComputeMeanReprojectionError();
  return std::move(model);
}

}  // namespace adasfm
