// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <sstream>
#include <string>
#include <type_traits>

namespace adasfm {

// FNV-1a hash, 64 bits: detects changed data, but is not secure against
// forgery.
class Fnv1aHash {
 public:
  void AddBytes(const void* data, size_t num_bytes) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (size_t i = 0; i < num_bytes; ++i) {
      value_ = (value_ ^ bytes[i]) * 1099511628211ull;
    }
  }
  // Adds the bytes of a number.
  template <typename T>
  void Add(const T& number) {
    static_assert(std::is_arithmetic_v<T>, "padding has no fixed value");
    AddBytes(&number, sizeof(T));
  }
  uint64_t Value() const { return value_; }
  // In hexadecimal digits.
  std::string Text() const {
    std::ostringstream text;
    text << std::hex << value_;
    return text.str();
  }

 private:
  uint64_t value_ = 14695981039346656037ull;
};

}  // namespace adasfm
