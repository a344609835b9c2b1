// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bags/extract_video.h"

#include <gtest/gtest.h>

#include <limits>

namespace adasfm {
namespace {

TEST(SelectSharpFrames, TheSharpestOfTheFirstHalfOfEachStretch) {
  std::vector<VideoFrame> frames;
  for (const double blur_px :
       {5.0, 4.0, 1.0, 1.0, 5.0, 6.0, 1.0, 1.0, 3.0, 2.0}) {
    frames.push_back({static_cast<timestamp_t>(10 * frames.size()), blur_px});
  }
  EXPECT_EQ(SelectSharpFrames(frames, {0, 40, 80}),
            (std::vector<int>{1, 4, 8}));
  // Each start time selects from one frame only.
  EXPECT_EQ(SelectSharpFrames(frames, {0, 10, 20}).size(), 3);
  // A frame without edges is better than none.
  frames[0].blur_px = std::numeric_limits<double>::infinity();
  EXPECT_EQ(SelectSharpFrames(frames, {0, 10}), (std::vector<int>{0, 2}));
}

}  // namespace
}  // namespace adasfm
