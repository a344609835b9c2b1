// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/find_time_shifts.h"

#include <cmath>
#include <iomanip>
#include <iterator>
#include <sstream>

namespace adasfm {

TimeShiftMap FindTimeShifts(const std::vector<CoarseModel>& models) {
  // Less is left to the same unknown of the mapper's adjustments.
  constexpr double kMinShiftS = 1e-3;
  TimeShiftMap shifts;
  for (const CoarseModel& model : models) {
    if (model.rounds.empty() || !model.rounds.back().success) continue;
    const SharedErrors& errors = model.rounds.back().shared_errors;
    shifts.insert(errors.time_shift.begin(), errors.time_shift.end());
  }
  for (auto shift = shifts.begin(); shift != shifts.end();) {
    shift = std::abs(shift->second) < kMinShiftS ? shifts.erase(shift)
                                                 : std::next(shift);
  }
  return shifts;
}

std::string DescribeTimeShifts(const TimeShiftMap& shifts) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(4) << std::showpos;
  for (const auto& [drive, shift_s] : shifts) {
    text << (text.tellp() > 0 ? ", " : "") << shift_s << " s";
  }
  text << " added to timeshift_cam_imu";
  return text.str();
}

}  // namespace adasfm
