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
  // Cached files count as available memory.
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

// Two images with all of the keypoints and matches of a part.
SceneData SceneOfPart(size_t num_keypoints, size_t num_matches) {
  SceneData data;
  data.images[1].keypoints.resize(num_keypoints);
  data.images[2].image_id = 2;
  ScenePair pair;
  pair.image_id1 = 1;
  pair.image_id2 = 2;
  pair.inlier_matches.resize(num_matches);
  data.pairs.push_back(pair);
  return data;
}

// The measured growth of the mapper's memory while it made the part.
TEST(PartMemoryTest, EstimateCoversWhatWasMeasured) {
  struct Part {
    size_t num_keypoints, num_matches;
    double bytes;
  };
  for (const Part& part : {Part{460401, 1509729, 90e6},   // kitti07-160
                           Part{55000, 330000, 21e6}}) {  // of clean-1000
    const double bytes = EstimatePartMemoryBytes(
        SceneOfPart(part.num_keypoints, part.num_matches), {1, 2});
    EXPECT_GT(bytes, part.bytes);
    EXPECT_LT(bytes, 2.0 * part.bytes);
  }
}

}  // namespace
}  // namespace adasfm
