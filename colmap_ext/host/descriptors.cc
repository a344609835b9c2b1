// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/descriptors.h"

#include <cstring>
#include <string>

namespace adasfm {

void ReadDescriptors(
    SqliteConnection* database,
    const std::function<void(image_t, const DescriptorBytes&)>& function) {
  SqliteStatement statement(
      database,
      "SELECT image_id, rows, cols, data FROM descriptors WHERE rows > 0 AND "
      "image_id IN (SELECT image_id FROM images) ORDER BY image_id");
  while (statement.Step()) {
    const int64_t num_rows = statement.Int(1);
    const int64_t num_columns = statement.Int(2);
    const int64_t num_bytes = statement.NumBytes(3);
    // The first two so that the product cannot overflow.
    if (num_rows > num_bytes || num_columns < 1 || num_columns > num_bytes ||
        num_bytes != num_rows * num_columns) {
      throw SqliteError("table descriptors, row " +
                        std::to_string(statement.Int(0)) +
                        ": malformed descriptors");
    }
    DescriptorBytes descriptors(num_rows, num_columns);
    std::memcpy(descriptors.data(), statement.Blob(3), num_bytes);
    function(statement.Int(0), descriptors);
  }
}

}  // namespace adasfm
