// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/global/two_view_scene.h"

#include <cmath>
#include <vector>

#include "core/random.h"
#include "core/so3.h"
#include "global/view_graph/epipolar.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

constexpr double kFocalPx = 700.0;
constexpr double kHalfWidthPx = 400.0;
constexpr double kHalfHeightPx = 250.0;

bool Project(const Eigen::Vector3d& point, Eigen::Vector2d* pixel) {
  if (point.z() < 1.0) return false;
  *pixel = kFocalPx * point.head<2>() / point.z();
  return std::abs(pixel->x()) < kHalfWidthPx &&
         std::abs(pixel->y()) < kHalfHeightPx;
}

Bearing BuildBearing(const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d ray(pixel.x() / kFocalPx, pixel.y() / kFocalPx, 1.0);
  Bearing bearing;
  bearing.direction = ray.normalized();
  bearing.jacobian = (Eigen::Matrix3d::Identity() -
                      bearing.direction * bearing.direction.transpose())
                         .leftCols<2>() /
                     (kFocalPx * ray.norm());
  return bearing;
}

Eigen::Vector3d DrawPoint(TwoViewLayout layout, Random* random) {
  double x = 5.0;
  if (layout != TwoViewLayout::kPlane) x += random->Uniform(-1.0, 1.0);
  if (layout == TwoViewLayout::kBothSides && random->Uniform(0.0, 1.0) < 0.5) {
    x = -x;
  }
  return {x, random->Uniform(-5.0, 1.5), random->Uniform(4.0, 25.0)};
}

Eigen::Vector2d DrawOutlier(const TwoViewSceneOptions& options,
                            const Rigid3d& cam2_from_cam1,
                            const Eigen::Vector2d& pixel1, Random* random) {
  while (true) {
    const Eigen::Vector2d pixel2(
        random->Uniform(-kHalfWidthPx, kHalfWidthPx),
        random->Uniform(-kHalfHeightPx, kHalfHeightPx));
    const double distance_px =
        ComputeEpipolarResidual(BuildBearing(pixel1), BuildBearing(pixel2),
                                cam2_from_cam1.rotation.toRotationMatrix(),
                                cam2_from_cam1.translation)
            .distance_px;
    if (std::abs(distance_px) <= options.max_outlier_px) return pixel2;
  }
}

}  // namespace

std::string ToString(TwoViewLayout layout) {
  if (layout == TwoViewLayout::kBothSides) return "both sides";
  return layout == TwoViewLayout::kOneSide ? "one side" : "plane";
}

TwoViewScene BuildTwoViewScene(const TwoViewSceneOptions& options,
                               uint64_t seed) {
  Random random(seed);
  TwoViewScene scene;
  scene.cam2_from_cam1 =
      Rigid3d(ExpSo3(random.GaussianVector(0.01)),
              Eigen::Vector3d(0.02, -0.01, -1.0).normalized() * options.step_m);
  std::vector<Bearing>& bearings1 = scene.correspondences.bearings[1];
  std::vector<Bearing>& bearings2 = scene.correspondences.bearings[2];
  std::vector<FeatureMatch>& matches =
      scene.correspondences.matches[ImagePair(1, 2)];
  while (static_cast<int>(matches.size()) < options.num_matches) {
    const Eigen::Vector3d point = DrawPoint(options.layout, &random);
    Eigen::Vector2d pixel1;
    Eigen::Vector2d pixel2;
    if (!Project(point, &pixel1) ||
        !Project(scene.cam2_from_cam1 * point, &pixel2)) {
      continue;
    }
    if (random.Uniform(0.0, 1.0) < options.outlier_ratio) {
      pixel2 = DrawOutlier(options, scene.cam2_from_cam1, pixel1, &random);
    }
    const auto index = static_cast<point2D_t>(matches.size());
    matches.push_back({index, index});
    bearings1.push_back(BuildBearing(
        pixel1 + random.GaussianVector(options.noise_px).head<2>()));
    bearings2.push_back(BuildBearing(
        pixel2 + random.GaussianVector(options.noise_px).head<2>()));
  }
  scene.graph.images = {1, 2};
  scene.graph.edges.push_back(BuildEdge(ImagePair(1, 2), scene.cam2_from_cam1));
  return scene;
}

}  // namespace adasfm
