// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace adasfm {

// Asks the kernel for huge pages in an array that is not yet written to. A
// large one is written to in full once an adjustment, and a fault for each 4 kB
// of it takes longer than the writing. Does nothing for arrays below 32 MB,
// which share their pages with others, and where the system has none.
void AdviseHugePages(void* begin, size_t num_bytes);

}  // namespace adasfm
