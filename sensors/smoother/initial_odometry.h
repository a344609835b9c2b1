// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "sensors/smoother/odometry_fusion.h"

namespace adasfm {

// Initial values of the smoother's states by dead reckoning: speeds from the
// wheels, gravity from the force that these speeds leave unexplained (so no
// standstill is needed), attitude from the gyroscope with a slow correction
// towards that gravity. One state more than links.
std::vector<OdometryState> EstimateInitialOdometry(
    const std::vector<OdometryLink>& links, const Rigid3d& imu_from_wheel,
    double gravity_m_s2, const ImuBias& bias);

}  // namespace adasfm
