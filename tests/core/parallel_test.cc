// SPDX-License-Identifier: BSD-3-Clause
#include "core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace adasfm {
namespace {

TEST(ParallelFor, CallsEveryIndexOnce) {
  for (const int num_threads : {1, 2, 7, -1}) {
    for (const size_t count : {0u, 1u, 5u, 1000u}) {
      std::vector<std::atomic<int>> calls(count);
      ParallelFor(num_threads, count, [&](size_t i) { ++calls[i]; });
      for (const std::atomic<int>& call : calls) EXPECT_EQ(call, 1);
    }
  }
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
