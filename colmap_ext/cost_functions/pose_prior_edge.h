// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "colmap_ext/cost_functions/shared_errors.h"
#include "core/relative_pose_prior.h"
#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

enum class PriorTerm {
  kRotation,
  kDirection,
  kLength,
  kTranslation,
  kVelocity
};
inline constexpr int kNumPriorTerms = 5;

// Factors of the sigmas that sensors state, by PriorTerm.
using PriorSigmaFactors = std::array<double, kNumPriorTerms>;
inline constexpr PriorSigmaFactors kStatedPriorSigmas = {1.0, 1.0, 1.0, 1.0,
                                                         1.0};

// A relative-pose term of the adjustment for one edge of the augmented graph
// (paper, eq. 8; docs/reference/math.md). With P = P_j P_i^-1 of the current
// poses:
//   rotation   Log(R R^^T) / rotation_sigma_rad            3 residuals
//   direction  angle between t and t^ / direction_sigma_rad 2 residuals
//   length     (|t| - |t^|) / length_sigma_m                1 residual
//   translation  (t - t^) / translation_sigma_m             3 residuals
// A term with an infinite sigma is left out. kVelocity, the accelerometer's
// term on three images, belongs to no edge (inertial_factors.h).
struct PosePriorEdge {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  Rigid3d cam2_from_cam1;
  double rotation_sigma_rad = std::numeric_limits<double>::infinity();
  double direction_sigma_rad = std::numeric_limits<double>::infinity();
  double length_sigma_m = std::numeric_limits<double>::infinity();
  // Replaces direction and length where the motion is too short to have a
  // direction: with its length alone, every position around it would fit.
  double translation_sigma_m = std::numeric_limits<double>::infinity();
  // Whether keypoints constrain both images, too. An edge that bridges a gap by
  // itself keeps its full weight, as rejecting it would open the gap, and does
  // not count in the balance between keypoints and priors.
  bool is_held_by_points = true;
  // Whether a sensor measured the length. Otherwise the length only ties images
  // to each other and does not measure the unit, nor its own noise.
  bool is_length_measured = true;
  // Duration of a motion that sensors measured; the errors shared by their
  // whole log affect it (shared_errors.h). Negative: not measured, no shared
  // errors.
  double dt_s = -1.0;
  // Drive and rotation_by_time_shift; AssignSharedErrorWindows sets the rest.
  SharedErrorWindows windows;

  // Whether a sensor measured the length with a drive's unit.
  bool MeasuresLength() const {
    return dt_s >= 0.0 && is_length_measured &&
           (std::isfinite(length_sigma_m) ||
            std::isfinite(translation_sigma_m));
  }
  double SigmaOf(PriorTerm term) const {
    return std::array<double, kNumPriorTerms>{
        rotation_sigma_rad, direction_sigma_rad, length_sigma_m,
        translation_sigma_m,
        std::numeric_limits<double>::infinity()}[static_cast<size_t>(term)];
  }
};

// The edge of a sensor prior with the sigmas of its covariance; sigmas of
// quantities without a flag stay infinite.
PosePriorEdge PosePriorEdgeFromPrior(const RelativePosePrior& prior);

// Median of the direction sigmas of edges with a duration; 0 without any.
double MedianDirectionSigma(const std::vector<PosePriorEdge>& edges);

// Sets the windows of the shared errors of edges with a duration, in order of
// time in each drive. A window ends where an edge
// does not begin with the image that ended the previous one.
void AssignSharedErrorWindows(const SharedErrorOptions& options,
                              std::vector<PosePriorEdge>* edges);

// Returns the priors, corrected by the shared errors of an adjustment.
std::vector<PosePriorEdge> CorrectSharedErrors(
    const SharedErrorOptions& options, const SharedErrors& shared_errors,
    std::vector<PosePriorEdge> priors);

}  // namespace adasfm
