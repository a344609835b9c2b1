// SPDX-License-Identifier: BSD-3-Clause
#include "global/structure/select_keyframes.h"

#include <gtest/gtest.h>

namespace adasfm {
namespace {

constexpr int kNumImages = 60;

std::set<image_t> Images() {
  std::set<image_t> images;
  for (image_t id = 1; id <= kNumImages; ++id) images.insert(id);
  return images;
}

// At each image 50 tracks begin; each is seen by `length` consecutive images.
std::vector<Track> Tracks(int length) {
  std::vector<Track> tracks;
  for (image_t first = 1; first + length - 1 <= kNumImages; ++first) {
    for (point2D_t k = 0; k < 50; ++k) {
      Track track;
      for (int i = 0; i < length; ++i) {
        track.push_back({first + static_cast<image_t>(i), k});
      }
      tracks.push_back(track);
    }
  }
  return tracks;
}

std::vector<RelativePosePrior> Priors(uint32_t flags) {
  std::vector<RelativePosePrior> priors;
  for (image_t id = 1; id < kNumImages; ++id) {
    RelativePosePrior prior;
    prior.image_id1 = id;
    prior.image_id2 = id + 1;
    prior.flags = flags;
    priors.push_back(prior);
  }
  return priors;
}

constexpr uint32_t kComplete = kPriorRotation | kPriorDirection | kPriorLength;

std::set<image_t> Select(const std::vector<Track>& tracks,
                         const std::vector<RelativePosePrior>& priors) {
  return SelectKeyframes(Images(), tracks, priors, kNumImages);
}

TEST(SelectKeyframes, TakesEveryFewImagesAndBothEnds) {
  const std::set<image_t> keyframes = Select(Tracks(10), Priors(kComplete));
  EXPECT_EQ(keyframes.count(1), 1);
  EXPECT_EQ(keyframes.count(kNumImages), 1);
  image_t last = 1;
  for (const image_t id : keyframes) {
    EXPECT_LE(id - last, kKeyframeStride);
    last = id;
  }
  EXPECT_NEAR(keyframes.size(), kNumImages / kKeyframeStride, 2);
}

TEST(SelectKeyframes, KeepsImagesThatNothingCarries) {
  EXPECT_EQ(Select(Tracks(10), {}), Images());
  EXPECT_EQ(Select(Tracks(10), Priors(kPriorRotation | kPriorDirection)),
            Images());
  // A gap in the chain: both images beside it stay.
  std::vector<RelativePosePrior> priors = Priors(kComplete);
  priors.erase(priors.begin() + 19);
  const std::set<image_t> keyframes = Select(Tracks(10), priors);
  EXPECT_EQ(keyframes.count(20), 1);
  EXPECT_EQ(keyframes.count(21), 1);
  EXPECT_LT(keyframes.size(), kNumImages / 2);
  // A circle of priors has no beginning.
  priors = Priors(kComplete);
  priors.push_back(priors.back());
  priors.back().image_id1 = kNumImages;
  priors.back().image_id2 = 1;
  EXPECT_EQ(Select(Tracks(10), priors), Images());
}

TEST(SelectKeyframes, KeepsImagesWhereFewPointsReachAcross) {
  EXPECT_EQ(Select(Tracks(2), Priors(kComplete)), Images());
}

TEST(SelectKeyframes, LeavesSmallComponentsAlone) {
  EXPECT_EQ(
      SelectKeyframes(Images(), Tracks(10), Priors(kComplete), kNumImages + 1),
      Images());
}

TEST(RestrictTracks, KeepsTheImagesAndLongEnoughTracks) {
  const std::vector<Track> tracks = {{{1, 0}, {2, 0}, {3, 4}, {5, 0}},
                                     {{1, 1}, {2, 1}, {4, 1}}};
  const std::vector<Track> restricted = RestrictTracks(tracks, {1, 3, 5});
  ASSERT_EQ(restricted.size(), 1);
  EXPECT_EQ(restricted[0], (Track{{1, 0}, {3, 4}, {5, 0}}));
}

}  // namespace
}  // namespace adasfm
