// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sensors/bags/byte_reader.h"

namespace adasfm {

// Decodes a frame of lz4 or zstd (`compression`) into *output, of at most
// max_size bytes. Returns what is wrong, nothing when the frame was complete;
// *output holds what could be decoded before that.
std::string Decompress(const std::string& compression, const ByteSpan& input,
                       uint64_t max_size, std::vector<uint8_t>* output);

// Whether the bytes begin as a frame of zstd does.
bool IsZstd(const ByteSpan& bytes);

// The checksum CRC-32 (IEEE 802.3).
uint32_t ComputeCrc32(const ByteSpan& bytes);

}  // namespace adasfm
