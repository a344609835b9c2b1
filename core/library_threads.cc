// SPDX-License-Identifier: BSD-3-Clause
#include "core/library_threads.h"

#include <dlfcn.h>

#include <cstdlib>

// In place of the C library's, which all threads draw from: see the header.
namespace {
thread_local unsigned state_of_rand = 1;
}  // namespace
extern "C" void srand(unsigned seed) noexcept { state_of_rand = seed; }
extern "C" int rand() noexcept { return rand_r(&state_of_rand); }

namespace adasfm {
namespace {

// Of whatever library the process has it from, since any BLAS may be installed
// in the place of another; null if there is none.
template <typename Function>
Function* FindFunction(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_DEFAULT, name));
}

// What openblas_get_parallel returns for a build without threads.
constexpr int kSequential = 0;

// How many threads loops have, unless they ask for a number, and how deep loops
// in loops may have threads.
int GetNumThreads() {
  static int (*const get)() = FindFunction<int()>("omp_get_max_threads");
  return get == nullptr ? 1 : get();
}

void SetNumThreads(int num_threads) {
  static void (*const set)(int) =
      FindFunction<void(int)>("omp_set_num_threads");
  if (set != nullptr) set(num_threads);
}

int GetMaxActiveLevels() {
  static int (*const get)() = FindFunction<int()>("omp_get_max_active_levels");
  return get == nullptr ? 0 : get();
}

void SetMaxActiveLevels(int max_active_levels) {
  static void (*const set)(int) =
      FindFunction<void(int)>("omp_set_max_active_levels");
  if (set != nullptr) set(max_active_levels);
}

}  // namespace

OneOpenMpThread::OneOpenMpThread()
    : num_threads_(GetNumThreads()), max_active_levels_(GetMaxActiveLevels()) {
  SetNumThreads(1);
  SetMaxActiveLevels(0);
}

OneOpenMpThread::~OneOpenMpThread() {
  SetNumThreads(num_threads_);
  SetMaxActiveLevels(max_active_levels_);
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
