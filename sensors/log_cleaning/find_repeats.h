// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace adasfm {

// A reading of an IMU: angular velocity, then specific force.
using ImuReading = Eigen::Matrix<double, 6, 1>;

// Whether a log's readings change from sample to sample by noise. Of a
// simulation without noise nothing below can be told: it repeats itself at
// rest.
bool HasNoise(const std::vector<ImuReading>& readings);

// Marks readings that equal the one before in all digits of the axes from
// first_axis on, in runs of at least min_num_samples and five times as many as
// the log's readings usually repeat (a quantised or upsampled log).
std::vector<bool> FindFrozen(const std::vector<ImuReading>& readings,
                             int first_axis, int num_axes,
                             size_t min_num_samples);

// The longest run of equal readings, as above.
size_t LongestRun(const std::vector<ImuReading>& readings, int first_axis,
                  int num_axes);

// Marks stretches of at least ten readings that came before in the same order:
// a buffer that was sent twice.
std::vector<bool> FindDuplicated(const std::vector<ImuReading>& readings);

// Marks readings with an axis at the largest or smallest value of the log that
// is reached at least six times, three in a row, where other values do not
// repeat or are far off.
std::vector<bool> FindSaturated(const std::vector<ImuReading>& readings);

}  // namespace adasfm
