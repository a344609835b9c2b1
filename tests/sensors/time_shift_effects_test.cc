// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/time_shift_effects.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "core/so3.h"
#include "tests/testing/sensors/synthetic_dataset.h"

namespace adasfm {
namespace {

constexpr double kShiftS = 0.004;

PriorEstimate EstimateAt(Dataset data, double shift_s) {
  data.calibration.timeshift_cam_imu_s += shift_s;
  PriorEstimationOptions options;
  options.estimate_time_shift = 0;
  const StatusOr<PriorEstimate> estimate =
      EstimatePriors(data.images, data.logs, data.calibration, {}, options);
  EXPECT_TRUE(estimate.ok()) << estimate.status().message();
  return *estimate;
}

// Norms of what a shift changes in all motions, and of what is left of that
// when the unshifted motions are corrected.
struct Changes {
  double all = 0.0;
  double left = 0.0;

  void Add(const Eigen::Vector3d& shifted, const Eigen::Vector3d& original,
           const Eigen::Vector3d& corrected) {
    all = std::hypot(all, (shifted - original).norm());
    left = std::hypot(left, (shifted - corrected).norm());
  }
};

// The import with another time shift is the oracle: the derivatives predict
// what it finds.
TEST(TimeShiftEffectsTest, PredictAnImportWithAnotherTimeShift) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Dataset data = ToDataset(BuildSyntheticWorld(SmallWorld(seed)));
    const PriorEstimate original = EstimateAt(data, 0.0);
    const PriorEstimate shifted = EstimateAt(data, kShiftS);
    ASSERT_EQ(original.priors.size(), shifted.priors.size());
    Changes rotations, translations;
    std::array<Eigen::Vector3d, 3> previous;
    for (size_t k = 0; k < original.priors.size(); ++k) {
      const Rigid3d& expected = shifted.priors[k].cam2_from_cam1;
      const Rigid3d& stated = original.priors[k].cam2_from_cam1;
      RelativePosePrior corrected = original.priors[k];
      AddTimeShift(kShiftS, &corrected);
      const auto difference = [&](const Rigid3d& motion) {
        return LogSo3(expected.rotation * motion.rotation.conjugate());
      };
      rotations.Add(Eigen::Vector3d::Zero(), difference(stated),
                    difference(corrected.cam2_from_cam1));
      // Of one translation from the one before, since the smoother finds slow
      // errors of velocity and direction otherwise.
      const std::array<Eigen::Vector3d, 3> current = {
          expected.translation, stated.translation,
          corrected.cam2_from_cam1.translation};
      if (k > 0) {
        translations.Add(current[0] - previous[0], current[1] - previous[1],
                         current[2] - previous[2]);
      }
      previous = current;
    }
    ASSERT_EQ(original.inertial_motions.size(),
              shifted.inertial_motions.size());
    Changes velocities, positions;
    for (size_t k = 0; k < original.inertial_motions.size(); ++k) {
      const InertialMotion& expected = shifted.inertial_motions[k];
      const InertialMotion& stated = original.inertial_motions[k];
      InertialMotion corrected = stated;
      AddTimeShift(kShiftS, &corrected);
      velocities.Add(expected.delta_velocity, stated.delta_velocity,
                     corrected.delta_velocity);
      positions.Add(expected.delta_position, stated.delta_position,
                    corrected.delta_position);
    }
    // What is left is the noise of a few readings.
    EXPECT_LT(rotations.left, 0.2 * rotations.all) << "seed " << seed;
    EXPECT_LT(velocities.left, 0.2 * velocities.all) << "seed " << seed;
    EXPECT_LT(positions.left, 0.25 * positions.all) << "seed " << seed;
    EXPECT_LT(translations.left, 0.3 * translations.all) << "seed " << seed;
  }
}

}  // namespace
}  // namespace adasfm
