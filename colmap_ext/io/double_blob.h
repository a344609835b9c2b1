// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>

#include "core/sqlite.h"

namespace adasfm {

// Arrays of doubles as little-endian blobs of fixed size on every machine.

void BindDoubles(SqliteStatement* statement, int parameter,
                 const double* values, size_t size);

// Throws SqliteError, beginning with `row`, for a blob of another size.
void DoublesFromBlob(const SqliteStatement& statement, int column,
                     const std::string& row, size_t size, double* values);

}  // namespace adasfm
