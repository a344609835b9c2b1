// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/capture_output.h"

#include <gtest/gtest.h>

#include <memory>

#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

// Two captures may overlap, and either may end first.
TEST(CaptureOutput, OneCapturesAtATime) {
  const TemporaryFolder folder;
  std::streambuf* const before = std::cout.rdbuf();
  auto first = std::make_unique<CaptureOutput>(folder.File("first"), "Done");
  auto second = std::make_unique<CaptureOutput>(folder.File("second"), "Done");
  std::cout << "Done 1\n";
  EXPECT_EQ(first->NumCountedLines(), 1);
  first.reset();
  EXPECT_EQ(std::cout.rdbuf(), before);
  second.reset();
  EXPECT_EQ(std::cout.rdbuf(), before);
  EXPECT_EQ(ReadBytes(folder.File("first")), "Done 1\n");
  const CaptureOutput third(folder.File("third"), "Done");
  std::cout << "Done 2\n";
  EXPECT_EQ(third.NumCountedLines(), 1);
}

}  // namespace
}  // namespace adasfm
