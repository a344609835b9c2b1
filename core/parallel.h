// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>

// Threads of this program and of its libraries. Results must not depend on what
// other threads do at the same time.
//
// Programs that are linked with this file get their own rand(): each thread has
// its own sequence, whose seed is 1 or the argument of srand(). METIS seeds
// rand() and draws from it to order the equations of an adjustment, and
// COLMAP's threads seed it, too. With one sequence for all threads, parts that
// ran in parallel got different orders from run to run.
namespace adasfm {

// The requested number of threads, at most 16 for each thread of the machine;
// for -1, one for each thread of the machine.
int EffectiveNumThreads(int num_threads);

// Calls function(i) once for every i in [0, count), on num_threads threads (-1:
// all). The calls must not depend on each other; results written to slot i do
// not depend on the number of threads. OpenMP loops within a call run on the
// thread of the call. If the system provides fewer threads, fewer are used.
// After an exception no further blocks of calls begin; when all threads have
// ended, the exception with the smallest index among those thrown is rethrown.
void ParallelFor(int num_threads, size_t count,
                 const std::function<void(size_t)>& function);

// During the lifetime of this object, OpenMP loops of its thread run on that
// thread alone: loops of CHOLMOD, which gain nothing from threads (refining
// 10,000 images takes as long), and products of an OpenBLAS built with OpenMP.
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

// For the whole process: makes an OpenBLAS with its own threads multiply on the
// calling thread. Otherwise sums depend on the number of cores, and each thread
// of ours starts as many OpenBLAS threads as there are cores.
void UseOneBlasThread();

// False for an OpenBLAS that is built without threads. Without locks, two
// threads that multiply at the same time share a buffer, and products are
// sometimes wrong.
bool IsBlasSafeInThreads();

}  // namespace adasfm
