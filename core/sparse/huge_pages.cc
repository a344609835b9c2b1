// SPDX-License-Identifier: BSD-3-Clause
#include "core/sparse/huge_pages.h"

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>

namespace adasfm {

void AdviseHugePages(void* begin, size_t num_bytes) {
  // glibc maps arrays of at least this size by themselves.
  constexpr size_t kMinBytes = size_t{32} << 20;
  if (begin == nullptr || num_bytes < kMinBytes) return;
#ifdef MADV_HUGEPAGE
  const uintptr_t page = static_cast<uintptr_t>(sysconf(_SC_PAGESIZE));
  const uintptr_t address = reinterpret_cast<uintptr_t>(begin);
  const uintptr_t first = (address + page - 1) / page * page;
  const uintptr_t last = (address + num_bytes) / page * page;
  // Advice only: a failure, as where the kernel has no huge pages, costs time.
  madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);
#endif
}

}  // namespace adasfm
