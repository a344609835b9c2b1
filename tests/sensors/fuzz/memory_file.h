// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <string>

namespace adasfm {

// A file that never touches the disk, for parsers that take a path.
class MemoryFile {
 public:
  MemoryFile(const uint8_t* data, size_t size)
      : descriptor_(memfd_create("fuzz", 0)),
        path_("/proc/self/fd/" + std::to_string(descriptor_)) {
    if (descriptor_ < 0) __builtin_trap();
    for (size_t done = 0; done < size;) {
      const ssize_t written = write(descriptor_, data + done, size - done);
      if (written <= 0) __builtin_trap();
      done += static_cast<size_t>(written);
    }
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  const std::string& path() const { return path_; }

 private:
  int descriptor_;
  std::string path_;
};

// Traps when a guarantee of a parser is violated.
inline void Require(bool holds) {
  if (!holds) __builtin_trap();
}

// Times of accepted logs ascend (strictly); error messages have one line.
template <typename Log>
void RequireAscending(const Log& log, bool strictly = true) {
  if (!log.ok()) {
    Require(!log.status().message().empty());
    Require(log.status().message().find('\n') == std::string::npos);
    return;
  }
  for (size_t i = 1; i < log->size(); ++i) {
    Require((*log)[i].timestamp_ns >=
            (*log)[i - 1].timestamp_ns + (strictly ? 1 : 0));
  }
}

// Moreover, every number in an accepted IMU log is finite.
template <typename Log>
void RequireSoundImuLog(const Log& log) {
  RequireAscending(log);
  if (!log.ok()) return;
  for (const auto& sample : *log) {
    Require(sample.angular_velocity.allFinite());
    Require(sample.specific_force.allFinite());
  }
}

}  // namespace adasfm
