// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/mip_texture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace adasfm {
namespace {

constexpr int kMaxNumTaps = 8;

}  // namespace

MipTexture::MipTexture(const cv::Mat& picture, double px_per_m)
    : px_per_m_(px_per_m), levels_({picture}) {
  while (std::min(levels_.back().rows, levels_.back().cols) >= 8) {
    cv::Mat smaller;
    cv::resize(levels_.back(), smaller,
               cv::Size(levels_.back().cols / 2, levels_.back().rows / 2), 0.0,
               0.0, cv::INTER_AREA);
    levels_.push_back(smaller);
  }
}

Eigen::Vector3f MipTexture::SampleLevel(int level, double x, double y) const {
  const cv::Mat& picture = levels_[level];
  const double scale_x = static_cast<double>(picture.cols) / levels_[0].cols;
  const double scale_y = static_cast<double>(picture.rows) / levels_[0].rows;
  const float px = static_cast<float>(
      std::clamp(x * scale_x - 0.5, 0.0, picture.cols - 1.001));
  const float py = static_cast<float>(
      std::clamp(y * scale_y - 0.5, 0.0, picture.rows - 1.001));
  const int column = static_cast<int>(px);
  const int row = static_cast<int>(py);
  const float fx = px - column;
  const float fy = py - row;
  const uint8_t* top = picture.ptr<uint8_t>(row) + 3 * column;
  const uint8_t* bottom = picture.ptr<uint8_t>(row + 1) + 3 * column;
  Eigen::Vector3f color;
  for (int k = 0; k < 3; ++k) {
    color[k] = (1.0f - fy) * ((1.0f - fx) * top[k] + fx * top[k + 3]) +
               fy * ((1.0f - fx) * bottom[k] + fx * bottom[k + 3]);
  }
  return color;
}

Eigen::Vector3f MipTexture::Sample(const Eigen::Vector2d& position_m,
                                   double width_m,
                                   const Eigen::Vector2d& half_axis_m) const {
  const double length_m = 2.0 * half_axis_m.norm();
  const int num_taps = std::clamp(
      static_cast<int>(std::ceil(length_m / width_m)), 1, kMaxNumTaps);
  // Blends two levels of detail, so that no seam is visible between them.
  const double size_px = px_per_m_ * std::max(width_m, length_m / kMaxNumTaps);
  const double detail =
      std::clamp(std::log2(std::max(size_px, 1.0)), 0.0, levels_.size() - 1.0);
  const int fine = static_cast<int>(detail);
  const int coarse = std::min(fine + 1, static_cast<int>(levels_.size()) - 1);
  const float blend = static_cast<float>(detail - fine);
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (int i = 0; i < num_taps; ++i) {
    const double along = (2.0 * i + 1.0) / num_taps - 1.0;
    const Eigen::Vector2d point =
        px_per_m_ * (position_m + along * half_axis_m);
    sum += (1.0f - blend) * SampleLevel(fine, point.x(), point.y());
    if (blend > 0.0f) sum += blend * SampleLevel(coarse, point.x(), point.y());
  }
  return sum / static_cast<float>(num_taps);
}

}  // namespace adasfm
