// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/calibrate_focal_lengths.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <sstream>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/camera_models.h"
#include "colmap_ext/host/two_view.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "core/parallel.h"
#include "global/two_view/minimize_epipolar_distances.h"

namespace adasfm {
namespace {

// The coarse grid does not depend on the given lens: focal lengths from 0.38 to
// 2.6 times the longer side in logarithmic steps, with several distortions
// where the distortion is unknown (the minimum without distortion is not always
// near the overall minimum). Then the search continues around the best lens in
// finer steps.
constexpr int kNumSteps = 6;  // to either side
constexpr double kCoarseStep = 0.16;
constexpr double kCoarseDistortions[] = {-0.2, -0.1, 0.0, 0.1};
const Eigen::Vector3d kSteps[] = {{0.08, 0.1, 0.1}, {0.03, 0.04, 0.04}};
constexpr int kMaxNumMoves = 20;
// 1 sigma of the distortion near the rim, and of the second coefficient, of a
// lens that nobody has calibrated.
constexpr double kDistortionSigma = 0.2;
// Pairs with few matches fit many focal lengths.
constexpr size_t kMinNumMatches = 30;
constexpr int kMinNumPairs = 5;
// Sizes of the even subsets of a camera's pairs and of their matches; larger
// ones gain little.
constexpr size_t kMaxNumPairs = 200;
constexpr size_t kMaxNumMatches = 80;
// Scale of the Cauchy loss [px of epipolar distance].
constexpr double kLossScalePx = 1.5;
// Largest cost of a pair, in variances of the noise: wrong pairs and moving
// objects fit other focal lengths.
constexpr double kMaxPairCost = 25.0;
constexpr double kMinNumSigmas = 3.0;
// A focal length is used only if its 1 sigma (of the logarithm) is below this.
// Straight drives hardly constrain it.
constexpr double kMaxRelativeSigma = 0.05;
// 1 sigma, relative to the focal length, of errors that all pairs share:
// rolling shutter, a principal point off the middle. On three handheld
// recordings the estimates were 2 to 5 % too long, three to seven times the
// pairs' scatter.
constexpr double kSharedSigma = 0.035;

struct PairPoints {
  std::vector<Eigen::Vector2d> points1;
  std::vector<Eigen::Vector2d> points2;
  Eigen::Matrix3d fundamental_matrix;
};

using CostCurve = std::vector<double>;

// The logarithm of the focal length's factor, the distortion near the rim
// (first coefficient plus the second one times SquaredRimTangent: elsewhere the
// two coefficients hardly differ in effect) and the second coefficient. The
// first 1 + NumUnknownDistortions entries are estimated.
using Lens = Eigen::Vector3d;

// Number of distortion coefficients to estimate: 0 if any was given, and for
// FOV, for which zero is no valid value.
size_t NumUnknownDistortions(const colmap::Camera& camera) {
  const auto& indices = camera.ExtraParamsIdxs();
  if (camera.ModelName() == "FOV") return 0;
  for (const size_t index : indices) {
    if (ParamsOf(camera)[index] != 0.0) return 0;
  }
  return std::min<size_t>(2, indices.size());
}

// With one radial term, a wrong focal length compensates the missing second
// one, so lenses that nobody has calibrated get two.
colmap::Camera WithTwoRadialTerms(camera_t camera_id,
                                  const colmap::Camera& camera) {
  const std::string name = CameraModelName(ModelIdOf(camera));
  if ((name != "SIMPLE_RADIAL" && name != "SIMPLE_RADIAL_FISHEYE") ||
      NumUnknownDistortions(camera) == 0) {
    return camera;
  }
  std::vector<double> params = ParamsOf(camera);
  params.push_back(0.0);
  return MakeCamera(
      camera_id, *CameraModelId(name.substr(std::strlen("SIMPLE_"))),
      camera.Width(), camera.Height(), params, HasPriorFocalLength(camera));
}

// Three quarters of the squared tangent at the image's corner.
double SquaredRimTangent(const colmap::Camera& camera) {
  return 0.75 * 0.25 *
         (std::pow(camera.Width(), 2) + std::pow(camera.Height(), 2)) /
         std::pow(camera.MeanFocalLength(), 2);
}

colmap::Camera WithLens(colmap::Camera camera, const Lens& lens) {
  const size_t num_distortions = NumUnknownDistortions(camera);
  for (const size_t index : camera.FocalLengthIdxs()) {
    ParamsOf(&camera)[index] *= std::exp(lens[0]);
  }
  const double second = num_distortions > 1 ? lens[2] : 0.0;
  const double first = lens[1] - SquaredRimTangent(camera) * second;
  const auto& indices = camera.ExtraParamsIdxs();
  if (num_distortions > 0) ParamsOf(&camera)[indices[0]] = first;
  if (num_distortions > 1) ParamsOf(&camera)[indices[1]] = second;
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

std::vector<PairPoints> SelectPairs(const SceneData& scene,
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
  for (const ScenePair* pair : Subset(of_camera, kMaxNumPairs)) {
    PairPoints points;
    for (const FeatureMatch& match :
         Subset(pair->inlier_matches, kMaxNumMatches)) {
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

// The pair's least cost under this camera, in variances of the noise.
double ComputeCost(const PairPoints& pair, const colmap::Camera& camera) {
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
  minimization.loss_scale_px = kLossScalePx;
  minimization.max_num_iterations = 20;
  const EpipolarMinimum minimum = MinimizeEpipolarDistances(
      minimization,
      SelectEdgeBearings(bearings1, bearings2, matches,
                         static_cast<int>(matches.size())),
      {start.rotation.toRotationMatrix(), start.translation});
  return minimum.cost / std::pow(kMinKeypointSigmaPx, 2);
}

// least_costs: least cost of each pair over all lenses tried so far; bounded
// costs are relative to it. Relative to the present grid only, the best lens
// would change from grid to grid, and the search would go in circles.
std::vector<CostCurve> ComputeCurves(
    const FocalLengthCalibrationOptions& options,
    const std::vector<PairPoints>& pairs, const colmap::Camera& camera,
    const std::vector<Lens>& grid, std::vector<double>* least_costs) {
  std::vector<CostCurve> curves(pairs.size());
  least_costs->resize(pairs.size(), std::numeric_limits<double>::infinity());
  ParallelFor(options.num_threads, pairs.size(), [&](size_t i) {
    for (const Lens& lens : grid) {
      curves[i].push_back(ComputeCost(pairs[i], WithLens(camera, lens)));
    }
    double& least = (*least_costs)[i];
    for (const double cost : curves[i]) least = std::min(least, cost);
    for (double& cost : curves[i]) {
      cost = std::min(cost - least, kMaxPairCost);
    }
  });
  return curves;
}

double PriorCost(const Lens& lens) {
  return lens.tail<2>().squaredNorm() / std::pow(kDistortionSigma, 2);
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

// A lens and its neighbours, one step to either side in all combinations of the
// unknowns: 3, 9 or 27 lenses, with the first unknown changing fastest.
std::vector<Lens> Neighbors(const Lens& lens, const Lens& steps,
                            int num_unknowns) {
  std::vector<Lens> neighbors = {lens};
  for (int i = num_unknowns - 1; i >= 0; --i) {
    std::vector<Lens> extended;
    for (const Lens& neighbor : neighbors) {
      for (const double sign : {-1.0, 0.0, 1.0}) {
        extended.push_back(neighbor + sign * steps[i] * Lens::Unit(i));
      }
    }
    neighbors = std::move(extended);
  }
  return neighbors;
}

// Derivatives, per step, of a curve over Neighbors at its middle.
struct Derivatives {
  Eigen::Vector3d slope = Eigen::Vector3d::Zero();
  Eigen::Matrix3d curvature = Eigen::Matrix3d::Zero();
};

Derivatives Differentiate(const CostCurve& c, int num_unknowns) {
  constexpr int kStrides[] = {1, 3, 9};
  const int middle = static_cast<int>(c.size()) / 2;
  Derivatives result;
  for (int i = 0; i < num_unknowns; ++i) {
    const int di = kStrides[i];
    result.slope[i] = 0.5 * (c[middle + di] - c[middle - di]);
    result.curvature(i, i) = c[middle + di] - 2.0 * c[middle] + c[middle - di];
    for (int j = 0; j < i; ++j) {
      const int dj = kStrides[j];
      result.curvature(i, j) = result.curvature(j, i) =
          0.25 * (c[middle + di + dj] - c[middle + di - dj] -
                  c[middle - di + dj] + c[middle - di - dj]);
    }
  }
  return result;
}

struct Minimum {
  Lens lens;
  double sigma = 0.0;  // of the logarithm
  // Squared distance from the given lens, in sigmas, per unknown.
  double chi2_per_unknown = 0.0;
};

// Minimum of the paraboloid through the best lens and its neighbours. Only one
// such step: further steps followed errors that pairs share along the valley of
// focal length and distortion (KITTI 07: 717 px after one, 751 px after six,
// true 707).
std::optional<Minimum> FitMinimum(const std::vector<CostCurve>& curves,
                                  const Lens& best, const Lens& steps,
                                  int num_unknowns) {
  CostCurve prior;
  for (const Lens& lens : Neighbors(best, steps, num_unknowns)) {
    prior.push_back(PriorCost(lens));
  }
  Derivatives sum = Differentiate(prior, num_unknowns);
  Eigen::Matrix3d squared_slopes = Eigen::Matrix3d::Zero();
  for (const CostCurve& curve : curves) {
    const Derivatives of_pair = Differentiate(curve, num_unknowns);
    sum.slope += of_pair.slope;
    squared_slopes += of_pair.slope * of_pair.slope.transpose();
    sum.curvature += of_pair.curvature;
  }
  for (int i = num_unknowns; i < 3; ++i) sum.curvature(i, i) = 1.0;
  const Eigen::LLT<Eigen::Matrix3d> llt(sum.curvature);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const Lens step = -llt.solve(sum.slope).cwiseMax(-1.0).cwiseMin(1.0);
  const Eigen::Matrix3d gains = llt.solve(Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d covariance = gains * squared_slopes * gains;
  Minimum minimum;
  minimum.lens = best + steps.cwiseProduct(step);
  minimum.sigma = steps[0] * std::sqrt(covariance(0, 0));
  const Lens change = minimum.lens.cwiseQuotient(steps);
  minimum.chi2_per_unknown =
      change.head(num_unknowns)
          .dot(covariance.topLeftCorner(num_unknowns, num_unknowns)
                   .ldlt()
                   .solve(change.head(num_unknowns))) /
      num_unknowns;
  return minimum;
}

// The best lens of the coarse grid; none when its focal length is at the edge.
std::optional<Lens> FindCoarseLens(const FocalLengthCalibrationOptions& options,
                                   const std::vector<PairPoints>& pairs,
                                   const colmap::Camera& camera,
                                   std::vector<double>* least_costs) {
  const double of_longer_side = std::log(
      std::max(camera.Width(), camera.Height()) / camera.MeanFocalLength());
  std::vector<Lens> grid;
  for (const double distortion : kCoarseDistortions) {
    if (distortion != 0.0 && NumUnknownDistortions(camera) == 0) continue;
    for (int k = -kNumSteps; k <= kNumSteps; ++k) {
      grid.push_back({of_longer_side + k * kCoarseStep, distortion, 0.0});
    }
  }
  const int best =
      FindBest(ComputeCurves(options, pairs, camera, grid, least_costs), grid);
  const int of_row = best % (2 * kNumSteps + 1);
  if (of_row == 0 || of_row == 2 * kNumSteps) return std::nullopt;
  return grid[best];
}

std::optional<Minimum> FindFocalLength(
    const FocalLengthCalibrationOptions& options,
    const std::vector<PairPoints>& pairs, const colmap::Camera& camera) {
  const int num_unknowns = 1 + static_cast<int>(NumUnknownDistortions(camera));
  std::vector<double> least_costs;
  const std::optional<Lens> coarse =
      FindCoarseLens(options, pairs, camera, &least_costs);
  if (!coarse) return std::nullopt;
  Lens best = *coarse;
  int num_moves = 0;
  for (const Lens& steps : kSteps) {
    while (num_moves++ < kMaxNumMoves) {
      const std::vector<Lens> lenses = Neighbors(best, steps, num_unknowns);
      const size_t k = FindBest(
          ComputeCurves(options, pairs, camera, lenses, &least_costs), lenses);
      if (2 * k + 1 == lenses.size()) break;
      best = lenses[k];
    }
  }
  const Lens& steps = kSteps[1];
  return FitMinimum(
      ComputeCurves(options, pairs, camera,
                    Neighbors(best, steps, num_unknowns), &least_costs),
      best, steps, num_unknowns);
}

}  // namespace

std::vector<CalibratedFocalLength> CalibrateFocalLengths(
    const FocalLengthCalibrationOptions& options, SceneData* scene) {
  std::vector<CalibratedFocalLength> calibrated;
  if (!options.enabled) return calibrated;
  for (auto& [camera_id, given] : scene->cameras) {
    if (HasPriorFocalLength(given)) continue;
    const colmap::Camera camera = WithTwoRadialTerms(camera_id, given);
    const std::vector<PairPoints> pairs = SelectPairs(*scene, camera_id);
    if (pairs.size() < kMinNumPairs) continue;
    const std::optional<Minimum> minimum =
        FindFocalLength(options, pairs, camera);
    if (!minimum || minimum->sigma > kMaxRelativeSigma ||
        minimum->chi2_per_unknown < std::pow(kMinNumSigmas, 2)) {
      continue;
    }
    CalibratedFocalLength found;
    found.camera_id = camera_id;
    found.given_px = given.MeanFocalLength();
    given = WithLens(camera, minimum->lens);
    found.found_px = given.MeanFocalLength();
    found.relative_sigma = minimum->sigma;
    found.num_pairs = static_cast<int>(pairs.size());
    calibrated.push_back(found);
  }
  return calibrated;
}

std::string DescribeFocalLength(const CalibratedFocalLength& calibrated) {
  std::ostringstream text;
  text.precision(4);
  const double sigma = std::hypot(calibrated.relative_sigma, kSharedSigma);
  text << "camera " << calibrated.camera_id
       << ": the database gives no measured focal length; "
       << calibrated.num_pairs << " pairs tell " << calibrated.found_px
       << " +- " << calibrated.found_px * sigma
       << " px, which is used in place of " << calibrated.given_px << " px";
  return text.str();
}

}  // namespace adasfm
