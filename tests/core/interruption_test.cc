// SPDX-License-Identifier: BSD-3-Clause
#include "core/interruption.h"

#include <gtest/gtest.h>

#include <atomic>

#include "core/parallel.h"

namespace adasfm {
namespace {

TEST(Interruption, ThrowsWhileRequested) {
  EXPECT_FALSE(InterruptionRequested());
  EXPECT_NO_THROW(ThrowIfInterrupted());
  RequestInterruption();
  EXPECT_TRUE(InterruptionRequested());
  EXPECT_THROW(ThrowIfInterrupted(), Interruption);
  EXPECT_THROW(ThrowIfInterrupted(), Interruption);
  WithdrawInterruption();
  EXPECT_NO_THROW(ThrowIfInterrupted());
}

TEST(Interruption, PassesHandlersOfExceptionsAndThreads) {
  std::atomic<int> num_done{0};
  EXPECT_THROW(ParallelFor(3, 100,
                           [&](size_t i) {
                             try {
                               if (i == 10) throw Interruption();
                               ++num_done;
                             } catch (const std::exception&) {
                               ADD_FAILURE() << "not an error to answer";
                             }
                           }),
               Interruption);
  EXPECT_LT(num_done, 100);
}

}  // namespace
}  // namespace adasfm
