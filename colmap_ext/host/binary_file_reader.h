// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

namespace adasfm {

// Reads numbers from one of COLMAP's binary files without trusting its counts.
// A read beyond the end returns zero, and the reader then fails for good, so
// that a caller needs to check only once at the end.
class BinaryFileReader {
 public:
  explicit BinaryFileReader(const std::string& path)
      : file_(path, std::ios::binary), ok_(file_) {
    std::error_code error;
    const uintmax_t size = std::filesystem::file_size(path, error);
    if (!error) num_bytes_left_ = size;
  }

  bool ok() const { return ok_; }
  // The whole file was read, and no read went beyond its end.
  bool AtEnd() const { return ok_ && num_bytes_left_ == 0; }

  // Makes the reader fail, as a read beyond the end does.
  void Fail() { ok_ = false; }

  template <typename T>
  T Read() {
    T value{};
    if (Take(sizeof(T))) file_.read(reinterpret_cast<char*>(&value), sizeof(T));
    ok_ = ok_ && file_;
    return ok_ ? value : T{};
  }

  void Skip(uint64_t num_bytes) {
    if (Take(num_bytes)) file_.ignore(num_bytes);
    ok_ = ok_ && file_;
  }

  void SkipArray(uint64_t count, uint64_t element_num_bytes) {
    ok_ = ok_ && count <= num_bytes_left_ / element_num_bytes;
    if (ok_) Skip(count * element_num_bytes);
  }

  // A zero-terminated text.
  void SkipName() {
    while (Read<char>() != '\0') {
    }
  }

 private:
  bool Take(uint64_t num_bytes) {
    ok_ = ok_ && num_bytes <= num_bytes_left_;
    if (ok_) num_bytes_left_ -= num_bytes;
    return ok_;
  }

  std::ifstream file_;
  bool ok_;
  uint64_t num_bytes_left_ = 0;
};

}  // namespace adasfm
