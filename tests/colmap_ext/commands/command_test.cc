// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/command.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <atomic>
#include <cstdlib>
#include <iostream>
#include <new>
#include <thread>
#include <vector>

namespace adasfm {
namespace {

int RunThat(Status (*run)(int, char**)) {
  Command command;
  command.name = "adasfm_test";
  command.run = run;
  return RunCommand(command, 0, nullptr);
}

// However a command fails, it prints one line and exits with code 1.
TEST(RunCommandDeathTest, NothingEndsInACoreDump) {
  EXPECT_EXIT(
      std::exit(RunThat([](int, char**) -> Status { throw std::bad_alloc(); })),
      testing::ExitedWithCode(1), "ERROR: adasfm_test: out of memory");
  EXPECT_EXIT(RunThat([](int, char**) -> Status { std::abort(); }),
              testing::ExitedWithCode(1), "ERROR: a library aborted");
}

TEST(RunCommand, LibrariesBringNoThreads) {
  omp_set_num_threads(3);
  static int num_threads = 0;
  EXPECT_EQ(RunThat([](int, char**) {
              num_threads = omp_get_max_threads();
              return Status::Ok();
            }),
            0);
  EXPECT_EQ(num_threads, 1);
}

// As OpenMP does when it cannot create its threads.
Status ExitInTwoThreads(int, char**) {
  std::atomic<int> num_waiting{2};
  std::vector<std::thread> threads;
  for (int i = 0; i < 2; ++i) {
    threads.emplace_back([&num_waiting] {
      --num_waiting;
      while (num_waiting > 0) {
      }
      std::exit(EXIT_FAILURE);
    });
  }
  for (std::thread& thread : threads) thread.join();
  return Status::Ok();
}

TEST(RunCommandDeathTest, TheLineIsThereWhenTwoThreadsEndTheProcess) {
  for (int i = 0; i < 200; ++i) {
    EXPECT_EXIT(RunThat(ExitInTwoThreads), testing::ExitedWithCode(1),
                "ERROR: a library stopped");
  }
}

// As while a library's output goes to a log.
TEST(RunCommandDeathTest, TheLineIsThereWhereCerrIsRedirected) {
  EXPECT_EXIT(RunThat([](int, char**) -> Status {
                std::cerr.rdbuf(std::cout.rdbuf());
                std::cout.rdbuf(nullptr);
                std::exit(EXIT_FAILURE);
              }),
              testing::ExitedWithCode(1), "ERROR: a library stopped");
}

}  // namespace
}  // namespace adasfm
