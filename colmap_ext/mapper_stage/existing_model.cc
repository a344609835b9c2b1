// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/existing_model.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/georeference.h"
#include "core/median.h"

namespace adasfm {
namespace {

// Priors of sensors are in metres. A model whose unit differs by more cannot be
// extended by them.
constexpr double kMaxLogScale = 0.1;

// The median ratio of the distances of successive images that both have.
double FindScale(const std::map<image_t, Rigid3d>& existing,
                 const CoarsePoseMap& coarse) {
  std::vector<double> ratios;
  const Rigid3d* last_there = nullptr;
  const Rigid3d* last_coarse = nullptr;
  for (const auto& [image_id, pose] : existing) {
    const auto found = coarse.find(image_id);
    if (found == coarse.end()) continue;
    if (last_there != nullptr) {
      const double length = (found->second.TargetOriginInSource() -
                             last_coarse->TargetOriginInSource())
                                .norm();
      const double there =
          (pose.TargetOriginInSource() - last_there->TargetOriginInSource())
              .norm();
      if (length > 0.0 && there > 0.0) ratios.push_back(there / length);
    }
    last_there = &pose;
    last_coarse = &found->second;
  }
  return ratios.empty() ? 1.0 : UpperMedian(&ratios);
}

Rigid3d ScaleTranslation(Rigid3d pose, double scale) {
  pose.translation *= scale;
  return pose;
}

std::map<image_t, Rigid3d> FindCommonPoses(
    const std::map<std::string, Rigid3d>& by_name,
    const ComponentToMap& component) {
  std::map<image_t, Rigid3d> poses;
  for (const auto& [image_id, pose] : component.coarse) {
    const auto found = by_name.find(component.data.images.at(image_id).name);
    if (found != by_name.end()) poses.emplace(image_id, found->second);
  }
  return poses;
}

}  // namespace

CoarsePosesAtExisting MoveToExistingModel(
    const std::map<image_t, Rigid3d>& existing, const CoarsePoseMap& coarse) {
  CoarsePosesAtExisting moved;
  moved.scale = FindScale(existing, coarse);
  std::vector<std::pair<image_t, Eigen::Vector3d>> centers;
  for (const auto& [image_id, pose] : existing) {
    const auto found = coarse.find(image_id);
    if (found == coarse.end()) continue;
    centers.emplace_back(image_id, found->second.TargetOriginInSource());
  }
  for (const auto& [image_id, pose] : coarse) {
    const auto fixed = existing.find(image_id);
    if (fixed != existing.end()) {
      moved.poses.emplace(image_id, fixed->second);
      continue;
    }
    const Eigen::Vector3d center = pose.TargetOriginInSource();
    const image_t nearest =
        std::min_element(centers.begin(), centers.end(),
                         [&center](const auto& a, const auto& b) {
                           return (a.second - center).squaredNorm() <
                                  (b.second - center).squaredNorm();
                         })
            ->first;
    const Rigid3d cam_from_nearest = pose * coarse.at(nearest).Inverse();
    moved.poses.emplace(
        image_id,
        ScaleTranslation(cam_from_nearest, moved.scale) * existing.at(nearest));
  }
  return moved;
}

Status UseExistingModel(const colmap::Reconstruction& existing,
                        std::vector<ComponentToMap>* components,
                        std::set<camera_t>* constant_cameras,
                        std::vector<std::string>* warnings) {
  std::map<std::string, Rigid3d> by_name;
  std::map<std::string, camera_t> camera_by_name;
  for (const auto& [image_id, pose] : CamsFromWorld(existing)) {
    const colmap::Image& image = existing.Image(image_id);
    by_name.emplace(image.Name(), pose);
    camera_by_name.emplace(image.Name(), image.CameraId());
  }
  size_t num_common = 0;
  for (ComponentToMap& component : *components) {
    SceneData& data = component.data;
    std::map<image_t, Rigid3d> poses = FindCommonPoses(by_name, component);
    if (poses.size() < 2) continue;
    num_common += poses.size();
    CoarsePosesAtExisting moved = MoveToExistingModel(poses, component.coarse);
    if (HasMetricPriors(data, component.coarse) &&
        std::abs(std::log(moved.scale)) > kMaxLogScale) {
      std::ostringstream text;
      text << "the existing model is " << moved.scale
           << " times as large as the sensors measure: it cannot be extended "
              "by priors in metres";
      return Status::Error(text.str());
    }
    component.coarse = std::move(moved.poses);
    for (const auto& [image_id, pose] : poses) {
      const SceneImage& image = data.images.at(image_id);
      const colmap::Camera& camera =
          existing.Camera(camera_by_name.at(image.name));
      const bool is_known =
          HasPriorFocalLength(data.cameras.at(image.camera_id));
      data.cameras.at(image.camera_id) =
          MakeCamera(image.camera_id, ModelIdOf(camera), camera.Width(),
                     camera.Height(), ParamsOf(camera), is_known);
      constant_cameras->insert(image.camera_id);
    }
    data.fixed_poses = std::move(poses);
    if (!data.positions.empty()) {
      warnings->push_back(
          "the positions are not used: the existing model has its own frame");
      data.positions.clear();
    }
  }
  if (num_common == 0) {
    return Status::Error(
        "no coarse model has two images of the existing model; images are "
        "recognised by their names");
  }
  if (num_common < by_name.size()) {
    warnings->push_back(std::to_string(by_name.size() - num_common) + " of " +
                        std::to_string(by_name.size()) +
                        " images of the existing model are in no coarse model");
  }
  return Status::Ok();
}

}  // namespace adasfm
