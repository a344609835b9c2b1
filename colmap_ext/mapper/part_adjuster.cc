// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/part_adjuster.h"

#include <algorithm>
#include <map>
#include <utility>

#include "colmap_ext/bundle_adjustment/estimate_keypoint_sigma.h"
#include "colmap_ext/bundle_adjustment/variance_components.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Registered images that see the batch's points, held fixed in its adjustment.
constexpr size_t kMaxNumConstantImages = 30;
// The next images, or the refinement of the whole, change the part by more.
constexpr double kFunctionTolerance = 1e-3;
// 1 sigma of a coarse motion.
constexpr double kCoarseRotationSigmaRad = 0.02;
constexpr double kCoarseDirectionSigmaRad = 0.1;
// Below this length in units of the model a motion has no direction.
constexpr double kMinCoarseLength = 1e-6;

}  // namespace

std::vector<PosePriorEdge> FindPriorEdges(
    const std::vector<RelativePosePrior>& priors,
    const std::set<image_t>& images) {
  std::vector<PosePriorEdge> edges;
  for (const RelativePosePrior& prior : priors) {
    if (images.count(prior.image_id1) && images.count(prior.image_id2)) {
      edges.push_back(PosePriorEdgeFromPrior(prior));
    }
  }
  return edges;
}

std::optional<PosePriorEdge> CoarseEdge(const MapperScene& scene,
                                        image_t image_id1, image_t image_id2) {
  const auto coarse1 = scene.coarse->find(image_id1);
  const auto coarse2 = scene.coarse->find(image_id2);
  if (coarse1 == scene.coarse->end() || coarse2 == scene.coarse->end()) {
    return std::nullopt;
  }
  PosePriorEdge edge;
  edge.image_id1 = image_id1;
  edge.image_id2 = image_id2;
  edge.cam2_from_cam1 = ComputeCam2FromCam1(coarse1->second, coarse2->second);
  edge.rotation_sigma_rad = kCoarseRotationSigmaRad;
  if (edge.cam2_from_cam1.translation.norm() > kMinCoarseLength) {
    edge.direction_sigma_rad = kCoarseDirectionSigmaRad;
  }
  return edge;
}

std::vector<PosePriorEdge> FindCoarseEdges(const MapperScene& scene,
                                           const std::set<image_t>& images) {
  std::set<std::pair<image_t, image_t>> pairs;
  const auto add = [&](image_t image_id1, image_t image_id2) {
    if (images.count(image_id2)) {
      pairs.insert(std::minmax(image_id1, image_id2));
    }
  };
  for (const image_t image_id : images) {
    for (const auto& [neighbor, num_matches] : scene.neighbors.at(image_id)) {
      add(image_id, neighbor);
    }
  }
  for (const RelativePosePrior& prior : scene.priors) {
    if (images.count(prior.image_id1)) add(prior.image_id1, prior.image_id2);
  }
  std::vector<PosePriorEdge> edges;
  for (const auto& [image_id1, image_id2] : pairs) {
    if (const auto edge = CoarseEdge(scene, image_id1, image_id2)) {
      edges.push_back(*edge);
    }
  }
  return edges;
}

PartAdjuster::PartAdjuster(const LocalMapperOptions& options,
                           MapperScene* scene)
    : options_(options),
      scene_(*scene),
      reconstruction_(scene->reconstruction),
      max_reproj_error_px_(options.filter_max_reproj_error_px) {}

void PartAdjuster::AdjustPair(image_t image_id1, image_t image_id2) {
  const std::set<image_t> images = {image_id1, image_id2};
  AdjustImages(images, {}, 20);
  Filter(images);
}

void PartAdjuster::AdjustBatch(const std::set<image_t>& batch) {
  AdjustImages(batch, FindConstantImages(batch), 8);
  Filter(batch);
}

std::set<image_t> PartAdjuster::FindConstantImages(
    const std::set<image_t>& batch) const {
  std::map<image_t, int> num_matches;
  for (const image_t image_id : batch) {
    for (const auto& [neighbor, count] : scene_.neighbors.at(image_id)) {
      if (IsRegistered(reconstruction_, neighbor) && !batch.count(neighbor)) {
        num_matches[neighbor] += count;
      }
    }
  }
  std::vector<std::pair<int, image_t>> ranked;
  for (const auto& [image_id, count] : num_matches) {
    ranked.emplace_back(-count, image_id);
  }
  std::sort(ranked.begin(), ranked.end());
  std::set<image_t> constant_images;
  for (const auto& [count, image_id] : ranked) {
    if (constant_images.size() == kMaxNumConstantImages) break;
    constant_images.insert(image_id);
  }
  AddBaselines(batch, &constant_images);
  return constant_images;
}

// Points that these images see from one place would move freely in depth: each
// of them gets the registered image that sees it from farthest aside.
void PartAdjuster::AddBaselines(const std::set<image_t>& batch,
                                std::set<image_t>* constant_images) const {
  const double min_angle = DegToRad(options_.min_triangulation_angle_deg);
  std::set<colmap::point3D_t> point_ids;
  for (const image_t image_id : batch) {
    for (const auto& point2D : reconstruction_.Image(image_id).Points2D()) {
      if (!point2D.HasPoint3D() ||
          !point_ids.insert(PointIdOf(point2D)).second) {
        continue;
      }
      const colmap::Point3D& point =
          reconstruction_.Point3D(PointIdOf(point2D));
      const auto direction_of = [&](image_t other) -> Eigen::Vector3d {
        return CamFromWorld(reconstruction_.Image(other))
                   .TargetOriginInSource() -
               XyzOf(point);
      };
      const Eigen::Vector3d direction = direction_of(image_id);
      double max_angle = 0.0;
      double max_angle_here = 0.0;
      image_t farthest = kInvalidImageId;
      for (const auto& element : TrackOf(point).Elements()) {
        const double angle =
            AngleBetweenRad(direction, direction_of(element.image_id));
        if (batch.count(element.image_id) ||
            constant_images->count(element.image_id)) {
          max_angle_here = std::max(max_angle_here, angle);
        } else if (angle > max_angle) {
          max_angle = angle;
          farthest = element.image_id;
        }
      }
      if (max_angle_here < min_angle && max_angle > max_angle_here) {
        constant_images->insert(farthest);
      }
    }
  }
}

void PartAdjuster::AdjustImages(const std::set<image_t>& images,
                                const std::set<image_t>& constant_images,
                                int max_num_iterations) {
  PriorBundleAdjustmentProblem problem;
  problem.images = images;
  problem.constant_images = constant_images;
  std::set<image_t> all = images;
  all.insert(constant_images.begin(), constant_images.end());
  if (options_.use_priors_in_adjustment) {
    problem.priors = FindPriorEdges(scene_.priors, all);
  }
  if (options_.use_coarse_motions_in_parts) {
    const std::vector<PosePriorEdge> coarse = FindCoarseEdges(scene_, all);
    problem.priors.insert(problem.priors.end(), coarse.begin(), coarse.end());
  }
  PriorBundleAdjustmentOptions options;
  options.keypoint_sigma_px = options_.keypoint_sigma_px;
  options.max_num_iterations = max_num_iterations;
  options.function_tolerance = kFunctionTolerance;
  options.num_threads = options_.num_threads;
  options.shared_errors.length_drift_ratio = scene_.data->length_drift_ratio;
  if (!constant_images.empty()) {
    // With fixed neighbours the residuals do not show the balance.
    options.keypoint_sigma_px *= keypoint_sigma_factor_;
    AdjustBundle(options, problem, &reconstruction_);
    return;
  }
  VarianceComponentOptions balance = options_.balance;
  balance.estimate_keypoint_sigma = false;  // A part that grows has few points.
  AdjustBundleWithVarianceComponents(balance, options, problem,
                                     &reconstruction_, &keypoint_sigma_factor_);
}

void PartAdjuster::AdjustAll(int max_num_iterations) {
  ++num_global_adjustments_;
  scene_.mapper.CompleteAndMergeTracks(options_.filter_max_reproj_error_px);
  AdjustImages(RegisteredImages(reconstruction_), {}, max_num_iterations);
  max_reproj_error_px_ =
      MaxReprojErrorPx(options_.filter_max_reproj_error_px, reconstruction_);
  scene_.mapper.FilterPoints(max_reproj_error_px_,
                             options_.min_triangulation_angle_deg);
}

void PartAdjuster::Filter(const std::set<image_t>& images) {
  scene_.mapper.FilterPointsInImages(
      max_reproj_error_px_, options_.min_triangulation_angle_deg, images);
}

}  // namespace adasfm
