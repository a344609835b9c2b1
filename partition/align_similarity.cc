// SPDX-License-Identifier: BSD-3-Clause
#include "partition/align_similarity.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/nearest_rotation.h"
#include "core/option_checker.h"
#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Sigma assumed for the orientations when the sigma of the centres is the
// threshold.
constexpr double kOrientationSigmaRad = 0.1;
// Samples of three images for each threshold: with r_min = 0.7 of inliers the
// probability that all 100 contain an outlier is 1e-18.
constexpr int kNumTrials = 100;
constexpr uint64_t kSeed = 1;
// Bounds of the adaptation. Alg. 2 has none, but any part would fit a threshold
// that grows without bound.
constexpr int kMaxNumThresholds = 20;
// No threshold exceeds this share of the target's extent: a short part would
// fit anywhere within tau_init.
constexpr double kMaxThresholdToExtent = 0.1;
// An image whose orientation is off by more than this is no inlier, however
// near its centre is.
constexpr double kMaxRotationErrorDeg = 20.0;

// The distance between the first and the last decile of the target's centres
// along their longest axis.
double ComputeExtent(const std::vector<PosePair>& poses) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const PosePair& pose : poses) {
    mean += pose.cam_from_target.TargetOriginInSource() / poses.size();
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const PosePair& pose : poses) {
    const Eigen::Vector3d centred =
        pose.cam_from_target.TargetOriginInSource() - mean;
    covariance += centred * centred.transpose();
  }
  const Eigen::Vector3d axis =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance)
          .eigenvectors()
          .col(2);
  std::vector<double> coordinates;
  for (const PosePair& pose : poses) {
    coordinates.push_back(
        axis.dot(pose.cam_from_target.TargetOriginInSource()));
  }
  std::sort(coordinates.begin(), coordinates.end());
  const size_t decile = coordinates.size() / 10;
  return coordinates[coordinates.size() - 1 - decile] - coordinates[decile];
}

// RANSAC at one threshold.
class Attempt {
 public:
  Attempt(const AlignSimilarityOptions& options,
          const std::vector<PosePair>& poses, double threshold)
      : options_(options), poses_(poses), threshold_(threshold) {
    result_.threshold = threshold;
    result_.inlier_mask.assign(poses.size(), 0);
  }

  AlignSimilarityResult Run() {
    // All images first: most parts fit, and then the result does not depend on
    // random samples. The samples of RANSAC follow.
    Consider(std::vector<char>(poses_.size(), 1));
    Random random(kSeed);
    for (int trial = 0; trial < kNumTrials; ++trial) {
      std::vector<char> mask(poses_.size(), 0);
      for (const int i : random.Sample(3, static_cast<int>(poses_.size()))) {
        mask[i] = 1;
      }
      Consider(mask);
    }
    return result_;
  }

 private:
  // Estimates from the mask, then again from the inliers while the result
  // improves.
  void Consider(const std::vector<char>& initial_mask) {
    std::vector<char> mask = initial_mask;
    for (int round = 0; round < 10; ++round) {
      Sim3d target_from_source;
      if (!EstimatePoseSimilarity(poses_, mask,
                                  threshold_ / kOrientationSigmaRad,
                                  &target_from_source)) {
        return;
      }
      std::vector<char> inlier_mask = mask;
      if (!Evaluate(target_from_source, &inlier_mask)) return;
      if (inlier_mask == mask) return;
      mask = inlier_mask;
    }
  }

  // Keeps the similarity if it is the best one so far, else returns false.
  bool Evaluate(const Sim3d& target_from_source, std::vector<char>* mask) {
    int num_inliers = 0;
    double sum_squares = 0.0;
    for (size_t i = 0; i < poses_.size(); ++i) {
      const double error =
          (target_from_source *
               poses_[i].cam_from_source.TargetOriginInSource() -
           poses_[i].cam_from_target.TargetOriginInSource())
              .norm();
      const double rotation_error_rad = AngleBetweenRad(
          Eigen::Quaterniond(poses_[i].cam_from_source.rotation *
                             target_from_source.rotation.conjugate()),
          poses_[i].cam_from_target.rotation);
      const bool is_inlier =
          error <= threshold_ &&
          rotation_error_rad <= DegToRad(kMaxRotationErrorDeg);
      (*mask)[i] = is_inlier;
      num_inliers += is_inlier;
      if (is_inlier) sum_squares += error * error;
    }
    const double ratio = 1.0 * num_inliers / poses_.size();
    const double rmse = std::sqrt(sum_squares / std::max(1, num_inliers));
    if (num_inliers == 0 || ratio < result_.inlier_ratio ||
        (ratio == result_.inlier_ratio && rmse >= result_.rmse)) {
      return false;
    }
    result_.target_from_source = target_from_source;
    result_.inlier_ratio = ratio;
    result_.rmse = rmse;
    result_.inlier_mask = *mask;
    return true;
  }

  const AlignSimilarityOptions& options_;
  const std::vector<PosePair>& poses_;
  const double threshold_;
  AlignSimilarityResult result_;
};

}  // namespace

bool AlignSimilarityOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmAlign", error)
      .AtLeast(kMinAlignmentThreshold, "initial_threshold", initial_threshold)
      .Positive("threshold_increase", threshold_increase)
      .Positive("threshold_decrease", threshold_decrease)
      .Require(min_inlier_ratio > 0.0 && min_inlier_ratio <= 1.0,
               "min_inlier_ratio", min_inlier_ratio, "must be in (0, 1]")
      .Require(max_inlier_ratio >= min_inlier_ratio, "max_inlier_ratio",
               max_inlier_ratio, "must not be below min_inlier_ratio")
      .Positive("unit", unit)
      .AllHold();
}

AlignSimilarityResult AlignSimilarity(const AlignSimilarityOptions& options,
                                      const std::vector<PosePair>& poses) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  if (poses.size() < 3) return AlignSimilarityResult();
  const double max_threshold = kMaxThresholdToExtent * ComputeExtent(poses);
  const double min_threshold =
      std::min(kMinAlignmentThreshold * options.unit, max_threshold);
  if (!(max_threshold > 0.0)) return AlignSimilarityResult();
  double threshold =
      std::min(options.initial_threshold * options.unit, max_threshold);
  AlignSimilarityResult best;
  const int max_num_iterations =
      options.adapt_threshold ? kMaxNumThresholds : 1;
  for (int iteration = 1; iteration <= max_num_iterations; ++iteration) {
    AlignSimilarityResult result = Attempt(options, poses, threshold).Run();
    result.success = result.inlier_ratio >= options.min_inlier_ratio;
    const bool was_success = best.success;
    // Lowered too far: the previous threshold is the final one.
    if (was_success && !result.success) break;
    best = result;
    best.num_iterations = iteration;
    if (!result.success) {
      if (threshold >= max_threshold) break;
      threshold = std::min(
          max_threshold, threshold + options.threshold_increase * options.unit);
    } else if (result.inlier_ratio >= options.max_inlier_ratio) {
      // Raised before: lowering the threshold again would only alternate.
      if (iteration > 1 && !was_success) break;
      if (threshold <= min_threshold) break;
      threshold = std::max(
          min_threshold, threshold - options.threshold_decrease * options.unit);
    } else {
      break;
    }
  }
  return best;
}

bool EstimatePoseSimilarity(const std::vector<PosePair>& poses,
                            const std::vector<char>& mask,
                            double orientation_weight,
                            Sim3d* target_from_source) {
  if (mask.size() != poses.size()) {
    throw std::invalid_argument("EstimatePoseSimilarity: mask size differs");
  }
  int count = 0;
  Eigen::Vector3d source_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d target_mean = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!mask[i]) continue;
    ++count;
    source_mean += poses[i].cam_from_source.TargetOriginInSource();
    target_mean += poses[i].cam_from_target.TargetOriginInSource();
  }
  if (count < 2) return false;
  source_mean /= count;
  target_mean /= count;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d orientations = Eigen::Matrix3d::Zero();
  double source_variance = 0.0;
  double target_variance = 0.0;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!mask[i]) continue;
    const Eigen::Vector3d source =
        poses[i].cam_from_source.TargetOriginInSource() - source_mean;
    const Eigen::Vector3d target =
        poses[i].cam_from_target.TargetOriginInSource() - target_mean;
    covariance += target * source.transpose();
    source_variance += source.squaredNorm();
    target_variance += target.squaredNorm();
    orientations += (poses[i].cam_from_target.rotation.conjugate() *
                     poses[i].cam_from_source.rotation)
                        .toRotationMatrix();
  }
  if (!(source_variance > 0.0) || !(target_variance > 0.0)) return false;
  // The rotation depends on the scale only through the weights of the two
  // terms: alternating between rotation and scale converges at once.
  double scale = std::sqrt(target_variance / source_variance);
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  for (int round = 0; round < 3; ++round) {
    rotation =
        NearestRotation(scale * covariance +
                        orientation_weight * orientation_weight * orientations);
    scale = (rotation.transpose() * covariance).trace() / source_variance;
    if (!(scale > 0.0) || !std::isfinite(scale)) return false;
  }
  *target_from_source = Sim3d(scale, Eigen::Quaterniond(rotation),
                              target_mean - scale * (rotation * source_mean));
  return true;
}

}  // namespace adasfm
