// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// What libraries do that the threads of a program share, held to the thread
// that calls them: results do not depend on what other threads do meanwhile.
//
// Programs that are linked with this have a rand() of their own: one sequence
// for each thread, whose seed is 1 or srand's. METIS seeds it and draws from it
// to order the equations of an adjustment, and COLMAP's threads seed it, too.
// In one sequence for all, parts side by side found other orders from run to
// run.
namespace adasfm {

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
  const int num_threads_;
  const int max_active_levels_;
};

// For the whole process: an OpenBLAS that has threads of its own multiplies on
// the thread that calls it. Otherwise sums depend on the number of cores, and
// each thread of ours brings as many of OpenBLAS as there are cores.
void UseOneBlasThread();

// False for an OpenBLAS without threads and without locks: two threads that
// multiply at once share a buffer, and products are wrong now and then.
bool IsBlasSafeInThreads();

}  // namespace adasfm
