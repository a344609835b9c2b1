// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/raw_matches.h"

#include <gtest/gtest.h>

#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/scene/pairs_among.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

class RawMatchesTest : public testing::Test {
 protected:
  RawMatchesTest() {
    SyntheticWorldOptions options;
    options.num_images = 12;
    options.num_keypoints_per_image = 100;
    world_ = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world_, path_).ok());
    StatusOr<SceneData> scene = ReadSceneData(path_, SceneDataOptions());
    EXPECT_TRUE(scene.ok());
    scene_ = std::move(scene).value();
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.File("database.db");
  SyntheticWorld world_;
  SceneData scene_;
};

TEST_F(RawMatchesTest, ReadsThePairsThatItIsAskedFor) {
  const StatusOr<RawMatchSource> source = OpenRawMatches(path_, scene_);
  ASSERT_TRUE(source.ok()) << source.status().message();
  EXPECT_TRUE((*source)({}).empty());
  ASSERT_GT(world_.pairs.size(), 3u);
  for (const SyntheticPair& pair : world_.pairs) {
    const ImagePair ids(pair.image_id1, pair.image_id2);
    const RawMatches matches = (*source)({ids});
    ASSERT_EQ(matches.size(), 1u);
    EXPECT_EQ(matches.at(ids), pair.raw_matches);
  }
}

TEST_F(RawMatchesTest, DamageShowsBeforeAnyWork) {
  SqliteConnection(path_, SqliteConnection::Mode::kWrite)
      .Execute("UPDATE matches SET data = zeroblob(7)");
  const StatusOr<RawMatchSource> source = OpenRawMatches(path_, scene_);
  ASSERT_FALSE(source.ok());
  EXPECT_NE(source.status().message().find("damaged"), std::string::npos);
}

TEST_F(RawMatchesTest, PairsAmongImagesAreThoseOfAScan) {
  const std::set<image_t> images = {1, 2, 5, 6, 7, 12, 99};
  std::vector<const ScenePair*> expected;
  for (const ScenePair& pair : scene_.pairs) {
    if (images.count(pair.image_id1) && images.count(pair.image_id2)) {
      expected.push_back(&pair);
    }
  }
  ASSERT_GT(expected.size(), 2u);
  EXPECT_EQ(FindPairsAmong(scene_, images), expected);
}

}  // namespace
}  // namespace adasfm
