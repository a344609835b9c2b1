// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "synthetic/taylor.h"

namespace adasfm {

// Displacement from the begin of a bend of unit length by angle_rad to the arc
// length u; x along the initial direction.
Eigen::Vector2d UnitBendDisplacement(double u, double angle_rad);

// The axis of a road as a function of the distance s along it, in m: straight
// pieces and bends whose curvature rises and falls smoothly (140 u^3 (1 - u)^3
// times the angle). Angles are positive to the left.
class Path {
 public:
  Path(const Eigen::Vector2d& start, double heading_rad)
      : end_(start), end_heading_(heading_rad) {}

  void AddStraight(double length_m);
  void AddBend(double angle_rad, double length_m);

  struct Segment {
    double begin, length;
    Eigen::Vector2d start;
    double heading;
    double angle;  // 0: straight
  };
  // In order of begin.
  const std::vector<Segment>& bends() const { return bends_; }

  Eigen::Vector2d Position(double s) const;

  template <typename T>
  T Heading(const T& s) const {
    const Segment& segment = SegmentAt(Value(s));
    if (segment.angle == 0.0) return T(segment.heading);
    return T(segment.heading) +
           T(segment.angle) *
               SmoothStep((s - T(segment.begin)) * T(1.0 / segment.length));
  }

  template <typename T>
  T Curvature(const T& s) const {
    const Segment& segment = SegmentAt(Value(s));
    if (segment.angle == 0.0) return T(0.0);
    return T(segment.angle / segment.length) *
           SmoothStepDerivative((s - T(segment.begin)) *
                                T(1.0 / segment.length));
  }

 private:
  const Segment& SegmentAt(double s) const;
  void Add(double angle_rad, double length_m);

  Eigen::Vector2d end_;
  double end_heading_;
  double length_ = 0.0;
  std::vector<Segment> segments_;
  std::vector<Segment> bends_;
};

}  // namespace adasfm
