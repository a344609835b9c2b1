// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace adasfm {

// By Gauss-Legendre.
Eigen::Vector2d UnitBendDisplacement(double u, double angle_rad) {
  constexpr std::array<double, 5> kNodes = {
      0.0, 0.5384693101056831, -0.5384693101056831, 0.9061798459386640,
      -0.9061798459386640};
  constexpr std::array<double, 5> kWeights = {
      0.5688888888888889, 0.4786286704993665, 0.4786286704993665,
      0.2369268850561891, 0.2369268850561891};
  constexpr int kNumPanels = 16;
  Eigen::Vector2d sum(0.0, 0.0);
  const double half = 0.5 * u / kNumPanels;
  for (int panel = 0; panel < kNumPanels; ++panel) {
    for (size_t k = 0; k < kNodes.size(); ++k) {
      const double angle =
          angle_rad * SmoothStep(half * (2 * panel + 1 + kNodes[k]));
      sum += half * kWeights[k] *
             Eigen::Vector2d(std::cos(angle), std::sin(angle));
    }
  }
  return sum;
}

void Path::AddStraight(double length_m) { Add(0.0, length_m); }

void Path::AddBend(double angle_rad, double length_m) {
  Add(angle_rad, length_m);
  bends_.push_back(segments_.back());
}

void Path::Add(double angle_rad, double length_m) {
  segments_.push_back({length_, length_m, end_, end_heading_, angle_rad});
  length_ += length_m;
  end_ = Position(length_);
  end_heading_ += angle_rad;
}

const Path::Segment& Path::SegmentAt(double s) const {
  const auto after = std::upper_bound(segments_.begin(), segments_.end(), s,
                                      [](double value, const Segment& segment) {
                                        return value < segment.begin;
                                      });
  return after == segments_.begin() ? segments_.front() : *std::prev(after);
}

Eigen::Vector2d Path::Position(double s) const {
  const Segment& segment = SegmentAt(s);
  Eigen::Vector2d local(s - segment.begin, 0.0);
  if (segment.angle != 0.0) {
    local = segment.length *
            UnitBendDisplacement(local.x() / segment.length, segment.angle);
  }
  return segment.start + Eigen::Rotation2Dd(segment.heading) * local;
}

}  // namespace adasfm
