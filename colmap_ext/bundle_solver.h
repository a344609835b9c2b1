// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "colmap_ext/bundle_adjustment.h"
#include "colmap_ext/bundle_data.h"

namespace adasfm {

// Minimises the cost of the data over its free poses and points, intrinsics
// fixed: Levenberg-Marquardt with the points eliminated (Schur complement,
// docs/math.md). Every sum is taken in an order that the data alone decide, so
// the result does not depend on the number of threads. The data are finite
// afterwards; summary->success tells whether they got better.
void SolveBundle(const PriorBundleAdjustmentOptions& options, BundleData* data,
                 PriorBundleAdjustmentSummary* summary);

// The same with the intrinsics that the options ask for as unknowns, by Ceres;
// `cameras` is changed on success.
void SolveBundleWithCameras(const PriorBundleAdjustmentOptions& options,
                            BundleData* data,
                            colmap::Reconstruction* reconstruction,
                            PriorBundleAdjustmentSummary* summary);

}  // namespace adasfm
