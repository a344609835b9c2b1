// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sensors/bags/byte_reader.h"

namespace adasfm {

// Decodes one lz4 or zstd frame (`compression`) into *output, of at most
// max_size bytes. Returns the error, an empty text when the frame was complete;
// *output contains what was decoded before an error.
std::string Decompress(const std::string& compression, const ByteSpan& input,
                       uint64_t max_size, std::vector<uint8_t>* output);

// Whether the bytes begin like a zstd frame.
bool IsZstd(const ByteSpan& bytes);

// The checksum CRC-32 (IEEE 802.3).
uint32_t ComputeCrc32(const ByteSpan& bytes);

}  // namespace adasfm
