// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/double_blob.h"

#include <cstdint>
#include <cstring>

namespace adasfm {
namespace {

std::string BlobFromDoubles(const double* values, size_t size) {
  std::string blob;
  blob.reserve(size * sizeof(double));
  for (size_t i = 0; i < size; ++i) {
    uint64_t bits;
    std::memcpy(&bits, &values[i], sizeof(bits));
    for (int byte = 0; byte < 8; ++byte) {
      blob.push_back(static_cast<char>((bits >> (8 * byte)) & 0xff));
    }
  }
  return blob;
}

}  // namespace

void BindDoubles(SqliteStatement* statement, int parameter,
                 const double* values, size_t size) {
  const std::string blob = BlobFromDoubles(values, size);
  statement->BindBlob(parameter, blob.data(), blob.size());
}

void DoublesFromBlob(const SqliteStatement& statement, int column,
                     const std::string& row, size_t size, double* values) {
  if (statement.NumBytes(column) != size * sizeof(double)) {
    throw SqliteError(
        row + ": a blob of " + std::to_string(statement.NumBytes(column)) +
        " bytes instead of " + std::to_string(size * sizeof(double)));
  }
  const auto* bytes = static_cast<const unsigned char*>(statement.Blob(column));
  for (size_t i = 0; i < size; ++i) {
    uint64_t bits = 0;
    for (int byte = 0; byte < 8; ++byte) {
      bits |= static_cast<uint64_t>(bytes[8 * i + byte]) << (8 * byte);
    }
    std::memcpy(&values[i], &bits, sizeof(bits));
  }
}

}  // namespace adasfm
