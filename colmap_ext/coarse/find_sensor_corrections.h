// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "colmap_ext/scene/drives.h"

namespace adasfm {

// What the sensors of each drive lack, as the last adjustment of the first
// model with the drive's motions found it (docs/reference/math.md, Shared
// errors of the odometry). models: largest first.

// What timeshift_cam_imu lacks; drives where it is less than 1 ms are left out.
TimeShiftMap FindTimeShifts(const std::vector<CoarseModel>& models);
// Drives where no axis reaches 0.5 % are left out. Empty where a model has a
// focal length that is wrong and was not refined.
GyroscopeScaleMap FindGyroscopeScales(const std::vector<CoarseModel>& models);

std::string DescribeTimeShifts(const TimeShiftMap& shifts);
std::string DescribeGyroscopeScales(const GyroscopeScaleMap& scales);

}  // namespace adasfm
