// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "colmap_ext/adjusted_pose.h"
#include "colmap_ext/bundle_adjustment.h"
#include "colmap_ext/pose_prior_cost.h"
#include "colmap_ext/reprojection_cost.h"

namespace adasfm {

// What an adjustment works on: copies of the poses and points that take part,
// their observations and priors, in the order of ids. Both solvers change the
// copies only.
struct BundleData {
  struct Image {
    image_t id = kInvalidImageId;
    AdjustedPose pose;
    bool is_constant = false;
    int num_observations = 0;
    int num_priors = 0;

    bool IsUsed() const { return num_observations > 0 || num_priors > 0; }
    bool IsFree() const { return IsUsed() && !is_constant; }
  };
  struct Point {
    colmap::point3D_t id = 0;
    Eigen::Vector3d xyz;
  };
  struct Observation {
    // Positions in images and points.
    int image = 0;
    int point = 0;
    Eigen::Vector2d xy;
    NormalizedKeypoint keypoint;
  };
  struct Prior {
    int image1 = 0;
    int image2 = 0;
    std::unique_ptr<PosePriorCost> cost;
    // Without the robust loss: holds the gauge.
    bool is_gauge = false;
  };

  // Images without a residual do not take part, nor do points behind all but
  // one of their cameras.
  BundleData(const PriorBundleAdjustmentOptions& options,
             const PriorBundleAdjustmentProblem& problem,
             const colmap::Reconstruction& reconstruction);

  BundleData(const BundleData&) = delete;
  BundleData& operator=(const BundleData&) = delete;

  // Holds the degrees of freedom that the data leave open (see AdjustBundle).
  void FixGauge(bool has_lengths);

  int NumFreeImages() const;
  int NumResiduals() const;
  bool IsFinite() const;
  void WriteTo(colmap::Reconstruction* reconstruction) const;

  std::vector<Image> images;
  std::vector<Point> points;
  // Sorted by point, then by image.
  std::vector<Observation> observations;
  std::vector<Prior> priors;

 private:
  void AddImages(const PriorBundleAdjustmentProblem& problem,
                 const colmap::Reconstruction& reconstruction);
  void AddPoints(double keypoint_sigma_px,
                 const colmap::Reconstruction& reconstruction);
  void AddPrior(const PosePriorEdge& edge, bool is_gauge);
  // -1 when the image takes no part.
  int FindImage(image_t image_id) const;
  std::vector<Observation> FindObservations(
      double keypoint_sigma_px, const colmap::Reconstruction& reconstruction,
      const colmap::Point3D& point) const;
};

}  // namespace adasfm
