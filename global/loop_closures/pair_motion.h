// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "global/odometry/edge_lengths.h"
#include "global/odometry/odometry_chain.h"
#include "global/odometry/uncertain_motion.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct ChiSquare {
  double value = 0.0;
  int dof = 0;

  // Probability of a larger value; 1 without degrees of freedom.
  double Probability() const;
};

// 1 sigma of the errors added to those of a pair's own pose: of its rotation
// and direction, and of the logarithm of its length (docs/reference/math.md,
// Loop closures).
inline constexpr double kPairAngleSigmaDeg = 0.5;
inline constexpr double kPairLengthLogSigma = 0.03;

// The relative pose that a pair measures, with its covariance: the sigmas of
// its edge combined with those above.
struct PairMotion {
  enum class Translation {
    kNone,       // rotation only; the value is 0
    kDirection,  // of unknown length; the value has length 1
    kFull,
  };
  UncertainMotion motion;
  Translation translation = Translation::kNone;

  PairMotion Inverse() const;
};

// edge: with a rotation. length: in the unit of the odometry; none: not known.
// unit: a typical length in it, such as 1 m.
PairMotion MeasurePair(const ViewGraphEdge& edge,
                       const std::optional<EdgeLength>& length, double unit);

// Tests the difference of a pair and its prediction, with the covariances of
// both. has_position: of the prediction. A pair of unknown length gets the
// length that fits best, so its direction alone is tested (2 degrees of
// freedom, 3 where no positive length fits); a rotation has 3 and a full
// translation 3.
ChiSquare TestPair(const PairMotion& pair, const UncertainMotion& predicted,
                   bool has_position);

// A pair against the odometry between its images; without degrees of freedom
// where the chain does not lead from one to the other, or has no rotation.
ChiSquare TestByOdometry(const OdometryChain& chain, const ViewGraphEdge& edge,
                         const PairMotion& pair);

}  // namespace adasfm
