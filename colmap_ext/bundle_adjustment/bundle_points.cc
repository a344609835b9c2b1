// SPDX-License-Identifier: BSD-3-Clause
// The points of BundleProblem and their observations.
#include <Eigen/Cholesky>
#include <algorithm>
#include <unordered_set>
#include <vector>

#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "colmap_ext/cost_functions/create_reprojection_cost.h"

namespace adasfm {

double BundleProblem::KeypointSigmaPx(camera_t camera_id) const {
  const auto ratio = options_.keypoint_sigma_ratios.find(camera_id);
  return ratio == options_.keypoint_sigma_ratios.end()
             ? options_.keypoint_sigma_px
             : options_.keypoint_sigma_px * ratio->second;
}

std::vector<BundleProblem::Observation> BundleProblem::FindObservations(
    const colmap::Reconstruction& reconstruction,
    const colmap::Point3D& point) const {
  std::vector<Observation> observations;
  bool is_adjusted = false;
  for (const colmap::TrackElement& element : TrackOf(point).Elements()) {
    const auto block = images_.find(element.image_id);
    if (block == images_.end()) continue;
    const AdjustedPose& pose = *block->second.pose;
    const double depth = pose.rotation.row(2).dot(XyzOf(point) - pose.center);
    if (!(depth > kMinProjectionDepth)) continue;
    const colmap::Image& image = reconstruction.Image(element.image_id);
    Observation observation;
    observation.image_id = element.image_id;
    observation.xy = XyOf(image.Point2D(element.point2D_idx));
    if (!NormalizeKeypoint(reconstruction.Camera(image.CameraId()),
                           observation.xy, KeypointSigmaPx(image.CameraId()),
                           &observation.keypoint)) {
      continue;
    }
    observations.push_back(observation);
    is_adjusted = is_adjusted || !block->second.is_constant;
  }
  if (observations.size() < 2 || !is_adjusted) return {};
  std::stable_sort(observations.begin(), observations.end(),
                   [](const Observation& a, const Observation& b) {
                     return a.image_id < b.image_id;
                   });
  return observations;
}

// A single observation does not constrain a point.
std::vector<std::vector<BundleProblem::Observation>> BundleProblem::CutTrack(
    const Covisibility& covisibility,
    const std::vector<Observation>& observations) {
  std::vector<image_t> images;
  for (const Observation& observation : observations) {
    images.push_back(observation.image_id);
  }
  const std::vector<int> group_of = covisibility.CutTrack(images);
  std::vector<std::vector<Observation>> groups(
      *std::max_element(group_of.begin(), group_of.end()) + 1);
  for (size_t i = 0; i < observations.size(); ++i) {
    groups[group_of[i]].push_back(observations[i]);
  }
  groups.erase(std::remove_if(groups.begin(), groups.end(),
                              [](const std::vector<Observation>& group) {
                                return group.size() < 2;
                              }),
               groups.end());
  return groups;
}

void BundleProblem::AddPoints(const colmap::Reconstruction& reconstruction,
                              const Covisibility* covisibility) {
  // In the order of the first images that see them: points that follow each
  // other then add to the same few columns of the equations, which are still
  // in the processor's cache.
  std::vector<colmap::point3D_t> point_ids;
  std::unordered_set<colmap::point3D_t> is_listed;
  for (const auto& [image_id, block] : images_) {
    if (block.is_constant) continue;
    for (const auto& point2D : reconstruction.Image(image_id).Points2D()) {
      if (point2D.HasPoint3D() && is_listed.insert(PointIdOf(point2D)).second) {
        point_ids.push_back(PointIdOf(point2D));
      }
    }
  }
  is_listed.clear();
  points_.reserve(point_ids.size());
  if (points_apart_) {
    size_t num_observations = 0;
    for (const colmap::point3D_t point_id : point_ids) {
      num_observations += TrackOf(reconstruction.Point3D(point_id)).Length();
    }
    observations_.reserve(num_observations);
  }
  for (const colmap::point3D_t point_id : point_ids) {
    const colmap::Point3D& point = reconstruction.Point3D(point_id);
    if (!XyzOf(point).allFinite()) continue;
    const std::vector<Observation> observations =
        FindObservations(reconstruction, point);
    if (observations.empty()) continue;
    const auto add = [&](const std::vector<Observation>& group) {
      points_.push_back({point_id, XyzOf(point), observations_.size()});
      for (const Observation& observation : group) {
        AddObservation(reconstruction, observation, &points_.back());
      }
    };
    if (covisibility == nullptr) {
      add(observations);
    } else {
      for (const auto& group : CutTrack(*covisibility, observations)) {
        add(group);
      }
    }
  }
}

void BundleProblem::AddObservation(const colmap::Reconstruction& reconstruction,
                                   const Observation& observation,
                                   PointBlock* point) {
  ImageBlock& block = images_.at(observation.image_id);
  block.num_observations += 1;
  if (points_apart_) {
    observations_.push_back({observation.keypoint, block.pose});
    return;
  }
  const camera_t camera_id =
      reconstruction.Image(observation.image_id).CameraId();
  CameraBlock& camera = cameras_.at(camera_id);
  if (camera.is_constant) {
    reprojection_costs_.emplace_back(observation.keypoint, block.pose);
    AddCost(&reprojection_costs_.back(), reprojection_loss_.get(), {&block},
            {point->xyz.data()});
    return;
  }
  camera.is_used = true;
  other_costs_.push_back(
      CreateCameraCost(reconstruction.Camera(camera_id), observation.xy,
                       KeypointSigmaPx(camera_id), block.pose));
  AddCost(other_costs_.back().get(), reprojection_loss_.get(), {&block},
          {point->xyz.data(), camera.params.data()});
}

BundleProblem::ObservationRange BundleProblem::ObservationsOf(size_t k) const {
  const PointObservation* data = observations_.data();
  const size_t end = k + 1 < points_.size() ? points_[k + 1].first_observation
                                            : observations_.size();
  return {data + points_[k].first_observation, data + end};
}

Eigen::Vector3d BundleProblem::PositionOf(size_t begin, size_t end) const {
  Eigen::Vector3d xyz = points_[begin].xyz;
  if (end == begin + 1) return xyz;
  // The robust weights converge slowly where observations disagree.
  constexpr int kNumIterations = 10;
  for (int iteration = 0; iteration < kNumIterations; ++iteration) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (size_t k = begin; k < end; ++k) {
      for (const PointObservation& observation : ObservationsOf(k)) {
        Eigen::Vector2d residual;
        Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
        observation.Evaluate(xyz, residual.data(), nullptr, by_point.data());
        double rho[3] = {0.0, 1.0, 0.0};
        if (reprojection_loss_ != nullptr) {
          reprojection_loss_->Evaluate(residual.squaredNorm(), rho);
        }
        information += rho[1] * by_point.transpose() * by_point;
        gradient += rho[1] * by_point.transpose() * residual;
      }
    }
    const Eigen::Vector3d step = information.ldlt().solve(gradient);
    if (!step.allFinite()) break;
    xyz -= step;
  }
  return xyz;
}

}  // namespace adasfm
