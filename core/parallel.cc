// SPDX-License-Identifier: BSD-3-Clause
#include "core/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "core/library_threads.h"

namespace adasfm {

namespace {

// More threads for each of the machine's only cost time: 10,000 took nine times
// as long as 2.
constexpr int kMaxThreadsEach = 16;

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
  // Blocks keep the counter cheap; small enough to balance the load.
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
    // The system gives no more threads: those that run do the work.
  }
  work();
  for (std::thread& worker : workers) worker.join();
  if (exception) std::rethrow_exception(exception);
}

}  // namespace adasfm
