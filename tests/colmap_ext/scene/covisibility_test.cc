// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/covisibility.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "colmap_ext/host/pose_conversion.h"
#include "tests/testing/colmap_ext/bundle_world.h"

namespace adasfm {
namespace {

std::vector<image_t> ImagesOf(const colmap::Point3D& point) {
  std::vector<image_t> images;
  for (const auto& element : TrackOf(point).Elements()) {
    images.push_back(element.image_id);
  }
  std::sort(images.begin(), images.end());
  return images;
}

// Counted pair by pair.
std::map<std::pair<image_t, image_t>, int> CountSharedPoints(
    const colmap::Reconstruction& world) {
  std::map<std::pair<image_t, image_t>, int> counts;
  for (const auto& [id, point] : world.Points3D()) {
    const std::vector<image_t> images = ImagesOf(point);
    for (size_t i = 0; i < images.size(); ++i) {
      for (size_t j = i + 1; j < images.size(); ++j) {
        ++counts[{images[i], images[j]}];
      }
    }
  }
  return counts;
}

class CovisibilityTest : public testing::TestWithParam<int> {
 protected:
  CovisibilityTest() {
    BundleWorldOptions options;
    options.num_images = 120;
    options.spacing_m = 0.1;  // Long tracks.
    options.seed = GetParam();
    world_ = BuildBundleWorld(options);
    counts_ = CountSharedPoints(world_);
    // Ids with gaps.
    for (const image_t image_id : RegisteredImages(world_)) {
      if (image_id % 7 != 3) images_.insert(image_id);
    }
  }

  colmap::Reconstruction world_;
  std::map<std::pair<image_t, image_t>, int> counts_;
  std::set<image_t> images_;
};

TEST_P(CovisibilityTest, TellsWhoSharesSoManyPoints) {
  for (const int min_num : {1, 5}) {
    const Covisibility covisibility(images_, world_, min_num);
    const std::vector<image_t> ids(images_.begin(), images_.end());
    ASSERT_EQ(covisibility.Neighbors().size(), ids.size());
    for (size_t i = 0; i < ids.size(); ++i) {
      std::vector<int> expected;
      for (size_t j = i + 1; j < ids.size(); ++j) {
        const auto count = counts_.find({ids[i], ids[j]});
        if (count != counts_.end() && count->second >= min_num) {
          expected.push_back(static_cast<int>(j));
        }
      }
      EXPECT_EQ(covisibility.Neighbors()[i], expected);
    }
  }
}

TEST_P(CovisibilityTest, CutsPairsThatAThirdImageConnects) {
  const std::vector<image_t> ids(images_.begin(), images_.end());
  const auto count = [&](size_t i, size_t j) {
    const auto found = counts_.find(std::minmax(ids[i], ids[j]));
    return found == counts_.end() ? 0 : found->second;
  };
  int num_cut = 0, num_weak = 0;
  for (const int min_num : {12, 80}) {
    const auto is_connected_by_third = [&](size_t i, size_t j) {
      for (size_t k = 0; k < ids.size(); ++k) {
        if (count(i, k) >= min_num && count(k, j) >= min_num) return true;
      }
      return false;
    };
    Covisibility covisibility(images_, world_);
    covisibility.CutRedundant(min_num);
    for (size_t i = 0; i < ids.size(); ++i) {
      std::vector<int> expected;
      for (size_t j = i + 1; j < ids.size(); ++j) {
        if (count(i, j) == 0) continue;
        const bool is_weak = count(i, j) < min_num;
        const bool is_cut = is_weak && is_connected_by_third(i, j);
        if (!is_cut) expected.push_back(static_cast<int>(j));
        num_cut += is_cut;
        num_weak += is_weak;
      }
      EXPECT_EQ(covisibility.Neighbors()[i], expected);
    }
  }
  // Some weak pairs are cut, others are not.
  EXPECT_GT(num_cut, 0);
  EXPECT_LT(num_cut, num_weak);
}

TEST_P(CovisibilityTest, CutsTracksWhereImagesShareFewPoints) {
  constexpr int kMinNum = 5;
  const Covisibility covisibility(images_, world_, kMinNum);
  const auto fits = [&](image_t image_id, int group,
                        const std::vector<image_t>& images,
                        const std::vector<int>& group_of) {
    for (size_t i = 0; images[i] < image_id; ++i) {
      if (group_of[i] == group && counts_.at({images[i], image_id}) < kMinNum) {
        return false;
      }
    }
    return true;
  };
  int num_cut = 0;
  for (const auto& [id, point] : world_.Points3D()) {
    std::vector<image_t> images;
    for (const image_t image_id : ImagesOf(point)) {
      if (images_.count(image_id)) images.push_back(image_id);
    }
    if (images.empty()) continue;
    const std::vector<int> group_of = covisibility.CutTrack(images);
    ASSERT_EQ(group_of.size(), images.size());
    for (size_t i = 0; i < images.size(); ++i) {
      EXPECT_TRUE(fits(images[i], group_of[i], images, group_of));
      for (int group = 0; group < group_of[i]; ++group) {
        EXPECT_FALSE(fits(images[i], group, images, group_of));
      }
    }
    num_cut += *std::max_element(group_of.begin(), group_of.end()) > 0;
  }
  EXPECT_GT(num_cut, 0);
}

// Images up to 64 places apart are looked up in another way.
TEST_P(CovisibilityTest, TheWorldHasTracksOfMoreThan64Images) {
  size_t longest = 0;
  for (const auto& [id, point] : world_.Points3D()) {
    size_t length = 0;
    for (const image_t image_id : ImagesOf(point)) {
      length += images_.count(image_id);
    }
    longest = std::max(longest, length);
  }
  EXPECT_GT(longest, 64);
}

TEST_P(CovisibilityTest, ImagesOfNoConcernFitAllGroups) {
  const Covisibility covisibility(images_, world_);
  ASSERT_EQ(images_.count(3), 0);
  const image_t last = *images_.rbegin();
  EXPECT_EQ(covisibility.CutTrack({0, 3, last + 1, last, last + 1000}),
            std::vector<int>(5, 0));
}

INSTANTIATE_TEST_SUITE_P(Seeds, CovisibilityTest, testing::Values(1, 2, 3));

}  // namespace
}  // namespace adasfm
