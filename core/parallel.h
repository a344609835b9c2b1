// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>

// Threads of ours, and those of libraries, whose results are not to depend on
// what other threads do meanwhile.
//
// Programs that are linked with this have a rand() of their own: one sequence
// for each thread, whose seed is 1 or srand's. METIS seeds it and draws from it
// to order the equations of an adjustment, and COLMAP's threads seed it, too.
// In one sequence for all, parts side by side found other orders from run to
// run.
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

// While it lives, OpenMP's loops that this thread meets run on it alone: those
// of CHOLMOD, which gain nothing from threads (refining 10,000 images takes as
// long), and products of an OpenBLAS that is built with OpenMP.
class OneOpenMpThread {
 public:
  OneOpenMpThread();
  ~OneOpenMpThread();
  OneOpenMpThread(const OneOpenMpThread&) = delete;
  OneOpenMpThread& operator=(const OneOpenMpThread&) = delete;

 private:
  int num_threads_ = 1;
  int max_active_levels_ = 1;
};

// For the whole process: an OpenBLAS that has threads of its own multiplies on
// the thread that calls it. Otherwise sums depend on the number of cores, and
// each thread of ours brings as many of OpenBLAS as there are cores.
void UseOneBlasThread();

// False for an OpenBLAS without threads and without locks: two threads that
// multiply at once share a buffer, and products are wrong now and then.
bool IsBlasSafeInThreads();

}  // namespace adasfm
