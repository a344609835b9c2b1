// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <fstream>

#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace adasfm {

// Returns free memory to the system, at the end of a stage. The allocator keeps
// freed memory for the thread that freed it, and the next stage, on another
// thread, cannot use it. Does nothing without glibc.
inline void ReleaseFreedMemory() {
#if defined(__GLIBC__)
  malloc_trim(0);
#endif
}

// Resident memory of the process; 0 where the system does not report it.
inline double ResidentMemoryBytes() {
  double num_pages = 0.0;
  double num_resident_pages = 0.0;
  std::ifstream("/proc/self/statm") >> num_pages >> num_resident_pages;
  return num_resident_pages * sysconf(_SC_PAGESIZE);
}

}  // namespace adasfm
