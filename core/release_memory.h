// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <fstream>

#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace adasfm {

// Gives memory that is free back to the system. The allocator keeps what a
// thread has freed for that thread, which the next stage, on another one,
// cannot use. For the end of a stage. Does nothing without glibc.
inline void ReleaseFreedMemory() {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
}

// What the process has of the machine's memory; 0 where the system does not
// say.
inline double ResidentMemoryBytes() {
  double num_pages = 0.0;
  double num_resident_pages = 0.0;
  std::ifstream("/proc/self/statm") >> num_pages >> num_resident_pages;
  return num_resident_pages * sysconf(_SC_PAGESIZE);
}

}  // namespace adasfm
