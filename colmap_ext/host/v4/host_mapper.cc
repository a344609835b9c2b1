// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/host_mapper.h"

#include <colmap/estimators/pose.h>
#include <colmap/scene/correspondence_graph.h>
#include <colmap/sfm/incremental_triangulator.h>
#include <colmap/sfm/observation_manager.h>

#include <algorithm>
#include <utility>

namespace adasfm {

// The parts of COLMAP's IncrementalMapper. That class itself needs a database's
// rigs and frames, and brings COLMAP's own bundle adjustment.
struct HostMapper::Host {
  std::shared_ptr<colmap::CorrespondenceGraph> graph =
      std::make_shared<colmap::CorrespondenceGraph>();
  std::shared_ptr<colmap::ObservationManager> observations;
  std::unique_ptr<colmap::IncrementalTriangulator> triangulator;
  // Images whose registration was tried; they come after the others.
  std::set<image_t> tried;
};

HostMapper::HostMapper(colmap::Reconstruction* reconstruction)
    : reconstruction_(*reconstruction), host_(std::make_unique<Host>()) {}

HostMapper::~HostMapper() = default;

void HostMapper::AddCamera(const colmap::Camera& camera) {
  reconstruction_.AddCameraWithTrivialRig(camera);
}

void HostMapper::AddImage(image_t image_id, const std::string& name,
                          camera_t camera_id,
                          const std::vector<Eigen::Vector2d>& keypoints) {
  colmap::Image image;
  image.SetImageId(image_id);
  image.SetName(name);
  image.SetCameraId(camera_id);
  image.SetPoints2D(keypoints);
  host_->graph->AddImage(image_id, keypoints.size());
  reconstruction_.AddImageWithTrivialFrame(std::move(image));
}

void HostMapper::AddMatches(image_t image_id1, image_t image_id2,
                            const std::vector<FeatureMatch>& matches) {
  colmap::TwoViewGeometry geometry;
  geometry.inlier_matches.reserve(matches.size());
  for (const FeatureMatch& match : matches) {
    geometry.inlier_matches.emplace_back(match.point2D_idx1,
                                         match.point2D_idx2);
  }
  host_->graph->AddTwoViewGeometry(image_id1, image_id2, std::move(geometry));
}

void HostMapper::Begin() {
  host_->graph->Finalize();
  host_->observations = std::make_shared<colmap::ObservationManager>(
      reconstruction_, host_->graph);
  host_->triangulator = std::make_unique<colmap::IncrementalTriangulator>(
      host_->graph, reconstruction_, host_->observations);
}

void HostMapper::End() {
  host_->triangulator.reset();
  host_->observations.reset();
  reconstruction_.TearDown();
}

void HostMapper::ReleaseMatches() {
  host_->triangulator.reset();
  // Without a graph, the ObservationManager counts no visible points.
  host_->observations =
      std::make_shared<colmap::ObservationManager>(reconstruction_);
  host_->graph.reset();
}

void HostMapper::FindMatches(image_t image_id, point2D_t point2D_idx,
                             std::vector<MatchedKeypoint>* matches) const {
  matches->clear();
  const auto range = host_->graph->FindCorrespondences(image_id, point2D_idx);
  for (const auto* match = range.beg; match != range.end; ++match) {
    matches->push_back({match->image_id, match->point2D_idx});
  }
}

size_t HostMapper::NumVisiblePoints(image_t image_id) const {
  return host_->observations->NumVisiblePoints3D(image_id);
}

void HostMapper::Register(image_t image_id, const Rigid3d& cam_from_world) {
  const bool is_new = !IsRegistered(reconstruction_, image_id);
  colmap::Image& image = reconstruction_.Image(image_id);
  SetCamFromWorld(cam_from_world, &image);
  if (is_new) host_->observations->RegisterFrame(image.FrameId());
}

void HostMapper::Deregister(image_t image_id) {
  host_->observations->DeRegisterFrame(
      reconstruction_.Image(image_id).FrameId());
}

colmap::point3D_t HostMapper::AddPoint(
    const Eigen::Vector3d& xyz_in_world, const colmap::Track& track,
    const Eigen::Matrix<uint8_t, 3, 1>& color) {
  return host_->observations->AddPoint3D(xyz_in_world, track, color);
}

std::vector<image_t> HostMapper::FindNextImages(int min_num_visible_points) {
  struct Candidate {
    image_t image_id;
    bool is_tried;
    int num_visible;
  };
  std::vector<Candidate> candidates;
  for (const auto& [image_id, image] : reconstruction_.Images()) {
    const int num_visible = static_cast<int>(NumVisiblePoints(image_id));
    if (image.HasPose() || num_visible < min_num_visible_points) continue;
    candidates.push_back(
        {image_id, host_->tried.count(image_id) > 0, num_visible});
  }
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) {
              if (a.is_tried != b.is_tried) return b.is_tried;
              if (a.num_visible != b.num_visible) {
                return a.num_visible > b.num_visible;
              }
              return a.image_id < b.image_id;
            });
  std::vector<image_t> image_ids;
  for (const Candidate& candidate : candidates) {
    image_ids.push_back(candidate.image_id);
  }
  return image_ids;
}

bool HostMapper::RegisterNextImage(image_t image_id, double max_reproj_error_px,
                                   int min_num_inliers) {
  constexpr double kMinInlierRatio = 0.25;  // Of COLMAP's mapper.
  host_->tried.insert(image_id);
  const colmap::Image& image = reconstruction_.Image(image_id);
  std::vector<std::pair<point2D_t, colmap::point3D_t>> keypoints;
  PointsInImage points;
  std::vector<MatchedKeypoint> matches;
  for (point2D_t idx = 0; idx < image.NumPoints2D(); ++idx) {
    FindMatches(image_id, idx, &matches);
    std::set<colmap::point3D_t> seen;
    for (const MatchedKeypoint& match : matches) {
      const colmap::Point2D& other =
          reconstruction_.Image(match.image_id).Point2D(match.point2D_idx);
      if (!other.HasPoint3D() || !seen.insert(other.point3D_id).second) {
        continue;
      }
      keypoints.emplace_back(idx, other.point3D_id);
      points.pixels.push_back(image.Point2D(idx).xy);
      points.points_in_world.push_back(
          reconstruction_.Point3D(other.point3D_id).xyz);
    }
  }
  if (static_cast<int>(points.pixels.size()) < min_num_inliers) return false;
  colmap::AbsolutePoseEstimationOptions options;
  options.ransac_options.max_error = max_reproj_error_px;
  options.ransac_options.min_inlier_ratio = kMinInlierRatio;
  // Results must not depend on threads.
  options.ransac_options.random_seed = 0;
  colmap::Camera camera = reconstruction_.Camera(image.CameraId());
  colmap::Rigid3d pose;
  size_t num_inliers = 0;
  std::vector<char> inlier_mask;
  if (!colmap::EstimateAbsolutePose(options, points.pixels,
                                    points.points_in_world, &pose, &camera,
                                    &num_inliers, &inlier_mask) ||
      static_cast<int>(num_inliers) < min_num_inliers ||
      !colmap::RefineAbsolutePose({}, inlier_mask, points.pixels,
                                  points.points_in_world, &pose, &camera)) {
    return false;
  }
  Register(image_id,
           Rigid3d(Eigen::Quaterniond(pose.rotation()), pose.translation()));
  for (size_t i = 0; i < inlier_mask.size(); ++i) {
    const auto [idx, point_id] = keypoints[i];
    if (!inlier_mask[i] || image.Point2D(idx).HasPoint3D()) continue;
    host_->observations->AddObservation(point_id, {image_id, idx});
    host_->triangulator->AddModifiedPoint3D(point_id);
  }
  return true;
}

void HostMapper::TriangulateImage(image_t image_id, double min_angle_deg) {
  colmap::IncrementalTriangulator::Options options;
  options.min_angle = min_angle_deg;
  // Straight drives have many two-view tracks. They come from verified matches,
  // and the bundle adjustment weights them.
  options.ignore_two_view_tracks = false;
  options.random_seed = 0;
  host_->triangulator->TriangulateImage(options, image_id);
}

void HostMapper::CompleteAndMergeTracks(double max_reproj_error_px) {
  colmap::IncrementalTriangulator::Options options;
  options.complete_max_reproj_error = max_reproj_error_px;
  options.merge_max_reproj_error = max_reproj_error_px;
  options.random_seed = 0;
  host_->triangulator->CompleteAllTracks(options);
  host_->triangulator->MergeAllTracks(options);
}

void HostMapper::FilterPoints(double max_reproj_error_px,
                              double min_angle_deg) {
  host_->observations->FilterAllPoints3D(max_reproj_error_px, min_angle_deg);
}

void HostMapper::FilterPointsInImages(double max_reproj_error_px,
                                      double min_angle_deg,
                                      const std::set<image_t>& image_ids) {
  host_->observations->FilterPoints3DInImages(
      max_reproj_error_px, min_angle_deg,
      colmap::FlatHashSet<image_t>(image_ids.begin(), image_ids.end()));
}

void RefinePose(const PointsInImage& points,
                const std::vector<char>& inlier_mask,
                const colmap::Camera& camera, Rigid3d* cam_from_world) {
  colmap::AbsolutePoseRefinementOptions options;
  options.max_num_iterations = 20;
  options.gradient_tolerance = 10.0;
  colmap::Camera fixed_camera = camera;
  colmap::Rigid3d pose(cam_from_world->rotation, cam_from_world->translation);
  if (!colmap::RefineAbsolutePose(options, inlier_mask, points.pixels,
                                  points.points_in_world, &pose,
                                  &fixed_camera) ||
      !pose.params.allFinite()) {
    return;
  }
  *cam_from_world =
      Rigid3d(Eigen::Quaterniond(pose.rotation()), pose.translation());
}

}  // namespace adasfm
