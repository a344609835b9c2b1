// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace colmap {
class DatabaseCache;
class IncrementalMapper;
}  // namespace colmap

namespace adasfm {

// COLMAP's IncrementalMapper on a part of a scene that is in memory already: a
// DatabaseCache is filled with the part's cameras, images and matches instead
// of being read from the database.
//
// Images may also be registered at the reconstruction itself, with any pose.
// COLMAP keeps counters of its own registrations, which decide about intrinsics
// (never changed here) and are what its FilterImages and AdjustLocalBundle
// check: those two are not offered.
//
// RegisterNextImage prints a report on std::cout. Different objects may be used
// by different threads. Results do not depend on threads: COLMAP seeds each
// RANSAC anew.
class HostMapper {
 public:
  // The reconstruction is empty and must outlive the mapper.
  explicit HostMapper(colmap::Reconstruction* reconstruction);
  ~HostMapper();

  // The part. An image's camera comes before it, a pair's images before the
  // pair.
  void AddCamera(const colmap::Camera& camera);
  void AddImage(image_t image_id, const std::string& name, camera_t camera_id,
                const std::vector<Eigen::Vector2d>& keypoints);
  void AddMatches(image_t image_id1, image_t image_id2,
                  const std::vector<FeatureMatch>& matches);

  // Puts the part's cameras and images into the reconstruction. From here on
  // the functions below may be called, and those above no more.
  void Begin();
  // Leaves the reconstruction with its registered images only.
  void End();
  // Frees the matches, which only registration and triangulation need. From
  // here on FilterPoints alone may be called.
  void ReleaseMatches();

  const colmap::CorrespondenceGraph& Graph() const;

  // The unregistered images that see this many points, most points first; those
  // that failed to register before come after the others.
  std::vector<image_t> FindNextImages(int min_num_visible_points);
  // P3P with RANSAC; on success, with that many inliers, the image is
  // registered and continues its inliers' tracks.
  bool RegisterNextImage(image_t image_id, double max_reproj_error_px,
                         int min_num_inliers);
  // Continues and creates the tracks of a registered image.
  void TriangulateImage(image_t image_id, double min_angle_deg);
  // Adds the observations that tracks miss, then joins tracks that matches
  // connect, both within max_reproj_error_px.
  void CompleteAndMergeTracks(double max_reproj_error_px);
  // Removes observations beyond the error, then points below the angle.
  void FilterPoints(double max_reproj_error_px, double min_angle_deg);

 private:
  colmap::Reconstruction& reconstruction_;
  std::unique_ptr<colmap::DatabaseCache> cache_;
  std::unique_ptr<colmap::IncrementalMapper> mapper_;
};

// Keypoints of one image (pixels) and the points that they see (world).
struct PointsInImage {
  std::vector<Eigen::Vector2d> pixels;
  std::vector<Eigen::Vector3d> points_in_world;
};

// Minimises the reprojection errors of the points in the mask, robustly. The
// pose stays as it was when the solver fails.
void RefinePose(const PointsInImage& points,
                const std::vector<char>& inlier_mask,
                const colmap::Camera& camera, Rigid3d* cam_from_world);

}  // namespace adasfm
