// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace adasfm {

// Bytes that are owned elsewhere.
struct ByteSpan {
  const uint8_t* data = nullptr;
  size_t size = 0;
};

// Reads numbers from bytes of unknown origin. A read beyond the end gives zero
// and makes the reader fail for good, so that a caller checks once at the end.
// Assumes a little-endian machine, as everywhere in this project.
class ByteReader {
 public:
  explicit ByteReader(const ByteSpan& bytes) : bytes_(bytes) {}

  bool ok() const { return ok_; }
  size_t num_left() const { return bytes_.size - position_; }

  // The next bytes; an empty span, and failure, when there are fewer.
  ByteSpan Take(uint64_t size) {
    if (!ok_ || size > num_left()) {
      ok_ = false;
      return ByteSpan();
    }
    const ByteSpan span{bytes_.data + position_, static_cast<size_t>(size)};
    position_ += span.size;
    return span;
  }

  // A number as it lies in memory, with its bytes in reverse order if `swap`.
  template <typename T>
  T Read(bool swap = false) {
    uint8_t buffer[sizeof(T)] = {};
    const ByteSpan span = Take(sizeof(T));
    if (span.size == sizeof(T)) std::memcpy(buffer, span.data, sizeof(T));
    if (swap) std::reverse(buffer, buffer + sizeof(T));
    T value;
    std::memcpy(&value, buffer, sizeof(T));
    return value;
  }

  // MCAP's strings: a length of four bytes, and the text.
  std::string ReadString() {
    const ByteSpan span = Take(Read<uint32_t>());
    return span.size == 0
               ? std::string()
               : std::string(reinterpret_cast<const char*>(span.data),
                             span.size);
  }

  size_t position() const { return position_; }

 private:
  ByteSpan bytes_;
  size_t position_ = 0;
  bool ok_ = true;
};

}  // namespace adasfm
