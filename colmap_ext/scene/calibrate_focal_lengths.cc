// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/calibrate_focal_lengths.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/two_view.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "core/parallel.h"
#include "global/two_view/minimize_epipolar_distances.h"

namespace adasfm {
namespace {

// Factors of the given focal length, as logarithms: from 0.38 to 2.6 of it,
// then around the best one.
constexpr int kNumSteps = 6;  // to either side
constexpr double kCoarseStep = 0.16;
constexpr double kFineStep = 0.03;
// Enough to tell the coarse step.
constexpr size_t kMaxNumCoarsePairs = 50;
// Pairs with few matches fit many focal lengths.
constexpr size_t kMinNumMatches = 30;
constexpr int kMinNumPairs = 5;
// What a pair can count for at most, in variances of the noise: wrong pairs,
// and things that move, want focal lengths of their own.
constexpr double kMaxPairCost = 25.0;
constexpr double kMinNumSigmas = 3.0;

struct PairPoints {
  std::vector<Eigen::Vector2d> points1;
  std::vector<Eigen::Vector2d> points2;
  Eigen::Matrix3d fundamental_matrix;
};

using CostCurve = std::vector<double>;

std::vector<double> Grid(double center, double step) {
  std::vector<double> grid;
  for (int k = -kNumSteps; k <= kNumSteps; ++k) {
    grid.push_back(center + k * step);
  }
  return grid;
}

colmap::Camera ScaleFocalLength(colmap::Camera camera, double log_factor) {
  for (const size_t index : camera.FocalLengthIdxs()) {
    camera.Params(index) *= std::exp(log_factor);
  }
  return camera;
}

// An even subset of count items.
template <typename T>
std::vector<T> Subset(const std::vector<T>& items, size_t count) {
  if (items.size() <= count) return items;
  std::vector<T> subset;
  for (size_t k = 0; k < count; ++k) {
    subset.push_back(items[k * items.size() / count]);
  }
  return subset;
}

std::vector<PairPoints> SelectPairs(
    const FocalLengthCalibrationOptions& options, const SceneData& scene,
    camera_t camera_id) {
  std::vector<const ScenePair*> of_camera;
  for (const ScenePair& pair : scene.pairs) {
    if (pair.inlier_matches.size() >= kMinNumMatches &&
        scene.images.at(pair.image_id1).camera_id == camera_id &&
        scene.images.at(pair.image_id2).camera_id == camera_id) {
      of_camera.push_back(&pair);
    }
  }
  std::vector<PairPoints> selected;
  for (const ScenePair* pair : Subset(of_camera, options.max_num_pairs)) {
    PairPoints points;
    for (const FeatureMatch& match :
         Subset(pair->inlier_matches, options.max_num_matches)) {
      points.points1.push_back(
          scene.images.at(pair->image_id1).keypoints[match.point2D_idx1]);
      points.points2.push_back(
          scene.images.at(pair->image_id2).keypoints[match.point2D_idx2]);
    }
    const std::optional<Eigen::Matrix3d> fundamental_matrix =
        EstimateFundamentalMatrix(points.points1, points.points2);
    if (!fundamental_matrix) continue;
    points.fundamental_matrix = *fundamental_matrix;
    selected.push_back(std::move(points));
  }
  return selected;
}

// The pair's least cost under the camera, in variances of the noise, and the
// pose of it. Searched from the given pose, or from that of the fundamental
// matrix where none is given.
double ComputeCost(const FocalLengthCalibrationOptions& options,
                   const PairPoints& pair, const colmap::Camera& camera,
                   std::optional<TwoViewPose>* pose) {
  const std::vector<Bearing> bearings1 = ComputeBearings(camera, pair.points1);
  const std::vector<Bearing> bearings2 = ComputeBearings(camera, pair.points2);
  std::vector<FeatureMatch> matches;
  for (size_t k = 0; k < bearings1.size(); ++k) {
    const point2D_t index = static_cast<point2D_t>(k);
    matches.push_back({index, index});
  }
  if (!pose->has_value()) {
    const Eigen::Matrix3d calibration = camera.CalibrationMatrix();
    const Rigid3d start = DecomposeEssential(
        calibration.transpose() * pair.fundamental_matrix * calibration,
        bearings1, bearings2, matches);
    *pose = TwoViewPose{start.rotation.toRotationMatrix(), start.translation};
  }
  EpipolarMinimization minimization;
  minimization.loss_scale_px = options.loss_scale_px;
  minimization.max_num_iterations = 20;
  const EpipolarMinimum minimum = MinimizeEpipolarDistances(
      minimization,
      SelectEdgeBearings(bearings1, bearings2, matches,
                         static_cast<int>(matches.size())),
      **pose);
  *pose = minimum.pose;
  return minimum.cost / std::pow(options.keypoint_sigma_px, 2);
}

std::vector<CostCurve> ComputeCurves(
    const FocalLengthCalibrationOptions& options,
    const std::vector<PairPoints>& pairs, const colmap::Camera& camera,
    const std::vector<double>& grid) {
  std::vector<CostCurve> curves(pairs.size());
  ParallelFor(options.num_threads, pairs.size(), [&](size_t i) {
    // From the middle outwards, as neighbours have nearly the same pose.
    curves[i].resize(grid.size());
    std::optional<TwoViewPose> middle_pose;
    const auto compute = [&](int k, std::optional<TwoViewPose>* pose) {
      curves[i][k] = ComputeCost(options, pairs[i],
                                 ScaleFocalLength(camera, grid[k]), pose);
    };
    compute(kNumSteps, &middle_pose);
    for (const int direction : {-1, 1}) {
      std::optional<TwoViewPose> pose = middle_pose;
      for (int k = 1; k <= kNumSteps; ++k) {
        compute(kNumSteps + direction * k, &pose);
      }
    }
    const double least = *std::min_element(curves[i].begin(), curves[i].end());
    for (double& cost : curves[i]) {
      cost = std::min(cost - least, kMaxPairCost);
    }
  });
  return curves;
}

int FindBest(const std::vector<CostCurve>& curves, size_t grid_size) {
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t k = 0; k < grid_size; ++k) {
    double sum = 0.0;
    for (const CostCurve& curve : curves) sum += curve[k];
    if (sum < least) {
      least = sum;
      best = static_cast<int>(k);
    }
  }
  return best;
}

struct Minimum {
  double log_factor = 0.0;
  double sigma = 0.0;
};

// Of the parabola through the best point and its neighbours.
std::optional<Minimum> FitMinimum(const std::vector<CostCurve>& curves,
                                  const std::vector<double>& grid) {
  const int best = FindBest(curves, grid.size());
  if (best == 0 || best + 1 == static_cast<int>(grid.size())) {
    return std::nullopt;
  }
  double slope = 0.0, curvature = 0.0, squared_slopes = 0.0;
  for (const CostCurve& curve : curves) {
    const double pair_slope =
        (curve[best + 1] - curve[best - 1]) / (2.0 * kFineStep);
    slope += pair_slope;
    squared_slopes += pair_slope * pair_slope;
    curvature += (curve[best + 1] - 2.0 * curve[best] + curve[best - 1]) /
                 (kFineStep * kFineStep);
  }
  if (!(curvature > 0.0)) return std::nullopt;
  return Minimum{grid[best] - slope / curvature,
                 std::sqrt(squared_slopes) / curvature};
}

std::optional<Minimum> FindFocalLength(
    const FocalLengthCalibrationOptions& options,
    const std::vector<PairPoints>& pairs, const colmap::Camera& camera) {
  const std::vector<double> coarse = Grid(0.0, kCoarseStep);
  const int best = FindBest(
      ComputeCurves(options, Subset(pairs, kMaxNumCoarsePairs), camera, coarse),
      coarse.size());
  const std::vector<double> fine = Grid(coarse[best], kFineStep);
  return FitMinimum(ComputeCurves(options, pairs, camera, fine), fine);
}

}  // namespace

bool FocalLengthCalibrationOptions::IsValid(std::string* error) const {
  if (max_num_pairs >= kMinNumPairs && max_num_matches >= 8 &&
      loss_scale_px > 0.0 && keypoint_sigma_px > 0.0 &&
      max_relative_sigma > 0.0) {
    return true;
  }
  *error =
      "focal lengths: at least 5 pairs and 8 matches, and sigmas and loss "
      "above "
      "0 are needed";
  return false;
}

std::vector<CalibratedFocalLength> CalibrateFocalLengths(
    const FocalLengthCalibrationOptions& options, SceneData* scene) {
  std::vector<CalibratedFocalLength> calibrated;
  if (!options.enabled) return calibrated;
  for (auto& [camera_id, camera] : scene->cameras) {
    if (camera.HasPriorFocalLength()) continue;
    const std::vector<PairPoints> pairs =
        SelectPairs(options, *scene, camera_id);
    if (pairs.size() < kMinNumPairs) continue;
    const std::optional<Minimum> minimum =
        FindFocalLength(options, pairs, camera);
    if (!minimum || minimum->sigma > options.max_relative_sigma ||
        std::abs(minimum->log_factor) < kMinNumSigmas * minimum->sigma) {
      continue;
    }
    CalibratedFocalLength found;
    found.camera_id = camera_id;
    found.given_px = camera.MeanFocalLength();
    camera = ScaleFocalLength(camera, minimum->log_factor);
    found.found_px = camera.MeanFocalLength();
    found.relative_sigma = minimum->sigma;
    found.num_pairs = static_cast<int>(pairs.size());
    calibrated.push_back(found);
  }
  return calibrated;
}

std::string DescribeFocalLength(const CalibratedFocalLength& calibrated) {
  std::ostringstream text;
  text.precision(4);
  text << "camera " << calibrated.camera_id
       << ": the database gives no measured focal length; "
       << calibrated.num_pairs << " pairs tell " << calibrated.found_px
       << " +- " << calibrated.found_px * calibrated.relative_sigma
       << " px, which is used in place of " << calibrated.given_px << " px";
  return text.str();
}

}  // namespace adasfm
