// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/keep_inertial_unit.h"

#include <gtest/gtest.h>

#include "colmap_ext/scene/align_to_gravity.h"
#include "core/sim3d.h"
#include "tests/testing/colmap_ext/bundle_world.h"

namespace adasfm {
namespace {

// Motions between neighbouring images, with the lengths of the model.
std::vector<RelativePosePrior> PriorsOf(
    const colmap::Reconstruction& reconstruction) {
  std::vector<RelativePosePrior> priors;
  for (image_t id = 1; id < reconstruction.NumRegImages(); ++id) {
    RelativePosePrior prior;
    prior.image_id1 = id;
    prior.image_id2 = id + 1;
    prior.flags = kPriorRotation | kPriorLength | kPriorInertialLength;
    prior.cam2_from_cam1.translation =
        ComputeCam2FromCam1(CamFromWorld(reconstruction.Image(id)),
                            CamFromWorld(reconstruction.Image(id + 1)))
            .translation;
    priors.push_back(prior);
  }
  return priors;
}

double LengthOf(const colmap::Reconstruction& reconstruction) {
  return (CamFromWorld(reconstruction.Image(20)).TargetOriginInSource() -
          CamFromWorld(reconstruction.Image(1)).TargetOriginInSource())
      .norm();
}

void Shrink(double scale, colmap::Reconstruction* reconstruction) {
  TransformReconstruction(
      Sim3d(scale, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()),
      reconstruction);
}

TEST(KeepInertialUnit, UndoesAnyScaleAlsoBesideWrongLengths) {
  colmap::Reconstruction world = BuildBundleWorld({});
  const double length_m = LengthOf(world);
  std::vector<RelativePosePrior> priors = PriorsOf(world);
  // Images whose coarse places were wrong.
  for (const size_t k : {3, 4, 12}) {
    priors[k].cam2_from_cam1.translation *= k == 12 ? 0.1 : 5.0;
  }
  for (const double scale : {0.01, 1.0, 7.0}) {
    Shrink(scale, &world);
    KeepInertialUnit(priors, &world);
    EXPECT_NEAR(LengthOf(world), length_m, 1e-9 * length_m);
  }
}

TEST(KeepInertialUnit, WithoutItsLengthsNothingIsChanged) {
  colmap::Reconstruction world = BuildBundleWorld({});
  std::vector<RelativePosePrior> priors = PriorsOf(world);
  for (RelativePosePrior& prior : priors) prior.flags &= ~kPriorInertialLength;
  // A prior of an image that is not in the model.
  priors.push_back(priors.front());
  priors.back().image_id2 = 99;
  priors.back().flags |= kPriorInertialLength;
  Shrink(0.5, &world);
  const double length = LengthOf(world);
  KeepInertialUnit(priors, &world);
  EXPECT_EQ(LengthOf(world), length);
}

}  // namespace
}  // namespace adasfm
