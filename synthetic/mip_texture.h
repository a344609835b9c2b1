// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

namespace adasfm {

// A flat texture in metres with its downscaled copies, sampled without
// aliasing.
class MipTexture {
 public:
  MipTexture() = default;
  // picture: CV_8UC3; its first row lies at y = 0.
  MipTexture(const cv::Mat& picture, double px_per_m);

  // The mean colour over a footprint around a point: width_m across, and
  // half_axis_m from the middle to the end of the longer axis, along which
  // several samples are taken.
  Eigen::Vector3f Sample(const Eigen::Vector2d& position_m, double width_m,
                         const Eigen::Vector2d& half_axis_m) const;

 private:
  Eigen::Vector3f SampleLevel(int level, double x, double y) const;

  double px_per_m_ = 1.0;
  std::vector<cv::Mat> levels_;
};

}  // namespace adasfm
