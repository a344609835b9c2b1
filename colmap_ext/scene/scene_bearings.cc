// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/scene_bearings.h"

#include <utility>

#include "colmap_ext/host/camera.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

struct Work {
  const colmap::Camera* camera = nullptr;
  std::vector<Eigen::Vector2d> keypoints;
  std::vector<Bearing>* bearings = nullptr;
};

void ComputeAll(int num_threads, const std::vector<Work>& work) {
  ParallelFor(num_threads, work.size(), [&work](size_t i) {
    *work[i].bearings = ComputeBearings(*work[i].camera, work[i].keypoints);
  });
}

}  // namespace

std::map<image_t, std::vector<Bearing>> ComputeSceneBearings(
    const SceneData& scene, int num_threads) {
  std::map<image_t, std::vector<Bearing>> bearings;
  std::vector<Work> work;
  for (const auto& [image_id, image] : scene.images) {
    work.push_back({&scene.cameras.at(image.camera_id), image.keypoints,
                    &bearings[image_id]});
  }
  ComputeAll(num_threads, work);
  return bearings;
}

std::map<image_t, std::vector<Bearing>> ComputeModelBearings(
    const colmap::Reconstruction& reconstruction, int num_threads) {
  std::map<image_t, std::vector<Bearing>> bearings;
  std::vector<Work> work;
  for (const image_t image_id : reconstruction.RegImageIds()) {
    const colmap::Image& image = reconstruction.Image(image_id);
    Work item;
    item.camera = &reconstruction.Camera(image.CameraId());
    for (const colmap::Point2D& point : image.Points2D()) {
      item.keypoints.push_back(XyOf(point));
    }
    item.bearings = &bearings[image_id];
    work.push_back(std::move(item));
  }
  ComputeAll(num_threads, work);
  return bearings;
}

}  // namespace adasfm
