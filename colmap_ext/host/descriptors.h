// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>

#include "core/sqlite.h"
#include "core/types.h"

namespace adasfm {

// One local descriptor per row: the 128 bytes of SIFT as numbers, or the floats
// of a learned descriptor.
using DescriptorMatrix =
    Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Calls function(image_id, descriptors) for every image that has any, in order
// of the ids; one image is in memory at a time. Throws SqliteError, naming the
// row, for rows that COLMAP could not have written, for descriptors of unknown
// type, and for images with descriptors of different types.
void ReadDescriptors(
    SqliteConnection* database,
    const std::function<void(image_t, const DescriptorMatrix&)>& function);

}  // namespace adasfm
