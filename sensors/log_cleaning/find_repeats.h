// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace adasfm {

// A reading of an IMU: angular velocity, then specific force.
using ImuReading = Eigen::Matrix<double, 6, 1>;

// Whether the readings of a log vary from sample to sample by noise. The checks
// below do not apply to a simulation without noise, which repeats itself at
// rest.
bool HasNoise(const std::vector<ImuReading>& readings);

// Marks readings in runs of readings that are equal in all digits of num_axes
// axes from first_axis on. Such a run has at least min_num_samples readings,
// and five times as many as the log's readings usually repeat (a quantised or
// upsampled log).
std::vector<bool> FindFrozen(const std::vector<ImuReading>& readings,
                             int first_axis, int num_axes,
                             size_t min_num_samples);

// The length of the longest run of equal readings, as above.
size_t LongestRun(const std::vector<ImuReading>& readings, int first_axis,
                  int num_axes);

// Marks stretches of at least ten readings that came before in the same order:
// a buffer that was sent twice.
std::vector<bool> FindDuplicated(const std::vector<ImuReading>& readings);

// Marks readings with an axis at its largest or smallest value of the log, if
// this value is reached at least six times, three times in a row, and either
// other values do not repeat or this value is far from the median.
std::vector<bool> FindSaturated(const std::vector<ImuReading>& readings);

}  // namespace adasfm
