// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/calibrate_focal_lengths.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/two_view.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "core/option_checker.h"
#include "core/parallel.h"
#include "global/two_view/minimize_epipolar_distances.h"

namespace adasfm {
namespace {

// The same lenses whatever is given: focal lengths from 0.38 to 2.6 of the
// longer side, in steps of their logarithms and, where nothing is known of it,
// with several distortions (a minimum without any is not always near that of
// all). Then around the best one in steps that become finer.
constexpr int kNumSteps = 6;  // to either side
constexpr double kCoarseStep = 0.16;
constexpr double kCoarseDistortions[] = {-0.2, -0.1, 0.0, 0.1};
struct Steps {
  double log_factor;
  double distortion;
};
constexpr Steps kSteps[] = {{0.08, 0.1}, {0.03, 0.04}};
constexpr int kMaxNumMoves = 20;
// What is believed of a lens that nobody has calibrated: the share by which it
// moves a point 45 degrees off the axis.
constexpr double kDistortionSigma = 0.2;
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

// A camera's focal length, as the logarithm of its factor, and its first
// coefficient of distortion.
struct Lens {
  double log_factor = 0.0;
  double distortion = 0.0;
};

// Where the first coefficient of distortion stands when it is unknown: nobody
// has given one. Not for FOV, where zero is no lens.
std::optional<size_t> FindUnknownDistortion(const colmap::Camera& camera) {
  const auto& indices = camera.ExtraParamsIdxs();
  if (indices.empty() || camera.ModelName() == "FOV") return std::nullopt;
  for (const size_t index : indices) {
    if (ParamsOf(camera)[index] != 0.0) return std::nullopt;
  }
  return indices[0];
}

colmap::Camera WithLens(colmap::Camera camera, const Lens& lens) {
  if (const auto index = FindUnknownDistortion(camera)) {
    ParamsOf(&camera)[*index] = lens.distortion;
  }
  for (const size_t index : camera.FocalLengthIdxs()) {
    ParamsOf(&camera)[index] *= std::exp(lens.log_factor);
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

// The pair's least cost under the camera, in variances of the noise.
double ComputeCost(const FocalLengthCalibrationOptions& options,
                   const PairPoints& pair, const colmap::Camera& camera) {
  const std::vector<Bearing> bearings1 = ComputeBearings(camera, pair.points1);
  const std::vector<Bearing> bearings2 = ComputeBearings(camera, pair.points2);
  std::vector<FeatureMatch> matches;
  for (size_t k = 0; k < bearings1.size(); ++k) {
    const point2D_t index = static_cast<point2D_t>(k);
    matches.push_back({index, index});
  }
  const Eigen::Matrix3d calibration = camera.CalibrationMatrix();
  const Rigid3d start = DecomposeEssential(
      calibration.transpose() * pair.fundamental_matrix * calibration,
      bearings1, bearings2, matches);
  EpipolarMinimization minimization;
  minimization.loss_scale_px = options.loss_scale_px;
  minimization.max_num_iterations = 20;
  const EpipolarMinimum minimum = MinimizeEpipolarDistances(
      minimization,
      SelectEdgeBearings(bearings1, bearings2, matches,
                         static_cast<int>(matches.size())),
      {start.rotation.toRotationMatrix(), start.translation});
  return minimum.cost / std::pow(options.keypoint_sigma_px, 2);
}

std::vector<CostCurve> ComputeCurves(
    const FocalLengthCalibrationOptions& options,
    const std::vector<PairPoints>& pairs, const colmap::Camera& camera,
    const std::vector<Lens>& grid) {
  std::vector<CostCurve> curves(pairs.size());
  ParallelFor(options.num_threads, pairs.size(), [&](size_t i) {
    for (const Lens& lens : grid) {
      curves[i].push_back(
          ComputeCost(options, pairs[i], WithLens(camera, lens)));
    }
    const double least = *std::min_element(curves[i].begin(), curves[i].end());
    for (double& cost : curves[i]) {
      cost = std::min(cost - least, kMaxPairCost);
    }
  });
  return curves;
}

double PriorCost(const Lens& lens) {
  return std::pow(lens.distortion / kDistortionSigma, 2);
}

int FindBest(const std::vector<CostCurve>& curves,
             const std::vector<Lens>& grid) {
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (size_t k = 0; k < grid.size(); ++k) {
    double sum = PriorCost(grid[k]);
    for (const CostCurve& curve : curves) sum += curve[k];
    if (sum < least) {
      least = sum;
      best = static_cast<int>(k);
    }
  }
  return best;
}

// A lens between its neighbours: three of its distortion or, where that is an
// unknown, row by row of three distortions.
std::vector<Lens> Neighbors(const Lens& lens, const Steps& steps) {
  std::vector<Lens> neighbors;
  const int num_rows = steps.distortion > 0.0 ? 1 : 0;
  for (int row = -num_rows; row <= num_rows; ++row) {
    for (int column = -1; column <= 1; ++column) {
      neighbors.push_back({lens.log_factor + column * steps.log_factor,
                           lens.distortion + row * steps.distortion});
    }
  }
  return neighbors;
}

struct Minimum {
  Lens lens;
  double sigma = 0.0;  // of the logarithm
};

// Derivatives of a curve over Neighbors, per step.
Eigen::Vector2d Slope(const CostCurve& c) {
  if (c.size() == 3) return {0.5 * (c[2] - c[0]), 0.0};
  return 0.5 * Eigen::Vector2d(c[5] - c[3], c[7] - c[1]);
}

Eigen::Matrix2d Curvature(const CostCurve& c) {
  Eigen::Matrix2d curvature = Eigen::Matrix2d::Zero();
  if (c.size() == 3) {
    curvature(0, 0) = c[2] - 2.0 * c[1] + c[0];
    return curvature;
  }
  const double mixed = 0.25 * (c[8] - c[6] - c[2] + c[0]);
  curvature << c[5] - 2.0 * c[4] + c[3], mixed, mixed, c[7] - 2.0 * c[4] + c[1];
  return curvature;
}

// Of the paraboloid through the best lens and its neighbours.
std::optional<Minimum> FitMinimum(const std::vector<CostCurve>& curves,
                                  const Lens& best, const Steps& steps) {
  CostCurve prior;
  for (const Lens& lens : Neighbors(best, steps)) {
    prior.push_back(PriorCost(lens));
  }
  Eigen::Vector2d slope = Slope(prior);
  Eigen::Matrix2d curvature = Curvature(prior);
  Eigen::Matrix2d squared_slopes = Eigen::Matrix2d::Zero();
  for (const CostCurve& curve : curves) {
    const Eigen::Vector2d of_pair = Slope(curve);
    slope += of_pair;
    squared_slopes += of_pair * of_pair.transpose();
    curvature += Curvature(curve);
  }
  if (steps.distortion == 0.0) curvature(1, 1) = 1.0;
  const Eigen::LLT<Eigen::Matrix2d> llt(curvature);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Eigen::Vector2d step = -llt.solve(slope).cwiseMax(-1.0).cwiseMin(1.0);
  const Eigen::Vector2d gain = llt.solve(Eigen::Vector2d::UnitX());
  return Minimum{{best.log_factor + steps.log_factor * step[0],
                  best.distortion + steps.distortion * step[1]},
                 steps.log_factor * std::sqrt(gain.dot(squared_slopes * gain))};
}

std::optional<Minimum> FindFocalLength(
    const FocalLengthCalibrationOptions& options,
    const std::vector<PairPoints>& pairs, const colmap::Camera& camera) {
  const bool has_distortion = FindUnknownDistortion(camera).has_value();
  const double of_longer_side = std::log(
      std::max(camera.Width(), camera.Height()) / camera.MeanFocalLength());
  std::vector<Lens> coarse;
  for (const double distortion : kCoarseDistortions) {
    if (distortion != 0.0 && !has_distortion) continue;
    for (int k = -kNumSteps; k <= kNumSteps; ++k) {
      coarse.push_back({of_longer_side + k * kCoarseStep, distortion});
    }
  }
  const int first =
      FindBest(ComputeCurves(options, pairs, camera, coarse), coarse);
  const int of_row = first % (2 * kNumSteps + 1);
  if (of_row == 0 || of_row == 2 * kNumSteps) return std::nullopt;
  Lens best = coarse[first];
  std::optional<Minimum> fit;
  int num_moves = 0;
  for (Steps steps : kSteps) {
    if (!has_distortion) steps.distortion = 0.0;
    while (num_moves++ < kMaxNumMoves) {
      const std::vector<Lens> lenses = Neighbors(best, steps);
      const std::vector<CostCurve> curves =
          ComputeCurves(options, pairs, camera, lenses);
      const size_t k = FindBest(curves, lenses);
      fit = FitMinimum(curves, best, steps);
      if (2 * k + 1 == lenses.size()) break;
      best = lenses[k];
      fit.reset();
    }
  }
  return fit;
}

}  // namespace

bool FocalLengthCalibrationOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .AtLeast(kMinNumPairs, "max_num_pairs", max_num_pairs)
      .AtLeast(8, "max_num_matches", max_num_matches)
      .Positive({{"loss_scale_px", loss_scale_px},
                 {"keypoint_sigma_px", keypoint_sigma_px},
                 {"max_relative_sigma", max_relative_sigma}})
      .AllHold();
}

std::vector<CalibratedFocalLength> CalibrateFocalLengths(
    const FocalLengthCalibrationOptions& options, SceneData* scene) {
  std::vector<CalibratedFocalLength> calibrated;
  if (!options.enabled) return calibrated;
  for (auto& [camera_id, camera] : scene->cameras) {
    if (HasPriorFocalLength(camera)) continue;
    const std::vector<PairPoints> pairs =
        SelectPairs(options, *scene, camera_id);
    if (pairs.size() < kMinNumPairs) continue;
    const std::optional<Minimum> minimum =
        FindFocalLength(options, pairs, camera);
    if (!minimum || minimum->sigma > options.max_relative_sigma ||
        std::abs(minimum->lens.log_factor) < kMinNumSigmas * minimum->sigma) {
      continue;
    }
    CalibratedFocalLength found;
    found.camera_id = camera_id;
    found.given_px = camera.MeanFocalLength();
    camera = WithLens(camera, minimum->lens);
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
