// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/command.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

namespace adasfm {
namespace {

int RunThat(Status (*run)(int, char**)) {
  Command command;
  command.name = "adasfm_test";
  command.run = run;
  return RunCommand(command, 0, nullptr);
}

// Whatever ends a command, it ends with one line and exit code 1.
TEST(RunCommandDeathTest, NothingEndsInACoreDump) {
  EXPECT_EXIT(
      std::exit(RunThat([](int, char**) -> Status { throw std::bad_alloc(); })),
      testing::ExitedWithCode(1), "ERROR: adasfm_test: out of memory");
  EXPECT_EXIT(RunThat([](int, char**) -> Status { std::abort(); }),
              testing::ExitedWithCode(1), "ERROR: a library aborted");
}

}  // namespace
}  // namespace adasfm
