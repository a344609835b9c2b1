// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdlib>

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

}  // namespace adasfm
