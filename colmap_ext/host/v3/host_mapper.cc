// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/host_mapper.h"

#include <base/database_cache.h>
#include <estimators/pose.h>
#include <sfm/incremental_mapper.h>

#include <limits>
#include <memory>
#include <new>
#include <utility>

namespace adasfm {

struct HostMapper::Host {
  const colmap::CorrespondenceGraph& Graph() const {
    return std::as_const(cache).CorrespondenceGraph();
  }

  // Filled with the part's cameras, images and matches instead of being read
  // from the database.
  colmap::DatabaseCache cache;
  // Its counters of registrations only affect intrinsics, which are never
  // changed here, and its functions FilterImages and AdjustLocalBundle, which
  // are not used.
  colmap::IncrementalMapper mapper{&cache};
};

HostMapper::HostMapper(colmap::Reconstruction* reconstruction)
    : reconstruction_(*reconstruction), host_(std::make_unique<Host>()) {}

HostMapper::~HostMapper() = default;

void HostMapper::AddCamera(const colmap::Camera& camera) {
  host_->cache.AddCamera(camera);
}

void HostMapper::AddImage(image_t image_id, const std::string& name,
                          camera_t camera_id,
                          const std::vector<Eigen::Vector2d>& keypoints) {
  colmap::Image image;
  image.SetImageId(image_id);
  image.SetName(name);
  image.SetCameraId(camera_id);
  image.SetPoints2D(keypoints);
  host_->cache.AddImage(std::move(image));
}

void HostMapper::AddMatches(image_t image_id1, image_t image_id2,
                            const std::vector<FeatureMatch>& matches) {
  colmap::FeatureMatches host_matches;
  host_matches.reserve(matches.size());
  for (const FeatureMatch& match : matches) {
    host_matches.emplace_back(match.point2D_idx1, match.point2D_idx2);
  }
  // The cache is ours and not const, but COLMAP 3.8 lets only its own database
  // reader change the graph. The graph is not finalized: finalizing removes
  // images without matches, for which the mapper would then ask in vain.
  const_cast<colmap::CorrespondenceGraph&>(host_->Graph())
      .AddCorrespondences(image_id1, image_id2, host_matches);
}

void HostMapper::Begin() {
  host_->mapper.BeginReconstruction(&reconstruction_);
  // The reconstruction has its own copy of the keypoints.
  for (const auto& [image_id, image] : reconstruction_.Images()) {
    // An assignment would keep the memory: COLMAP's images are copied, not
    // moved.
    colmap::Image* copy = &host_->cache.Image(image_id);
    std::destroy_at(copy);
    new (copy) colmap::Image();
  }
}

void HostMapper::End() { host_->mapper.EndReconstruction(/*discard=*/false); }

void HostMapper::ReleaseMatches() {
  // Clears the reconstruction's pointer to the graph.
  reconstruction_.Load(colmap::DatabaseCache());
  ReleaseVisibility(&reconstruction_);
  host_.reset();
}

void HostMapper::FindMatches(image_t image_id, point2D_t point2D_idx,
                             std::vector<MatchedKeypoint>* matches) const {
  matches->clear();
  for (const auto& match :
       host_->Graph().FindCorrespondences(image_id, point2D_idx)) {
    matches->push_back({match.image_id, match.point2D_idx});
  }
}

size_t HostMapper::NumVisiblePoints(image_t image_id) const {
  return reconstruction_.Image(image_id).NumVisiblePoints3D();
}

void HostMapper::Register(image_t image_id, const Rigid3d& cam_from_world) {
  SetCamFromWorld(cam_from_world, &reconstruction_.Image(image_id));
  reconstruction_.RegisterImage(image_id);
}

void HostMapper::Deregister(image_t image_id) {
  reconstruction_.DeRegisterImage(image_id);
}

colmap::point3D_t HostMapper::AddPoint(
    const Eigen::Vector3d& xyz_in_world, const colmap::Track& track,
    const Eigen::Matrix<uint8_t, 3, 1>& color) {
  return reconstruction_.AddPoint3D(xyz_in_world, track, color);
}

std::vector<image_t> HostMapper::FindNextImages(int min_num_visible_points) {
  colmap::IncrementalMapper::Options options;
  options.image_selection_method = colmap::IncrementalMapper::Options::
      ImageSelectionMethod::MAX_VISIBLE_POINTS_NUM;
  options.abs_pose_min_num_inliers = min_num_visible_points;
  // The caller decides when to try again.
  options.max_reg_trials = std::numeric_limits<int>::max();
  return host_->mapper.FindNextImages(options);
}

bool HostMapper::RegisterNextImage(image_t image_id, double max_reproj_error_px,
                                   int min_num_inliers) {
  colmap::IncrementalMapper::Options options;
  options.abs_pose_max_error = max_reproj_error_px;
  options.abs_pose_min_num_inliers = min_num_inliers;
  options.abs_pose_refine_focal_length = false;
  options.abs_pose_refine_extra_params = false;
  options.num_threads = 1;
  return host_->mapper.RegisterNextImage(options, image_id);
}

void HostMapper::TriangulateImage(image_t image_id, double min_angle_deg) {
  colmap::IncrementalTriangulator::Options options;
  options.min_angle = min_angle_deg;
  // Straight drives have many two-view tracks. They come from verified matches,
  // and the bundle adjustment weights them.
  options.ignore_two_view_tracks = false;
  host_->mapper.TriangulateImage(options, image_id);
}

void HostMapper::CompleteAndMergeTracks(double max_reproj_error_px) {
  colmap::IncrementalTriangulator::Options options;
  options.complete_max_reproj_error = max_reproj_error_px;
  options.merge_max_reproj_error = max_reproj_error_px;
  host_->mapper.CompleteTracks(options);
  host_->mapper.MergeTracks(options);
}

void HostMapper::FilterPoints(double max_reproj_error_px,
                              double min_angle_deg) {
  reconstruction_.FilterAllPoints3D(max_reproj_error_px, min_angle_deg);
}

void HostMapper::FilterPointsInImages(double max_reproj_error_px,
                                      double min_angle_deg,
                                      const std::set<image_t>& image_ids) {
  reconstruction_.FilterPoints3DInImages(max_reproj_error_px, min_angle_deg,
                                         {image_ids.begin(), image_ids.end()});
}

void RefinePose(const PointsInImage& points,
                const std::vector<char>& inlier_mask,
                const colmap::Camera& camera, Rigid3d* cam_from_world) {
  colmap::AbsolutePoseRefinementOptions options;
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  options.print_summary = false;
  options.max_num_iterations = 20;
  options.gradient_tolerance = 10.0;
  colmap::Camera fixed_camera = camera;
  const Eigen::Quaterniond& rotation = cam_from_world->rotation;
  Eigen::Vector4d qvec(rotation.w(), rotation.x(), rotation.y(), rotation.z());
  Eigen::Vector3d tvec = cam_from_world->translation;
  if (!colmap::RefineAbsolutePose(options, inlier_mask, points.pixels,
                                  points.points_in_world, &qvec, &tvec,
                                  &fixed_camera) ||
      !qvec.allFinite() || !tvec.allFinite()) {
    return;
  }
  *cam_from_world =
      Rigid3d(Eigen::Quaterniond(qvec(0), qvec(1), qvec(2), qvec(3)), tvec);
}

}  // namespace adasfm
