// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/mapper_stage.h"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <iomanip>
#include <new>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "colmap_ext/io/capture_output.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/mapper_stage/mapper_fingerprint.h"
#include "colmap_ext/mapper_stage/model_checkpoint.h"
#include "colmap_ext/mapper_stage/part_memory.h"
#include "colmap_ext/scene/georeference.h"
#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/release_memory.h"
#include "core/stopwatch.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// The remainder is for the scene itself, the system and other programs.
constexpr double kShareOfAvailableMemory = 0.7;
// COLMAP reports on std::cout every image that it registers (host_mapper.h).
constexpr char kNowhere[] = "/dev/null";

// For a part that threw: lets fewer wrong poses and points in.
LocalMapperOptions StricterOptions(LocalMapperOptions options) {
  options.registration.min_num_visible_points *= 2;
  options.registration.min_inlier_ratio =
      std::max(0.5, options.registration.min_inlier_ratio);
  options.registration.max_reproj_error_px *= 0.5;
  options.initial_max_epipolar_error_px *= 0.5;
  return options;
}

MapperStageOptions CompleteOptions(MapperStageOptions options) {
  options.refine.num_threads = EffectiveNumThreads(options.num_threads);
  options.refine.max_memory_gb = options.max_memory_gb;
  return options;
}

std::string InMegabytes(double bytes) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(0) << bytes / 1e6 << " MB";
  return text.str();
}

}  // namespace

bool MapperStageOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmMapper", error)
             .PositiveOrMinusOne("max_memory_gb", max_memory_gb)
             .PositiveOrMinusOne("num_threads", num_threads)
             .PositiveOrMinusOne("max_num_parallel_parts",
                                 max_num_parallel_parts)
             .AllHold() &&
         partition.IsValid(error) && local.IsValid(error) &&
         align.IsValid(error);
}

MapperStage::MapperStage(const MapperStageOptions& options,
                         const SceneData& data, const CoarsePoseMap& coarse,
                         const std::string& output_path,
                         MapperProgress progress, PartMapper part_mapper)
    : options_(CompleteOptions(options)),
      data_(data),
      coarse_(coarse),
      checkpoint_path_(output_path + "/checkpoints"),
      fingerprint_(ComputePartsFingerprint(options.partition, options.local,
                                           data, coarse)),
      progress_(std::move(progress)),
      part_mapper_(std::move(part_mapper)) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  summary_.has_metric_sensors = HasMetricPriors(data, coarse);
  summary_.is_georeferenced = !data.positions.empty();
  summary_.is_metric = summary_.has_metric_sensors || summary_.is_georeferenced;
}

void MapperStage::Report(const std::string& line, double share_done) const {
  double largest = share_done_;
  while (share_done > largest &&
         !share_done_.compare_exchange_weak(largest, share_done)) {
  }
  if (progress_) progress_(line, std::max(largest, share_done));
}

Status MapperStage::Plan() {
  const Stopwatch watch;
  const std::string path = checkpoint_path_ + "/plan.json";
  CheckpointCondition condition;
  const Status found = ReadPlan(&condition);
  if (found.ok()) {
    Report("plan of " + std::to_string(summary_.plan.parts.size()) +
               " parts taken from " + path,
           0.02);
    return Status::Ok();
  }
  Status status = CheckCheckpointFolder(checkpoint_path_);
  // Parts stay valid when a damaged plan is made again: both plans follow from
  // the data of the fingerprint.
  if (condition == CheckpointCondition::kDamaged) {
    Report(path + " is damaged: making it again", 0.0);
  } else if (condition == CheckpointCondition::kOutdated) {
    Report("options or database have changed: starting anew", 0.0);
    if (status.ok()) status = RemoveCheckpoints(checkpoint_path_);
  }
  if (status.ok()) status = PrepareOutputFolder(checkpoint_path_);
  if (!status.ok()) return status;
  summary_.plan = BuildPartitionPlan(options_.partition, data_, coarse_);
  status = WritePartitionPlan(path, fingerprint_, summary_.plan);
  summary_.plan_seconds = watch.Seconds();
  return status;
}

Status MapperStage::ReadPlan(CheckpointCondition* condition) {
  StatusOr<PartitionPlan> plan = ReadPartitionPlan(
      checkpoint_path_ + "/plan.json", fingerprint_, condition);
  if (!plan.ok()) return plan.status();
  summary_.plan = std::move(*plan);
  return Status::Ok();
}

StatusOr<int> MapperStage::ReadNumParts() {
  const Status status = ReadPlan();
  if (!status.ok()) return status;
  return static_cast<int>(summary_.plan.parts.size());
}

Status MapperStage::RunPart(int part_index) {
  const StatusOr<int> num_parts = ReadNumParts();
  if (!num_parts.ok()) return num_parts.status();
  if (part_index < 0 || part_index >= *num_parts) {
    return Status::Error(
        "AdaSfmMapper.part_index = " + std::to_string(part_index) +
        ", but the plan has the parts 0 to " + std::to_string(*num_parts - 1));
  }
  const CaptureOutput capture(kNowhere, "");
  return RunPartWithThreads(part_index,
                            EffectiveNumThreads(options_.num_threads));
}

// A part that fails has a report that says so. Throws where memory or threads
// are short.
PartReport MapperStage::MapPart(int part_index, int num_threads,
                                LocalMapResult* result) const {
  const std::vector<image_t>& part = summary_.plan.parts[part_index];
  const std::set<image_t> images(part.begin(), part.end());
  const Stopwatch watch;
  PartReport report;
  report.part_index = part_index;
  report.num_images = static_cast<int>(part.size());
  LocalMapperOptions options = options_.local;
  options.num_threads = num_threads;
  for (int attempt = 0; attempt < 2; ++attempt) {
    report.failure.clear();
    try {
      *result = part_mapper_(options, data_, coarse_, images);
      break;
    } catch (const std::bad_alloc&) {
      // Not the part's fault: with more memory the same command makes it.
      throw;
    } catch (const std::system_error&) {
      throw;
    } catch (const std::exception& exception) {
      report.failure = exception.what();
      if (attempt == 0) report.retry_reason = exception.what();
      Report("part " + std::to_string(part_index) +
             " failed: " + exception.what() +
             (attempt == 0 ? "; trying again with stricter settings"
                           : "; the others go on without it"));
      options = StricterOptions(options);
    }
  }
  report.seconds = watch.Seconds();
  if (!report.failure.empty()) return report;
  report.num_registered = result->reconstruction.NumRegImages();
  report.num_points = result->reconstruction.NumPoints3D();
  report.num_registered_by_global_pose = result->num_registered_by_global_pose;
  report.num_global_adjustments = result->num_global_adjustments;
  report.mean_reproj_error_px = result->mean_reproj_error_px;
  report.keypoint_sigma_factor = result->keypoint_sigma_factor;
  report.prior_only_images = result->prior_only_images;
  return report;
}

Status MapperStage::RunPartWithThreads(int part_index, int num_threads) {
  const std::string path = PartCheckpointPath(checkpoint_path_, part_index);
  const StatusOr<PartReport> found =
      ReadPartReport(path, fingerprint_, part_index);
  // What made a part fail, such as too little memory, may be gone.
  if (found.ok() && found->failure.empty()) return Status::Ok();
  if (!found.ok() && fs::exists(path)) {
    Report(found.status().message() + ": making part " +
           std::to_string(part_index) + " again");
  }
  LocalMapResult result;
  const PartReport report = MapPart(part_index, num_threads, &result);
  return WritePartCheckpoint(
      path, fingerprint_, report,
      report.failure.empty() ? &result.reconstruction : nullptr);
}

int MapperStage::FindNumParallelParts() {
  const int num_parts = static_cast<int>(summary_.plan.parts.size());
  std::vector<double> bytes;
  for (const auto& part : summary_.plan.parts) {
    bytes.push_back(EstimatePartMemoryBytes(data_, part));
    summary_.max_part_memory_bytes =
        std::max(summary_.max_part_memory_bytes, bytes.back());
  }
  const double limit = options_.max_memory_gb > 0.0
                           ? 1e9 * options_.max_memory_gb
                           : kShareOfAvailableMemory * AvailableMemoryBytes();
  int num_parallel =
      std::min({EffectiveNumThreads(options_.num_threads),
                std::max(1, num_parts), CountPartsThatFit(bytes, limit)});
  if (options_.max_num_parallel_parts > 0) {
    num_parallel = std::min(num_parallel, options_.max_num_parallel_parts);
  }
  summary_.num_parallel_parts = num_parallel;
  std::string line = std::to_string(num_parts) + " parts, " +
                     std::to_string(num_parallel) + " at a time, up to " +
                     InMegabytes(summary_.max_part_memory_bytes) +
                     " each; memory for them: " + InMegabytes(limit);
  if (summary_.max_part_memory_bytes > limit) {
    line +=
        "; WARNING: not enough for one, use a smaller "
        "AdaSfmPartition.max_part_size";
  }
  Report(line, 0.02);
  return num_parallel;
}

Status MapperStage::RunAllParts() {
  const Stopwatch watch;
  const std::vector<std::vector<image_t>>& parts = summary_.plan.parts;
  std::vector<int> order(parts.size());
  size_t num_images = 0;
  for (size_t k = 0; k < parts.size(); ++k) {
    order[k] = static_cast<int>(k);
    num_images += parts[k].size();
  }
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return parts[a].size() > parts[b].size();
  });
  const int num_parallel = FindNumParallelParts();
  const int num_threads =
      std::max(1, EffectiveNumThreads(options_.num_threads) / num_parallel);
  std::vector<Status> statuses(parts.size());
  std::atomic<size_t> next{0};
  std::atomic<size_t> num_images_done{0};
  std::atomic<size_t> num_parts_done{0};
  const CaptureOutput capture(kNowhere, "");
  // One worker takes one part after another, the biggest first.
  ParallelFor(num_parallel, num_parallel, [&](size_t) {
    for (size_t i = next++; i < parts.size(); i = next++) {
      statuses[order[i]] = RunPartWithThreads(order[i], num_threads);
      const double share =
          1.0 * (num_images_done += parts[order[i]].size()) / num_images;
      std::ostringstream line;
      line << ++num_parts_done << " of " << parts.size()
           << " parts done, about "
           << static_cast<int>(watch.Seconds() * (1.0 / share - 1.0))
           << " s left for the parts";
      Report(line.str(), 0.02 + 0.6 * share);
    }
  });
  ReleaseFreedMemory();
  summary_.parts_seconds = watch.Seconds();
  for (const Status& status : statuses) {
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

}  // namespace adasfm
