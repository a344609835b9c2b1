// SPDX-License-Identifier: BSD-3-Clause
#include "core/parallel.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <cstdlib>
#include <stdexcept>
#include <vector>

namespace adasfm {
namespace {

TEST(EffectiveNumThreads, NoThreadsThatOnlyCostTime) {
  const int num_hardware = EffectiveNumThreads(-1);
  EXPECT_GE(num_hardware, 1);
  EXPECT_EQ(EffectiveNumThreads(3), 3);
  EXPECT_LE(EffectiveNumThreads(10000), 16 * num_hardware);
}

TEST(ParallelFor, CallsEveryIndexOnce) {
  for (const int num_threads : {1, 2, 7, -1}) {
    for (const size_t count : {0u, 1u, 5u, 1000u}) {
      std::vector<std::atomic<int>> calls(count);
      ParallelFor(num_threads, count, [&](size_t i) { ++calls[i]; });
      for (const std::atomic<int>& call : calls) EXPECT_EQ(call, 1);
    }
  }
}

// With little memory for stacks few threads start, and these do all work.
TEST(ParallelFor, DoesTheWorkOnTheThreadsThatThereAre) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer itself needs more address space than this "
                  "test leaves";
#endif
  const auto run = [] {
    const rlimit limit = {200u << 20, 200u << 20};
    setrlimit(RLIMIT_AS, &limit);
    std::atomic<int> num_calls{0};
    ParallelFor(1000, 5000, [&num_calls](size_t) { ++num_calls; });
    std::_Exit(num_calls == 5000 ? 0 : 1);
  };
  EXPECT_EXIT(run(), testing::ExitedWithCode(0), "");
}

TEST(ParallelFor, RethrowsAnException) {
  for (const int num_threads : {1, 4}) {
    EXPECT_THROW(ParallelFor(num_threads, 100,
                             [](size_t i) {
                               if (i == 37) throw std::runtime_error("37");
                             }),
                 std::runtime_error);
  }
}

}  // namespace
}  // namespace adasfm
