// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/evaluation/evaluation.h"

#include <algorithm>
#include <cmath>

#include "colmap_ext/host/reprojection.h"
#include "core/median.h"
#include "core/nearest_rotation.h"
#include "core/random.h"
#include "core/sim3d.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// All pairs up to this number (2,000 images); with more images, this number of
// random pairs, which gives a percentage to within 0.1.
constexpr size_t kMaxNumAucPairs = 2000000;

constexpr int kNumTrimmedRefits = 5;
constexpr double kTrimFactor = 3.0;
constexpr double kMinTrimThreshold = 1e-6;
constexpr double kMinTrimDeg = 1e-4;

struct PosePair {
  Rigid3d cam_from_world;
  Rigid3d true_cam_from_world;
};

double Mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / values.size();
}

std::vector<double> ComputeDistances(const std::vector<PosePair>& poses,
                                     const Sim3d& true_from_model) {
  std::vector<double> distances;
  distances.reserve(poses.size());
  for (const PosePair& pose : poses) {
    distances.push_back(
        (true_from_model * pose.cam_from_world.TargetOriginInSource() -
         pose.true_cam_from_world.TargetOriginInSource())
            .norm());
  }
  return distances;
}

// Least squares over the poses whose distance is below the threshold.
bool Align(const std::vector<PosePair>& poses,
           const std::vector<double>& distances, double threshold,
           const AlignmentOptions& options, Sim3d* true_from_model) {
  std::vector<Eigen::Vector3d> centers;
  std::vector<Eigen::Vector3d> true_centers;
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!(distances[i] < threshold)) continue;
    centers.push_back(poses[i].cam_from_world.TargetOriginInSource());
    true_centers.push_back(poses[i].true_cam_from_world.TargetOriginInSource());
  }
  return EstimateSim3d(centers, true_centers, options, true_from_model);
}

// The rotation of the world that best fits the orientations with angles below
// the threshold (chordal mean).
Eigen::Quaterniond AlignOrientations(const std::vector<PosePair>& poses,
                                     const std::vector<double>& angles_deg,
                                     double threshold_deg) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < poses.size(); ++i) {
    if (!(angles_deg[i] < threshold_deg)) continue;
    sum += (poses[i].true_cam_from_world.rotation.conjugate() *
            poses[i].cam_from_world.rotation)
               .toRotationMatrix();
  }
  return Eigen::Quaterniond(NearestRotation(sum));
}

std::vector<double> ComputeAnglesDeg(
    const std::vector<PosePair>& poses,
    const Eigen::Quaterniond& true_from_model) {
  std::vector<double> angles_deg;
  angles_deg.reserve(poses.size());
  for (const PosePair& pose : poses) {
    angles_deg.push_back(RadToDeg(AngleBetweenRad(
        pose.cam_from_world.rotation * true_from_model.conjugate(),
        pose.true_cam_from_world.rotation)));
  }
  return angles_deg;
}

AlignmentErrors ComputeErrors(const std::vector<PosePair>& poses,
                              const Sim3d& true_from_model) {
  const std::vector<double> distances =
      ComputeDistances(poses, true_from_model);
  const std::vector<double> angles_deg =
      ComputeAnglesDeg(poses, true_from_model.rotation);
  double sum_squares = 0.0;
  for (const double distance : distances) sum_squares += distance * distance;
  AlignmentErrors errors;
  errors.scale = true_from_model.scale;
  errors.translation_rmse_m = std::sqrt(sum_squares / poses.size());
  errors.translation_mean_m = Mean(distances);
  errors.translation_median_m = Median(distances);
  errors.translation_max_m =
      *std::max_element(distances.begin(), distances.end());
  errors.rotation_mean_deg = Mean(angles_deg);
  errors.rotation_median_deg = Median(angles_deg);
  return errors;
}

// The median angle after the best rotation of the world, refitted to the images
// within three medians.
double ComputeOrientationError(const std::vector<PosePair>& poses) {
  std::vector<double> angles_deg(poses.size(), 0.0);
  double threshold_deg = 1.0;
  for (int i = 0; i <= kNumTrimmedRefits; ++i) {
    angles_deg = ComputeAnglesDeg(
        poses, AlignOrientations(poses, angles_deg, threshold_deg));
    threshold_deg = std::max(kTrimFactor * Median(angles_deg), kMinTrimDeg);
  }
  return Median(angles_deg);
}

// False when the positions do not determine the alignment.
bool AlignAndCompare(const std::vector<PosePair>& poses,
                     const AlignmentOptions& options,
                     AlignmentErrors* least_squares, AlignmentErrors* robust) {
  Sim3d true_from_model;
  if (!Align(poses, std::vector<double>(poses.size(), 0.0), 1.0, options,
             &true_from_model)) {
    return false;
  }
  *least_squares = ComputeErrors(poses, true_from_model);
  for (int i = 0; i < kNumTrimmedRefits; ++i) {
    const std::vector<double> distances =
        ComputeDistances(poses, true_from_model);
    const double threshold =
        std::max(kTrimFactor * Median(distances), kMinTrimThreshold);
    if (!Align(poses, distances, threshold, options, &true_from_model)) break;
  }
  *robust = ComputeErrors(poses, true_from_model);
  return true;
}

std::vector<RelativePoseAuc> ComputeAuc(const std::vector<PosePair>& poses) {
  RelativePoseAucCounter counter;
  const auto add = [&](const PosePair& a, const PosePair& b) {
    counter.Add(
        ComputeCam2FromCam1(a.cam_from_world, b.cam_from_world),
        ComputeCam2FromCam1(a.true_cam_from_world, b.true_cam_from_world));
  };
  const size_t n = poses.size();
  if (n * (n - 1) / 2 <= kMaxNumAucPairs) {
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = i + 1; j < n; ++j) add(poses[i], poses[j]);
    }
  } else {
    Random random(1);
    for (size_t k = 0; k < kMaxNumAucPairs; ++k) {
      const size_t i = random.UniformInt(0, n - 1);
      const size_t j = random.UniformInt(0, n - 2);
      add(poses[i], poses[j < i ? j : j + 1]);
    }
  }
  return counter.Result();
}

}  // namespace

StatusOr<Evaluation> EvaluatePoses(const NamedPoses& cams_from_world,
                                   const NamedPoses& true_cams_from_world) {
  std::vector<PosePair> poses;
  for (const auto& [name, cam_from_world] : cams_from_world) {
    const auto truth = true_cams_from_world.find(name);
    if (truth == true_cams_from_world.end()) continue;
    poses.push_back({cam_from_world, truth->second});
  }
  Evaluation evaluation;
  evaluation.num_images = cams_from_world.size();
  evaluation.num_true_images = true_cams_from_world.size();
  evaluation.num_common_images = poses.size();
  if (poses.size() < 3) {
    return Status::Error(
        "the model and the ground truth have only " +
        std::to_string(poses.size()) +
        " images in common, of 3 that are needed; compare the image names");
  }
  AlignmentOptions metric;
  metric.estimate_scale = false;
  if (!AlignAndCompare(poses, AlignmentOptions(),
                       &evaluation.sim3_least_squares, &evaluation.sim3) ||
      !AlignAndCompare(poses, metric, &evaluation.se3_least_squares,
                       &evaluation.se3)) {
    return Status::Error(
        "the images in common with the ground truth lie all in one place, so "
        "the model cannot be aligned to it");
  }
  evaluation.orientation_median_deg = ComputeOrientationError(poses);
  evaluation.relative_pose_auc = ComputeAuc(poses);
  return evaluation;
}

NamedPoses PosesOfModel(const colmap::Reconstruction& reconstruction) {
  NamedPoses poses;
  for (const image_t image_id : reconstruction.RegImageIds()) {
    const colmap::Image& image = reconstruction.Image(image_id);
    poses[image.Name()] = CamFromWorld(image);
  }
  return poses;
}

double ComputeReprojectionRmse(const colmap::Reconstruction& reconstruction) {
  // Sums in order of ids, since rounding depends on the order.
  std::map<colmap::point3D_t, const colmap::Point3D*> points;
  for (const auto& [point3D_id, point] : reconstruction.Points3D()) {
    points[point3D_id] = &point;
  }
  int64_t num_observations = 0;
  double sum_squares = 0.0;
  for (const auto& [point3D_id, point] : points) {
    const double error_px =
        point->HasError() ? ErrorOf(*point)
                          : ComputeReprojectionError(reconstruction, *point);
    num_observations += TrackOf(*point).Length();
    sum_squares += error_px * error_px * TrackOf(*point).Length();
  }
  return num_observations > 0 ? std::sqrt(sum_squares / num_observations) : 0.0;
}

StatusOr<Evaluation> EvaluateModel(const colmap::Reconstruction& reconstruction,
                                   const NamedPoses& true_cams_from_world) {
  StatusOr<Evaluation> evaluation =
      EvaluatePoses(PosesOfModel(reconstruction), true_cams_from_world);
  if (!evaluation.ok()) return evaluation;
  evaluation->num_points = reconstruction.NumPoints3D();
  if (evaluation->num_points > 0) {
    evaluation->mean_track_length = reconstruction.ComputeMeanTrackLength();
    evaluation->rmse_px = ComputeReprojectionRmse(reconstruction);
  }
  return evaluation;
}

}  // namespace adasfm
