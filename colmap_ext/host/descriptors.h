// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "core/sqlite.h"
#include "core/types.h"

namespace adasfm {

// One local descriptor a row, as the database holds them (SIFT: 128 bytes).
using DescriptorBytes =
    Eigen::Matrix<uint8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Calls function(image_id, descriptors) for every image that has any, in order
// of the ids; one image is in memory at a time. Throws SqliteError, naming the
// row, for rows that COLMAP could not have written.
void ReadDescriptors(
    SqliteConnection* database,
    const std::function<void(image_t, const DescriptorBytes&)>& function);

}  // namespace adasfm
