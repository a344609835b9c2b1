// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/part_memory.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>

#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

TEST(PartMemoryTest, ControlGroupsLimitWhatIsLeft) {
  TemporaryFolder folder;
  EXPECT_TRUE(std::isinf(MemoryLeftInGroup(folder.Path())));
  folder.Write("memory.max", "max\n");
  folder.Write("memory.current", "3000000\n");
  EXPECT_TRUE(std::isinf(MemoryLeftInGroup(folder.Path())));
  folder.Write("memory.max", "10000000\n");
  EXPECT_EQ(MemoryLeftInGroup(folder.Path()), 7e6);
  // Files that are only cached make room.
  folder.Write("memory.stat", "anon 1000000\ninactive_file 2000000\n");
  EXPECT_EQ(MemoryLeftInGroup(folder.Path()), 9e6);
  folder.Write("memory.max", "500000\n");
  EXPECT_EQ(MemoryLeftInGroup(folder.Path()), 0.0);
}

TEST(PartMemoryTest, FirstVersionOfControlGroups) {
  TemporaryFolder folder;
  folder.Write("memory.limit_in_bytes", "8000000\n");
  folder.Write("memory.usage_in_bytes", "5000000\n");
  EXPECT_EQ(MemoryLeftInGroup(folder.Path()), 3e6);
}

TEST(PartMemoryTest, AddressSpaceLimitsWhatIsAvailable) {
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
  rlimit limited = before;
  limited.rlim_cur = rlim_t{4} << 30;
  ASSERT_EQ(setrlimit(RLIMIT_AS, &limited), 0);
  const double available = AvailableMemoryBytes();
  setrlimit(RLIMIT_AS, &before);
  EXPECT_GT(available, 0.0);
  EXPECT_LT(available, 4.0 * (1 << 30));
}

}  // namespace
}  // namespace adasfm
