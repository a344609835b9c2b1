// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "core/parallel.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

class Timer {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() -
                                         start_)
        .count();
  }

 private:
  const std::chrono::steady_clock::time_point start_ =
      std::chrono::steady_clock::now();
};

std::string PartPath(const std::string& checkpoint_path, int part_index) {
  std::ostringstream path;
  path << checkpoint_path << "/part_" << part_index;
  return path.str();
}

// For a part that threw: fewer wrong poses and points to stumble over.
LocalMapperOptions StricterOptions(LocalMapperOptions options) {
  options.registration.min_num_visible_points *= 2;
  options.registration.min_inlier_ratio =
      std::max(0.5, options.registration.min_inlier_ratio);
  options.registration.max_reproj_error_px *= 0.5;
  options.initial_pair.max_epipolar_error_px *= 0.5;
  return options;
}

// Of a part at work: its matches in the correspondence graph, tracks and the
// adjustment's residuals and Jacobians.
double EstimateMemoryBytes(const SceneData& data,
                           const std::vector<image_t>& part) {
  double num_keypoints = 0.0;
  for (const image_t image_id : part) {
    num_keypoints += data.images.at(image_id).keypoints.size();
  }
  return 50e6 + 1500.0 * num_keypoints;
}

double FreeMemoryBytes() {
  return 1.0 * sysconf(_SC_AVPHYS_PAGES) * sysconf(_SC_PAGESIZE);
}

bool IsMetric(const SceneData& data) {
  return std::any_of(data.priors.begin(), data.priors.end(),
                     [](const auto& prior) { return prior.HasLength(); });
}

// FNV-1a over bytes.
class Hash {
 public:
  template <typename T>
  void Add(const T& value) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(&value);
    for (size_t i = 0; i < sizeof(T); ++i) {
      hash_ = (hash_ ^ bytes[i]) * 1099511628211ull;
    }
  }
  void Add(const std::string& text) {
    for (const char c : text) Add(c);
  }
  void Add(const Rigid3d& pose) {
    for (int i = 0; i < 4; ++i) Add(pose.rotation.coeffs()(i));
    for (int i = 0; i < 3; ++i) Add(pose.translation(i));
  }
  std::string Text() const {
    std::ostringstream text;
    text << std::hex << hash_;
    return text.str();
  }

 private:
  uint64_t hash_ = 14695981039346656037ull;
};

void AddScene(const SceneData& data, Hash* hash) {
  for (const auto& [image_id, image] : data.images) {
    hash->Add(image_id);
    hash->Add(image.name);
    for (const Eigen::Vector2d& keypoint : image.keypoints) {
      hash->Add(keypoint.x());
      hash->Add(keypoint.y());
    }
    if (image.gravity_in_cam) {
      for (int i = 0; i < 3; ++i) hash->Add((*image.gravity_in_cam)(i));
    }
  }
  for (const auto& [camera_id, camera] : data.cameras) {
    hash->Add(camera_id);
    hash->Add(camera.ModelId());
    for (const double parameter : camera.Params()) hash->Add(parameter);
  }
  for (const ScenePair& pair : data.pairs) {
    hash->Add(pair.image_id1);
    hash->Add(pair.image_id2);
    for (const FeatureMatch& match : pair.inlier_matches) {
      hash->Add(match.point2D_idx1);
      hash->Add(match.point2D_idx2);
    }
  }
  for (const RelativePosePrior& prior : data.priors) {
    hash->Add(prior.image_id1);
    hash->Add(prior.image_id2);
    hash->Add(prior.cam2_from_cam1);
    for (int i = 0; i < 36; ++i) hash->Add(prior.covariance(i));
    hash->Add(prior.flags);
  }
}

}  // namespace

bool MapperStageOptions::IsValid(std::string* error) const {
  return partition.IsValid(error) && local.IsValid(error) &&
         align.IsValid(error) && refine.IsValid(error);
}

MapperStage::MapperStage(const MapperStageOptions& options,
                         const SceneData& data, const CoarsePoseMap& coarse,
                         const std::string& output_path,
                         MapperProgress progress)
    : options_(options),
      data_(data),
      coarse_(coarse),
      checkpoint_path_(output_path + "/checkpoints"),
      fingerprint_(ComputeMapperFingerprint(options, data, coarse)),
      progress_(std::move(progress)) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  summary_.is_metric = IsMetric(data);
}

void MapperStage::Report(const std::string& line, double share_done) const {
  if (progress_) progress_(line, share_done);
}

Status MapperStage::Plan() {
  const Timer timer;
  const std::string path = checkpoint_path_ + "/plan.json";
  StatusOr<PartitionPlan> plan = ReadPartitionPlan(path, fingerprint_);
  if (plan.ok()) {
    summary_.plan = std::move(*plan);
    Report("plan of " + std::to_string(summary_.plan.parts.size()) +
               " parts taken from " + path,
           0.02);
    return Status::Ok();
  }
  // Parts of another plan must not be mixed with this one's.
  std::error_code error;
  if (fs::exists(path)) {
    Report("options or database have changed: starting anew", 0.0);
  }
  fs::remove_all(checkpoint_path_, error);
  fs::create_directories(checkpoint_path_, error);
  if (error) {
    return Status::Error("cannot create the folder " + checkpoint_path_);
  }
  summary_.plan = BuildPartitionPlan(options_.partition, data_, coarse_);
  const Status status = WritePartitionPlan(path, fingerprint_, summary_.plan);
  summary_.plan_seconds = timer.Seconds();
  Report(std::to_string(summary_.plan.parts.size()) + " parts", 0.02);
  return status;
}

Status MapperStage::RunPart(int part_index) {
  StatusOr<PartitionPlan> plan =
      ReadPartitionPlan(checkpoint_path_ + "/plan.json", fingerprint_);
  if (!plan.ok()) return plan.status();
  summary_.plan = std::move(*plan);
  if (part_index < 0 || part_index >= summary_.plan.parts.size()) {
    return Status::Error(
        "AdaSfmMapper.part_index = " + std::to_string(part_index) +
        ", but the plan has the parts 0 to " +
        std::to_string(static_cast<int>(summary_.plan.parts.size()) - 1));
  }
  return RunPartWithThreads(part_index,
                            EffectiveNumThreads(options_.num_threads));
}

Status MapperStage::RunPartWithThreads(int part_index, int num_threads) {
  const std::string path = PartPath(checkpoint_path_, part_index);
  if (ReadPartReport(path, fingerprint_).ok()) return Status::Ok();
  const Timer timer;
  const std::vector<image_t>& part = summary_.plan.parts[part_index];
  const std::set<image_t> images(part.begin(), part.end());
  PartReport report;
  report.part_index = part_index;
  report.num_images = static_cast<int>(part.size());
  LocalMapperOptions options = options_.local;
  options.num_threads = num_threads;
  LocalMapResult result;
  for (int attempt = 0; attempt < 2; ++attempt) {
    report.failure.clear();
    try {
      result = ReconstructLocally(options, data_, coarse_, images);
      break;
    } catch (const std::exception& exception) {
      report.failure = exception.what();
      if (attempt == 0) report.retry_reason = exception.what();
      options = StricterOptions(options);
    }
  }
  report.seconds = timer.Seconds();
  if (!report.failure.empty()) {
    return WritePartCheckpoint(path, fingerprint_, report, nullptr);
  }
  report.num_registered = result.reconstruction.NumRegImages();
  report.num_points = result.reconstruction.NumPoints3D();
  report.num_registered_by_global_pose = result.num_registered_by_global_pose;
  report.num_global_adjustments = result.num_global_adjustments;
  report.mean_reproj_error_px = result.mean_reproj_error_px;
  report.prior_only_images = result.prior_only_images;
  return WritePartCheckpoint(path, fingerprint_, report,
                             &result.reconstruction);
}

int MapperStage::NumParallelParts() const {
  int num_parallel =
      std::min<int>(EffectiveNumThreads(options_.num_threads),
                    std::max<size_t>(1, summary_.plan.parts.size()));
  if (options_.max_num_parallel_parts > 0) {
    return std::min(num_parallel, options_.max_num_parallel_parts);
  }
  double max_bytes = 0.0;
  for (const auto& part : summary_.plan.parts) {
    max_bytes = std::max(max_bytes, EstimateMemoryBytes(data_, part));
  }
  return std::clamp(
      static_cast<int>(0.7 * FreeMemoryBytes() / std::max(1.0, max_bytes)), 1,
      num_parallel);
}

Status MapperStage::RunAllParts() {
  const Timer timer;
  const size_t num_parts = summary_.plan.parts.size();
  std::vector<int> order(num_parts);
  for (size_t k = 0; k < num_parts; ++k) order[k] = k;
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return summary_.plan.parts[a].size() > summary_.plan.parts[b].size();
  });
  const int num_parallel = NumParallelParts();
  const int num_threads =
      std::max(1, EffectiveNumThreads(options_.num_threads) / num_parallel);
  std::vector<Status> statuses(num_parts);
  std::atomic<size_t> next{0};
  std::atomic<int> num_done{0};
  // One worker takes one part after another, the biggest first.
  ParallelFor(num_parallel, num_parallel, [&](size_t) {
    for (size_t i = next++; i < num_parts; i = next++) {
      statuses[order[i]] = RunPartWithThreads(order[i], num_threads);
      const int done = ++num_done;
      std::ostringstream line;
      line << "part " << order[i] << " done (" << done << " of " << num_parts
           << ", about "
           << static_cast<int>(timer.Seconds() / done * (num_parts - done))
           << " s left for the parts)";
      Report(line.str(), 0.02 + 0.6 * done / num_parts);
    }
  });
  summary_.parts_seconds = timer.Seconds();
  for (const Status& status : statuses) {
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

void MapperStage::AlignUnit(AlignSimilarityOptions* options) const {
  if (summary_.is_metric) return;
  // The median distance between an image and the one it is matched to best.
  std::map<image_t, std::pair<size_t, image_t>> best;
  for (const ScenePair& pair : data_.pairs) {
    if (!coarse_.count(pair.image_id1) || !coarse_.count(pair.image_id2)) {
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
    distances.push_back((coarse_.at(image_id).TargetOriginInSource() -
                         coarse_.at(neighbor.second).TargetOriginInSource())
                            .norm());
  }
  if (distances.empty()) return;
  std::sort(distances.begin(), distances.end());
  const double median = distances[distances.size() / 2];
  if (median > 0.0) options->unit = median;
}

void MapperStage::FallBackToCoarsePoses(const RefineModelOptions& options,
                                        std::unique_ptr<MapperScene>* scene) {
  const auto count_torn = [](const MapperScene& candidate) {
    return CountTornPriors(FindPriorEdges(candidate, candidate.images),
                           candidate.reconstruction);
  };
  if (!options.use_priors_in_adjustment) return;
  const int num_torn = count_torn(**scene);
  if (num_torn == 0) return;
  auto coarse_scene = BuildMapperScene(data_, coarse_, (*scene)->images);
  RegisterAtCoarsePoses(coarse_scene.get());
  // Priors that tear in the coarse model too are wrong themselves.
  if (num_torn <= count_torn(*coarse_scene)) return;
  Report("the parts contradict the priors; refining the coarse poses", 0.8);
  const RefineModelSummary refined = RefineModel(options, coarse_scene.get());
  if (count_torn(*coarse_scene) >= num_torn) return;
  summary_.refine = refined;
  summary_.started_from_coarse_poses = true;
  *scene = std::move(coarse_scene);
}

StatusOr<colmap::Reconstruction> MapperStage::Merge(bool require_all_parts) {
  if (summary_.plan.parts.empty()) {
    StatusOr<PartitionPlan> plan =
        ReadPartitionPlan(checkpoint_path_ + "/plan.json", fingerprint_);
    if (!plan.ok()) return plan.status();
    summary_.plan = std::move(*plan);
  }
  const Timer timer;
  std::vector<PartModel> parts;
  std::string missing;
  for (size_t k = 0; k < summary_.plan.parts.size(); ++k) {
    const std::string path = PartPath(checkpoint_path_, k);
    const StatusOr<PartReport> report = ReadPartReport(path, fingerprint_);
    PartModel part;
    part.part_index = k;
    if (report.ok()) {
      summary_.parts.push_back(*report);
      part.prior_only_images = report->prior_only_images;
      if (report->failure.empty()) ReadPartModel(path, &part.reconstruction);
    } else {
      missing += " " + std::to_string(k);
      PartReport missing_report;
      missing_report.part_index = k;
      missing_report.num_images = summary_.plan.parts[k].size();
      missing_report.failure = report.status().message();
      summary_.parts.push_back(missing_report);
    }
    parts.push_back(std::move(part));
  }
  if (require_all_parts && !missing.empty()) {
    return Status::Error("missing parts:" + missing +
                         "; run --AdaSfmMapper.stage part with each of them "
                         "as --AdaSfmMapper.part_index");
  }
  AlignSimilarityOptions align = options_.align;
  AlignUnit(&align);
  summary_.aligned = AlignParts(align, coarse_, parts);
  std::set<image_t> images;
  for (const auto& [image_id, image] : data_.images) images.insert(image_id);
  auto scene = BuildMapperScene(data_, coarse_, images);
  summary_.merge = MergeParts(summary_.aligned, parts, scene.get());
  summary_.merge_seconds = timer.Seconds();
  if (scene->reconstruction.NumRegImages() < 2) {
    return Status::Error(
        "no image could be reconstructed; does the coarse model at "
        "--input_path belong to this database?");
  }
  Report("refining " + std::to_string(scene->reconstruction.NumRegImages()) +
             " images",
         0.65);
  const Timer refine_timer;
  RefineModelOptions refine = options_.refine;
  refine.num_threads = EffectiveNumThreads(options_.num_threads);
  refine.join_parts = parts.size() > 1 || !summary_.merge.coarse_images.empty();
  summary_.refine = RefineModel(refine, scene.get());
  FallBackToCoarsePoses(refine, &scene);
  scene->reconstruction.TearDown();
  summary_.is_level = AlignToGravity(data_, &scene->reconstruction);
  summary_.refine_seconds = refine_timer.Seconds();
  summary_.num_images = scene->reconstruction.NumRegImages();
  summary_.num_points = scene->reconstruction.NumPoints3D();
  summary_.mean_reproj_error_px =
      scene->reconstruction.ComputeMeanReprojectionError();
  return std::move(scene->reconstruction);
}

std::string ComputeMapperFingerprint(const MapperStageOptions& options,
                                     const SceneData& data,
                                     const CoarsePoseMap& coarse) {
  Hash hash;
  AddScene(data, &hash);
  for (const auto& [image_id, pose] : coarse) {
    hash.Add(image_id);
    hash.Add(pose);
  }
  const NormalizedCutOptions& cut = options.partition.cut;
  hash.Add(cut.max_part_size);
  hash.Add(cut.min_part_size);
  hash.Add(cut.seed);
  hash.Add(options.partition.flood_fill.min_overlap_ratio);
  hash.Add(options.partition.max_num_images_undivided);
  const LocalMapperOptions& local = options.local;
  hash.Add(local.registration.min_num_visible_points);
  hash.Add(local.registration.max_reproj_error_px);
  hash.Add(local.registration.min_inlier_ratio);
  hash.Add(local.registration.min_num_p3p_inliers);
  hash.Add(local.registration.use_global_candidate);
  for (const double parallax_deg : local.initial_pair.min_parallaxes_deg) {
    hash.Add(parallax_deg);
  }
  hash.Add(local.initial_pair.min_num_points);
  hash.Add(local.initial_pair.max_epipolar_error_px);
  hash.Add(local.use_priors_in_adjustment);
  hash.Add(local.filter_max_reproj_error_px);
  hash.Add(local.min_triangulation_angle_deg);
  hash.Add(local.global_adjustment_growth);
  hash.Add(local.keypoint_sigma_px);
  hash.Add(local.balance.enabled);
  hash.Add(local.balance.max_chi2_per_dof);
  hash.Add(local.balance.max_sigma_factor);
  return hash.Text();
}

}  // namespace adasfm
