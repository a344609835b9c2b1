// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "colmap_ext/host/colmap.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

// A keypoint that is matched with a given keypoint.
struct MatchedKeypoint {
  image_t image_id = kInvalidImageId;
  point2D_t point2D_idx = 0;
};

// COLMAP's mapper on a part of a scene in memory, instead of a database: its
// registration by P3P, its triangulation and its filters.
//
// COLMAP counts, for every image, the points that the image could see. So
// between Begin and End, all images and points must be registered, added and
// removed through this class, not directly in the reconstruction.
//
// RegisterNextImage prints a report on std::cout. Different threads may use
// different objects. Results do not depend on threads: COLMAP seeds each RANSAC
// anew.
class HostMapper {
 public:
  // The reconstruction must be empty and must outlive the mapper.
  explicit HostMapper(colmap::Reconstruction* reconstruction);
  ~HostMapper();

  // Define the part. Add an image's camera before the image, and the images of
  // a pair before the pair.
  void AddCamera(const colmap::Camera& camera);
  void AddImage(image_t image_id, const std::string& name, camera_t camera_id,
                const std::vector<Eigen::Vector2d>& keypoints);
  void AddMatches(image_t image_id1, image_t image_id2,
                  const std::vector<FeatureMatch>& matches);

  // Puts the part's cameras and images into the reconstruction. After this call
  // only the functions below may be called.
  void Begin();
  // Leaves the reconstruction with its registered images only.
  void End();
  // Frees the matches, which only registration by P3P and triangulation need.
  // After this call images and points may still be registered, removed and
  // filtered.
  void ReleaseMatches();

  void FindMatches(image_t image_id, point2D_t point2D_idx,
                   std::vector<MatchedKeypoint>* matches) const;
  // Number of keypoints that are matched with a keypoint that sees a point.
  size_t NumVisiblePoints(image_t image_id) const;

  // Registers an image with this pose; a registered image gets this pose.
  void Register(image_t image_id, const Rigid3d& cam_from_world);
  // Removes a registered image's observations, and the points that fewer than
  // two images see afterwards.
  void Deregister(image_t image_id);
  colmap::point3D_t AddPoint(const Eigen::Vector3d& xyz_in_world,
                             const colmap::Track& track,
                             const Eigen::Matrix<uint8_t, 3, 1>& color =
                                 Eigen::Matrix<uint8_t, 3, 1>::Zero());

  // The unregistered images that see at least this many points, most points
  // first; images whose registration failed before come last.
  std::vector<image_t> FindNextImages(int min_num_visible_points);
  // P3P with RANSAC. On success, with at least min_num_inliers inliers,
  // registers the image and adds it to the tracks of its inliers.
  bool RegisterNextImage(image_t image_id, double max_reproj_error_px,
                         int min_num_inliers);
  // Continues tracks into a registered image and creates new tracks.
  void TriangulateImage(image_t image_id, double min_angle_deg);
  // Adds observations missing from tracks, then merges tracks that matches
  // connect, both within max_reproj_error_px.
  void CompleteAndMergeTracks(double max_reproj_error_px);
  // Removes observations beyond the error, then points below the angle.
  void FilterPoints(double max_reproj_error_px, double min_angle_deg);
  // The same for the points that these images see.
  void FilterPointsInImages(double max_reproj_error_px, double min_angle_deg,
                            const std::set<image_t>& image_ids);

 private:
  struct Host;
  colmap::Reconstruction& reconstruction_;
  std::unique_ptr<Host> host_;
};

// Keypoints of one image (pixels) and the points that they observe (world
// frame).
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
