// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>

namespace adasfm {

// The request, within 16 for each thread of the machine, or one each for -1.
int EffectiveNumThreads(int num_threads);

// Calls function(i) once for every i in [0, count), on num_threads threads
// (-1: all). The calls must not depend on each other; results written to slot i
// do not depend on the number of threads. OpenMP's loops within a call run on
// its thread. Where the system gives fewer threads, fewer do the work. After an
// exception no further blocks of calls begin; the first one (by index among
// those thrown) is rethrown when all threads have ended.
void ParallelFor(int num_threads, size_t count,
                 const std::function<void(size_t)>& function);

}  // namespace adasfm
