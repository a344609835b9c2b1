// SPDX-License-Identifier: BSD-3-Clause
#include "core/parallel.h"

#include <dlfcn.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

// Replaces rand() of the C library, whose sequence all threads share: see the
// header.
namespace {
thread_local unsigned state_of_rand = 1;
}  // namespace
extern "C" void srand(unsigned seed) noexcept { state_of_rand = seed; }
extern "C" int rand() noexcept { return rand_r(&state_of_rand); }

namespace adasfm {

namespace {

// More threads for each thread of the machine only cost time: 10,000 took nine
// times as long as 2.
constexpr int kMaxThreadsEach = 16;

// What openblas_get_parallel returns for a build without threads.
constexpr int kSequential = 0;

// Finds the function in any library of the process, since any BLAS may be
// installed in place of another; null if there is none.
template <typename Function>
Function* FindFunction(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

// The default number of threads of a loop, and the depth to which nested loops
// may have threads.
struct OpenMp {
  int (*get_num_threads)() = FindFunction<int()>("omp_get_max_threads");
  void (*set_num_threads)(int) = FindFunction<void(int)>("omp_set_num_threads");
  int (*get_levels)() = FindFunction<int()>("omp_get_max_active_levels");
  void (*set_levels)(int) =
      FindFunction<void(int)>("omp_set_max_active_levels");
  const bool is_there =
      get_num_threads && set_num_threads && get_levels && set_levels;
};

const OpenMp& FindOpenMp() {
  static const OpenMp openmp;
  return openmp;
}

}  // namespace

int EffectiveNumThreads(int num_threads) {
  const int num_hardware = std::max(1u, std::thread::hardware_concurrency());
  return num_threads > 0 ? std::min(num_threads, kMaxThreadsEach * num_hardware)
                         : num_hardware;
}

void ParallelFor(int num_threads, size_t count,
                 const std::function<void(size_t)>& function) {
  const size_t num_workers =
      std::min<size_t>(EffectiveNumThreads(num_threads), count);
  if (num_workers <= 1) {
    const OneOpenMpThread one_thread;
    for (size_t i = 0; i < count; ++i) function(i);
    return;
  }
  // Large enough to keep the counter cheap, small enough to balance the load.
  const size_t block = std::max<size_t>(1, count / (num_workers * 16));
  std::atomic<size_t> next{0};
  std::atomic<bool> failed{false};
  std::mutex mutex;
  std::exception_ptr exception;
  size_t exception_index = count;
  const auto work = [&] {
    const OneOpenMpThread one_thread;
    for (size_t begin = next.fetch_add(block); begin < count && !failed;
         begin = next.fetch_add(block)) {
      for (size_t i = begin; i < std::min(count, begin + block); ++i) {
        try {
          function(i);
        } catch (...) {
          const std::lock_guard<std::mutex> lock(mutex);
          failed = true;
          if (i < exception_index) {
            exception_index = i;
            exception = std::current_exception();
          }
          return;
        }
      }
    }
  };
  std::vector<std::thread> workers;
  workers.reserve(num_workers - 1);
  try {
    for (size_t i = 1; i < num_workers; ++i) workers.emplace_back(work);
  } catch (const std::system_error&) {
    // The system provides no more threads: those that run do the work.
  }
  work();
  for (std::thread& worker : workers) worker.join();
  if (exception) std::rethrow_exception(exception);
}

OneOpenMpThread::OneOpenMpThread() {
  const OpenMp& openmp = FindOpenMp();
  if (!openmp.is_there) return;
  num_threads_ = openmp.get_num_threads();
  max_active_levels_ = openmp.get_levels();
  openmp.set_num_threads(1);
  openmp.set_levels(0);
}

OneOpenMpThread::~OneOpenMpThread() {
  const OpenMp& openmp = FindOpenMp();
  if (!openmp.is_there) return;
  openmp.set_num_threads(num_threads_);
  openmp.set_levels(max_active_levels_);
}

void UseOneBlasThread() {
  const auto set = FindFunction<void(int)>("openblas_set_num_threads");
  if (set != nullptr) set(1);
}

bool IsBlasSafeInThreads() {
  const auto get = FindFunction<int()>("openblas_get_parallel");
  return get == nullptr || get() != kSequential;
}

}  // namespace adasfm
