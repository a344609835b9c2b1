// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

namespace adasfm {

// Reports the progress of long work: a short description of the current step,
// and the share of the whole that is finished, in [0, 1]. May be called from
// any thread, and may throw, which ends the work.
using ProgressCallback =
    std::function<void(const std::string& what, double share_done)>;

}  // namespace adasfm
