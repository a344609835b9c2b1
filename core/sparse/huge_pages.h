// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace adasfm {

// Asks the kernel for huge pages in an array that is not yet written to: one
// page fault for 2 MB in place of one for each 4 kB. Does nothing for arrays
// below 32 MB, which may share their pages with others, and where the system
// has none.
void AdviseHugePages(void* begin, size_t num_bytes);

}  // namespace adasfm
