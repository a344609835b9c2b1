// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/coarse/coarse_structure.h"
#include "colmap_ext/scene/drives.h"

namespace adasfm {

// What timeshift_cam_imu lacks, as the last adjustment of the first model with
// the drive's motions found it; drives where it is less than 1 ms are left out.
// models: largest first.
TimeShiftMap FindTimeShifts(const std::vector<CoarseModel>& models);

std::string DescribeTimeShifts(const TimeShiftMap& shifts);

}  // namespace adasfm
