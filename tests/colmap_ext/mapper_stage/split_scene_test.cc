// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/split_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "colmap_ext/mapper_stage/lost_images.h"

namespace adasfm {
namespace {

using testing::ElementsAre;

// 1-2-3   5-6   8-9   10     coarse models: {1, 2, 3}, {5, 6}
//  \ \4--/ \7/                4 has more inliers with the second, 7 follows 4
class SplitSceneTest : public testing::Test {
 protected:
  SplitSceneTest() {
    for (image_t image_id = 1; image_id <= 10; ++image_id) {
      scene_.images[image_id].image_id = image_id;
      scene_.images[image_id].name = "image" + std::to_string(image_id);
    }
    scene_.cameras[1];
    AddPair(1, 2, 50);
    AddPair(2, 3, 50);
    AddPair(1, 4, 20);
    AddPair(2, 4, 20);
    AddPair(3, 7, 15);
    AddPair(4, 5, 30);
    AddPair(4, 7, 40);
    AddPair(5, 6, 50);
    AddPair(8, 9, 50);
    for (image_t image_id = 1; image_id < 10; ++image_id) {
      RelativePosePrior prior;
      prior.image_id1 = image_id;
      prior.image_id2 = image_id + 1;
      scene_.priors.push_back(prior);
      PositionPrior position;
      position.image_id1 = image_id;
      position.image_id2 = image_id + image_id % 2;
      scene_.positions.push_back(position);
    }
    scene_.position_origin = GeodeticPosition();
    scene_.length_drift_ratio = 0.01;
    scene_.inertial_scale_sigma = 0.02;
    scene_.wheel_scale = WheelScale{0.99, 0.002, 0.01};
    for (const auto& [image_id1, image_id2] :
         std::vector<std::pair<image_t, image_t>>{
             {1, 2}, {2, 3}, {3, 5}, {5, 6}}) {
      InertialMotion motion;
      motion.image_id1 = image_id1;
      motion.image_id2 = image_id2;
      scene_.inertial_motions.push_back(motion);
    }
    coarse_ = {{{1, {}}, {2, {}}, {3, {}}}, {{5, {}}, {6, {}}}};
  }

  void AddPair(image_t image_id1, image_t image_id2, int num_inliers) {
    ScenePair pair;
    pair.image_id1 = image_id1;
    pair.image_id2 = image_id2;
    pair.inlier_matches.resize(num_inliers);
    scene_.pairs.push_back(pair);
  }

  static std::vector<image_t> Images(const SceneData& scene) {
    std::vector<image_t> images;
    for (const auto& [image_id, image] : scene.images) {
      images.push_back(image_id);
    }
    return images;
  }

  SceneData scene_;
  std::vector<CoarsePoseMap> coarse_;
};

TEST_F(SplitSceneTest, EveryImageHasOneComponent) {
  const SplitSceneData split = SplitScene(coarse_, scene_);
  ASSERT_EQ(split.components.size(), 2);
  EXPECT_THAT(Images(split.components[0]), ElementsAre(1, 2, 3));
  EXPECT_THAT(Images(split.components[1]), ElementsAre(4, 5, 6, 7));
  EXPECT_THAT(Images(split.rest), ElementsAre(8, 9, 10));
  // Only what has both images in the component: 1-2, 2-3; 4-5, 4-7, 5-6; 8-9.
  EXPECT_EQ(split.components[0].pairs.size(), 2);
  EXPECT_EQ(split.components[1].pairs.size(), 3);
  EXPECT_EQ(split.rest.pairs.size(), 1);
  EXPECT_EQ(split.components[0].priors.size(), 2);
  EXPECT_EQ(split.components[1].priors.size(), 3);
  EXPECT_EQ(split.rest.priors.size(), 2);
  // Positions of 1-2, 2, 3-4, 4, 5-6, 6, 7-8, 8, 9-10.
  EXPECT_EQ(split.components[0].positions.size(), 2);
  EXPECT_EQ(split.components[1].positions.size(), 3);
  EXPECT_EQ(split.rest.positions.size(), 2);
  EXPECT_TRUE(split.components[1].position_origin.has_value());
  EXPECT_EQ(split.components[1].length_drift_ratio, 0.01);
  EXPECT_EQ(split.components[1].inertial_scale_sigma, 0.02);
  EXPECT_TRUE(split.components[1].wheel_scale.has_value());
  ASSERT_EQ(split.components[0].inertial_motions.size(), 2);
  EXPECT_EQ(split.components[0].inertial_motions[1].image_id2, 3);
  ASSERT_EQ(split.components[1].inertial_motions.size(), 1);
  EXPECT_EQ(split.components[1].inertial_motions[0].image_id1, 5);
  EXPECT_EQ(split.components[0].cameras.size(), 1);
}

TEST_F(SplitSceneTest, LostImagesHaveTheirReason) {
  SplitSceneData split = SplitScene(coarse_, scene_);
  std::vector<ComponentToMap> components;
  for (size_t k = 0; k < coarse_.size(); ++k) {
    components.push_back(
        {static_cast<int>(k), coarse_[k], std::move(split.components[k])});
  }
  const std::vector<LostImage> lost =
      FindLostImages(components, split.rest, /*small=*/{8, 9},
                     /*matched=*/{1, 2, 3, 4, 5, 6, 7, 8, 9},
                     /*mapped=*/{1, 2, 4, 5, 6});
  const nlohmann::json json = LostImagesToJson(lost);
  ASSERT_EQ(json.size(), 5);
  const std::map<std::string, std::string> expected = {
      {"image3", "lost while registering"},
      {"image7", "left out by the coarse stage"},
      {"image8", "in a coarse model too small to be mapped"},
      {"image9", "in a coarse model too small to be mapped"},
      {"image10", "without verified matches"}};
  for (const nlohmann::json& image : json) {
    EXPECT_EQ(image["reason"], expected.at(image["name"]));
  }
  EXPECT_EQ(DescribeLostImages(lost),
            "1 without verified matches (image10), 1 left out by the coarse "
            "stage (image7), 2 in a coarse model too small to be mapped "
            "(image8, image9), 1 lost while registering (image3)");
  EXPECT_EQ(DescribeLostImages({}), "");
}

}  // namespace
}  // namespace adasfm
