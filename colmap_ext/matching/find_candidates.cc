// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/matching/find_candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/so3.h"

namespace adasfm {
namespace {

// Allowed error of the prediction, in sigmas.
constexpr double kNumSigmas = 3.0;
// Distance from the epipolar line due to keypoints and calibration, in addition
// to the prediction's error [px]: COLMAP's limit for inliers.
constexpr double kMaxErrorPx = 4.0;
// Largest ratio of candidates to all pairs of keypoints. Above it, the search
// by the prediction is not faster.
constexpr double kMaxShare = 0.1;
constexpr double kMinDepthM = 0.5;
// Smallest ratio of a ray's z to its length for a point in front of the camera.
constexpr double kMinForward = 0.05;

// A wedge of the plane z = 1 of camera 2: with a = along . p,
// |across . p - offset| <= half_width + slope * max(0, a - begin),
// least <= a <= most.
struct Band {
  Eigen::Vector2d across;
  Eigen::Vector2d along;
  double offset = 0.0;
  double half_width = 0.0;
  double slope = 0.0;
  double begin = 0.0;
  double least = 0.0;
  double most = 0.0;
};

class BandFinder {
 public:
  BandFinder(const PredictedMotion& prediction, double pixel_size)
      : prediction_(prediction),
        rotation_(prediction.cam2_from_cam1.rotation.toRotationMatrix()),
        min_error_(kMaxErrorPx * pixel_size),
        greatest_inverse_depth_(
            1.0 / std::max(kMinDepthM,
                           prediction.cam2_from_cam1.translation.norm())) {}

  // False when the point at infinity is not in front of camera 2.
  bool Find(const Eigen::Vector2d& point1, Band* band) const {
    const Eigen::Vector3d ray = rotation_ * point1.homogeneous().normalized();
    if (!(ray.z() >= kMinForward)) return false;
    const Eigen::Vector3d& translation = prediction_.cam2_from_cam1.translation;
    // The image of ray + inverse depth * translation moves along a line.
    const Eigen::Vector2d begin = ray.hnormalized();
    const Eigen::Vector2d motion =
        translation.head<2>() - translation.z() * begin;
    band->along = motion.norm() > 1e-9 ? motion.normalized().eval()
                                       : Eigen::Vector2d::UnitX().eval();
    band->across = Eigen::Vector2d(-band->along.y(), band->along.x());
    band->offset = band->across.dot(begin);
    band->begin = band->along.dot(begin);
    const Eigen::Matrix2d covariance = ImageCovariance(ray, 0.0);
    band->half_width = Margin(covariance, band->across);
    band->least = band->begin - Margin(covariance, band->along);
    // Uses half the inverse depth where the nearest point would lie behind the
    // camera.
    const bool has_end =
        (ray + greatest_inverse_depth_ * translation).z() >= kMinForward;
    const double inverse_depth =
        has_end ? greatest_inverse_depth_ : 0.5 * greatest_inverse_depth_;
    const Eigen::Vector3d end = ray + inverse_depth * translation;
    if (!(end.z() >= kMinForward)) return false;
    const Eigen::Matrix2d end_covariance = ImageCovariance(ray, inverse_depth);
    const double end_along = band->along.dot(end.hnormalized());
    const double widening =
        Margin(end_covariance, band->across) - band->half_width;
    const double length = end_along - band->begin;
    if (length > min_error_) {
      band->slope = std::max(0.0, widening / length);
    } else {
      band->half_width += std::max(0.0, widening);
    }
    band->most = has_end ? end_along + Margin(end_covariance, band->along)
                         : std::numeric_limits<double>::infinity();
    return true;
  }

 private:
  // Largest distance of a keypoint from the prediction in this direction.
  double Margin(const Eigen::Matrix2d& covariance,
                const Eigen::Vector2d& direction) const {
    return min_error_ +
           kNumSigmas *
               std::sqrt(std::max(0.0, direction.dot(covariance * direction)));
  }

  // Covariance of the image of the point at this depth, from the prediction's
  // errors.
  Eigen::Matrix2d ImageCovariance(const Eigen::Vector3d& ray,
                                  double inverse_depth) const {
    const Eigen::Vector3d point =
        ray + inverse_depth * prediction_.cam2_from_cam1.translation;
    const double z = std::max(point.z(), kMinForward);
    Eigen::Matrix<double, 2, 3> projection;
    projection << 1.0, 0.0, -point.x() / z, 0.0, 1.0, -point.y() / z;
    Eigen::Matrix<double, 2, 6> jacobian;
    jacobian << projection / z * -Hat(ray), projection / z * inverse_depth;
    return jacobian * prediction_.covariance * jacobian.transpose();
  }

  const PredictedMotion& prediction_;
  const Eigen::Matrix3d rotation_;
  const double min_error_;
  const double greatest_inverse_depth_;
};

// Keypoints in blocks of neighbours, so that a band can reject most keypoints
// block by block.
class KeypointBlocks {
 public:
  explicit KeypointBlocks(const std::vector<Eigen::Vector2d>& points) {
    std::vector<int> order;
    for (size_t i = 0; i < points.size(); ++i) {
      if (points[i].allFinite()) order.push_back(i);
    }
    // Strips by x, cut by y into blocks: as many strips as blocks per strip.
    const auto sort = [&](size_t begin, size_t end, int axis) {
      std::sort(order.begin() + begin, order.begin() + end, [&](int i, int k) {
        return std::make_pair(points[i](axis), i) <
               std::make_pair(points[k](axis), k);
      });
    };
    sort(0, order.size(), 0);
    const size_t strip_size =
        kSize *
        static_cast<size_t>(std::ceil(std::sqrt(order.size() / double{kSize})));
    for (size_t begin = 0; begin < order.size(); begin += strip_size) {
      const size_t end = std::min(order.size(), begin + strip_size);
      sort(begin, end, 1);
      for (size_t i = begin; i < end; i += kSize) {
        Add(points, order.data() + i, std::min<size_t>(kSize, end - i));
      }
    }
  }

  void AppendInside(const Band& band, std::vector<int>* indices) const {
    for (const Block& block : blocks_) {
      const double along = band.along.dot(block.center);
      const double across =
          std::abs(band.across.dot(block.center) - band.offset);
      const double width =
          band.half_width +
          band.slope * std::max(0.0, along + block.radius - band.begin);
      if (across > width + block.radius || along + block.radius < band.least ||
          along - block.radius > band.most) {
        continue;
      }
      for (int k = 0; k < block.count; ++k) {
        if (IsInside(band, block.points[k])) indices->push_back(block.ids[k]);
      }
    }
  }

 private:
  static constexpr int kSize = 8;
  struct Block {
    Eigen::Vector2d center = Eigen::Vector2d::Zero();
    double radius = 0.0;
    int count = 0;
    std::array<Eigen::Vector2d, kSize> points;
    std::array<int, kSize> ids;
  };

  static bool IsInside(const Band& band, const Eigen::Vector2d& point) {
    const double along = band.along.dot(point);
    const double width =
        band.half_width + band.slope * std::max(0.0, along - band.begin);
    return std::abs(band.across.dot(point) - band.offset) <= width &&
           along >= band.least && along <= band.most;
  }

  void Add(const std::vector<Eigen::Vector2d>& points, const int* ids,
           int count) {
    Block block;
    block.count = count;
    for (int k = 0; k < count; ++k) {
      block.ids[k] = ids[k];
      block.points[k] = points[ids[k]];
      block.center += points[ids[k]] / count;
    }
    for (int k = 0; k < count; ++k) {
      block.radius =
          std::max(block.radius, (block.points[k] - block.center).norm());
    }
    blocks_.push_back(block);
  }

  std::vector<Block> blocks_;
};

}  // namespace

bool FindCandidates(const PredictedMotion& prediction,
                    const PlaneKeypoints& keypoints1,
                    const PlaneKeypoints& keypoints2,
                    MatchCandidates* candidates) {
  *candidates = MatchCandidates();
  const std::vector<Eigen::Vector2d>& points1 = keypoints1.points;
  const BandFinder finder(prediction, keypoints2.pixel_size);
  std::vector<Band> bands(points1.size());
  std::vector<char> has_band(points1.size());
  size_t num_bands = 0;
  for (size_t i = 0; i < points1.size(); ++i) {
    has_band[i] = finder.Find(points1[i], &bands[i]);
    num_bands += has_band[i];
  }
  if (num_bands == 0 || 2 * num_bands < points1.size()) return false;

  const KeypointBlocks blocks(keypoints2.points);
  const double max_num_candidates =
      kMaxShare * points1.size() * keypoints2.points.size();
  candidates->begins.push_back(0);
  for (size_t i = 0; i < points1.size(); ++i) {
    if (has_band[i]) blocks.AppendInside(bands[i], &candidates->indices);
    if (candidates->indices.size() > max_num_candidates) return false;
    candidates->begins.push_back(candidates->indices.size());
  }
  return true;
}

}  // namespace adasfm
