// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/relative_pose_prior.h"
#include "global/odometry/odometry_chain.h"
#include "global/view_graph/view_graph.h"

namespace adasfm {

struct RotationRateOptions {
  bool enabled = true;
  // Pairs at most this many steps of the chain apart tell the rates.
  int max_num_steps = 10;
  // One correction for each of these spans.
  double window_s = 20.0;
  // 1 sigma of a correction, and of its change from one span to the next,
  // rad/s per axis. The first is OdometryChainOptions::gyro_bias_sigma_rad_s:
  // what the import leaves of the bias.
  double rate_sigma_rad_s = 2e-4;
  double drift_sigma_rad_s = 1e-4;
  // Least error granted to a visual rotation.
  double min_rotation_sigma_rad = 5e-4;

  bool IsValid(std::string* error) const;
};

struct RotationRateReport {
  // Rotations were changed.
  bool corrected = false;
  int num_pairs = 0;
  // Largest correction of a span.
  double max_rate_rad_s = 0.0;
};

// Takes out of the priors' rotations what remained of the gyroscope's bias: a
// standstill of seconds leaves degrees after minutes, and vision sees them
// in the mean of hundreds of pairs, which must not know the priors yet
// (RefineRelativePoses without predictions). Linear in the corrections, Huber
// weights.
RotationRateReport CorrectRotationRates(const RotationRateOptions& options,
                                        const OdometryChain& chain,
                                        const ViewGraph& graph,
                                        std::vector<RelativePosePrior>* priors);

}  // namespace adasfm
