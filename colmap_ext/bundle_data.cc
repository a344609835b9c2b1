// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_data.h"

#include <algorithm>
#include <cmath>

#include "colmap_ext/host/pose_conversion.h"

namespace adasfm {
namespace {

// A keypoint whose undistortion does not lead back to it within this, in px,
// has no ray.
constexpr double kMaxUndistortionErrorPx = 0.5;
// The length of a scale that nothing measures is held to this share of itself;
// no residual pulls against it, so the value is not a weight.
constexpr double kGaugeLengthRatio = 1e-3;

// False when the camera model cannot undo its distortion at this keypoint.
bool NormalizeKeypoint(const colmap::Camera& camera, const Eigen::Vector2d& xy,
                       double sigma_px, NormalizedKeypoint* keypoint) {
  // Half a pixel to either side: exact for pinholes, of third order else.
  const double step = 0.5 / camera.MeanFocalLength();
  const Eigen::Vector2d normalized = camera.ImageToWorld(xy);
  Eigen::Matrix2d jacobian;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d offset = step * Eigen::Vector2d::Unit(axis);
    jacobian.col(axis) = (camera.WorldToImage(normalized + offset) -
                          camera.WorldToImage(normalized - offset)) /
                         (2.0 * step);
  }
  const Eigen::Vector2d error = camera.WorldToImage(normalized) - xy;
  if (!jacobian.allFinite() || !(error.norm() < kMaxUndistortionErrorPx)) {
    return false;
  }
  keypoint->normalized = normalized;
  keypoint->whitened_from_normalized = jacobian / sigma_px;
  return true;
}

}  // namespace

BundleData::BundleData(const PriorBundleAdjustmentOptions& options,
                       const PriorBundleAdjustmentProblem& problem,
                       const colmap::Reconstruction& reconstruction) {
  AddImages(problem, reconstruction);
  AddPoints(options.keypoint_sigma_px, reconstruction);
  for (const PosePriorEdge& edge : problem.priors) AddPrior(edge, false);
}

void BundleData::AddImages(const PriorBundleAdjustmentProblem& problem,
                           const colmap::Reconstruction& reconstruction) {
  std::set<image_t> image_ids = problem.images;
  image_ids.insert(problem.constant_images.begin(),
                   problem.constant_images.end());
  for (const image_t image_id : image_ids) {
    if (!reconstruction.ExistsImage(image_id) ||
        !reconstruction.Image(image_id).IsRegistered()) {
      continue;
    }
    Image image;
    image.id = image_id;
    image.pose = AdjustedPose(CamFromWorld(reconstruction.Image(image_id)));
    image.is_constant = problem.constant_images.count(image_id) > 0;
    images.push_back(image);
  }
}

int BundleData::FindImage(image_t image_id) const {
  const auto it = std::lower_bound(
      images.begin(), images.end(), image_id,
      [](const Image& image, image_t id) { return image.id < id; });
  return it != images.end() && it->id == image_id
             ? static_cast<int>(it - images.begin())
             : -1;
}

std::vector<BundleData::Observation> BundleData::FindObservations(
    double keypoint_sigma_px, const colmap::Reconstruction& reconstruction,
    const colmap::Point3D& point) const {
  std::vector<Observation> result;
  bool is_adjusted = false;
  for (const colmap::TrackElement& element : point.Track().Elements()) {
    Observation observation;
    observation.image = FindImage(element.image_id);
    if (observation.image < 0) continue;
    const Image& image = images[observation.image];
    const double depth =
        image.pose.rotation.row(2).dot(point.XYZ() - image.pose.center);
    if (!(depth > kMinProjectionDepth)) continue;
    const colmap::Image& source = reconstruction.Image(element.image_id);
    observation.xy = source.Point2D(element.point2D_idx).XY();
    if (!NormalizeKeypoint(reconstruction.Camera(source.CameraId()),
                           observation.xy, keypoint_sigma_px,
                           &observation.keypoint)) {
      continue;
    }
    result.push_back(observation);
    is_adjusted = is_adjusted || !image.is_constant;
  }
  if (result.size() < 2 || !is_adjusted) return {};
  std::stable_sort(result.begin(), result.end(),
                   [](const Observation& a, const Observation& b) {
                     return a.image < b.image;
                   });
  return result;
}

void BundleData::AddPoints(double keypoint_sigma_px,
                           const colmap::Reconstruction& reconstruction) {
  std::vector<colmap::point3D_t> point_ids;
  for (const Image& image : images) {
    if (image.is_constant) continue;
    for (const auto& point2D : reconstruction.Image(image.id).Points2D()) {
      if (point2D.HasPoint3D()) point_ids.push_back(point2D.Point3DId());
    }
  }
  std::sort(point_ids.begin(), point_ids.end());
  point_ids.erase(std::unique(point_ids.begin(), point_ids.end()),
                  point_ids.end());
  for (const colmap::point3D_t point_id : point_ids) {
    const colmap::Point3D& point = reconstruction.Point3D(point_id);
    if (!point.XYZ().allFinite()) continue;
    for (Observation& observation :
         FindObservations(keypoint_sigma_px, reconstruction, point)) {
      if (points.empty() || points.back().id != point_id) {
        points.push_back({point_id, point.XYZ()});
      }
      observation.point = static_cast<int>(points.size()) - 1;
      images[observation.image].num_observations += 1;
      observations.push_back(observation);
    }
  }
}

void BundleData::AddPrior(const PosePriorEdge& edge, bool is_gauge) {
  using Term = PosePriorCost::Term;
  const int image1 = FindImage(edge.image_id1);
  const int image2 = FindImage(edge.image_id2);
  if (image1 < 0 || image2 < 0 || image1 == image2 ||
      (images[image1].is_constant && images[image2].is_constant)) {
    return;
  }
  const auto add = [&](Term term, double sigma) {
    if (!std::isfinite(sigma) || !(sigma > 0.0)) return;
    Prior prior;
    prior.image1 = image1;
    prior.image2 = image2;
    prior.cost = std::make_unique<PosePriorCost>(
        edge, term, &images[image1].pose, &images[image2].pose);
    prior.is_gauge = is_gauge;
    priors.push_back(std::move(prior));
    images[image1].num_priors += 1;
    images[image2].num_priors += 1;
  };
  add(Term::kRotation, edge.rotation_sigma_rad);
  add(Term::kDirection, edge.direction_sigma_rad);
  add(Term::kLength, edge.length_sigma_m);
}

void BundleData::FixGauge(bool has_lengths) {
  Image* first = nullptr;
  int num_constant = 0;
  for (Image& image : images) {
    if (!image.IsUsed() || !image.is_constant) continue;
    num_constant += 1;
    if (first == nullptr) first = &image;
  }
  if (first == nullptr) {
    // The first image that sees something; else the first.
    for (Image& image : images) {
      if (!image.IsUsed()) continue;
      if (first == nullptr || image.num_observations > 0) first = &image;
      if (image.num_observations > 0) break;
    }
    if (first == nullptr) return;
    first->is_constant = true;
  }
  if (has_lengths || num_constant >= 2) return;
  const Image* farthest = nullptr;
  double max_distance = 0.0;
  for (const Image& image : images) {
    const double distance = (image.pose.center - first->pose.center).norm();
    if (!image.IsUsed() || distance <= max_distance) continue;
    max_distance = distance;
    farthest = &image;
  }
  if (farthest == nullptr) return;
  PosePriorEdge edge;
  edge.image_id1 = first->id;
  edge.image_id2 = farthest->id;
  edge.cam2_from_cam1.translation = Eigen::Vector3d(0.0, 0.0, max_distance);
  edge.length_sigma_m = kGaugeLengthRatio * max_distance;
  AddPrior(edge, true);
}

int BundleData::NumFreeImages() const {
  return static_cast<int>(
      std::count_if(images.begin(), images.end(),
                    [](const Image& image) { return image.IsFree(); }));
}

int BundleData::NumResiduals() const {
  int num_residuals = 2 * static_cast<int>(observations.size());
  for (const Prior& prior : priors) {
    num_residuals += prior.cost->num_residuals();
  }
  return num_residuals;
}

bool BundleData::IsFinite() const {
  return std::all_of(images.begin(), images.end(),
                     [](const Image& image) {
                       return Eigen::Map<const Eigen::Matrix<double, 6, 1>>(
                                  image.pose.parameters)
                           .allFinite();
                     }) &&
         std::all_of(points.begin(), points.end(),
                     [](const Point& point) { return point.xyz.allFinite(); });
}

void BundleData::WriteTo(colmap::Reconstruction* reconstruction) const {
  for (const Image& image : images) {
    if (!image.IsFree()) continue;
    AdjustedPose pose = image.pose;
    pose.Update();
    SetCamFromWorld(pose.CamFromWorld(), &reconstruction->Image(image.id));
  }
  for (const Point& point : points) {
    reconstruction->Point3D(point.id).SetXYZ(point.xyz);
  }
}

}  // namespace adasfm
