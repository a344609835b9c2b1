// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/leftover_components.h"

#include <gtest/gtest.h>

#include <set>

#include "colmap_ext/host/camera_models.h"

namespace adasfm {
namespace {

// A coarse model of images 1 to 40. Matches connect 1-12, 13-27, 28-37 and
// 38-39; image 40 has none. Image 41 has no coarse pose and is matched with 30.
class LeftoverComponentsTest : public testing::Test {
 protected:
  LeftoverComponentsTest() {
    ComponentToMap component;
    component.coarse_index = 3;
    for (image_t image_id = 1; image_id <= 41; ++image_id) {
      component.data.images[image_id].image_id = image_id;
      component.data.images[image_id].camera_id = 1;
      if (image_id <= 40) component.coarse[image_id] = Rigid3d();
    }
    component.data.cameras[1] = PinholeCamera(700.0);
    for (image_t image_id = 1; image_id < 39; ++image_id) {
      if (image_id == 12 || image_id == 27 || image_id == 37) continue;
      component.data.pairs.push_back(Pair(image_id, image_id + 1));
    }
    // A pair between two of these groups, as of a false loop closure.
    component.data.pairs.push_back(Pair(12, 13));
    component.data.pairs.push_back(Pair(30, 41));
    for (image_t image_id = 1; image_id <= 40; ++image_id) {
      RelativePosePrior prior;
      prior.image_id1 = image_id;
      prior.image_id2 = image_id + 1;
      component.data.frame_priors.push_back(prior);
    }
    components_.push_back(std::move(component));
  }

  static colmap::Camera PinholeCamera(double focal_px) {
    return MakeCamera(1, *CameraModelId("SIMPLE_PINHOLE"), 640, 480,
                      {focal_px, 320.0, 240.0}, false);
  }

  static ScenePair Pair(image_t image_id1, image_t image_id2) {
    ScenePair pair;
    pair.image_id1 = image_id1;
    pair.image_id2 = image_id2;
    pair.inlier_matches.resize(30);
    return pair;
  }

  // A model of these images, its camera refined.
  static MappedComponent Mapped(const std::set<image_t>& image_ids) {
    MappedComponent mapped;
    mapped.model.AddCamera(PinholeCamera(650.0));
    for (const image_t image_id : image_ids) {
      colmap::Image image;
      image.SetImageId(image_id);
      image.SetCameraId(1);
      image.SetName("image" + std::to_string(image_id));
      mapped.model.AddImage(image);
      mapped.model.RegisterImage(image_id);
    }
    return mapped;
  }

  static std::set<image_t> Range(image_t first, image_t last) {
    std::set<image_t> images;
    for (image_t image_id = first; image_id <= last; ++image_id) {
      images.insert(image_id);
    }
    return images;
  }

  std::vector<ComponentToMap> components_;
};

TEST_F(LeftoverComponentsTest, StretchesBecomeComponents) {
  std::vector<MappedComponent> mapped;
  mapped.push_back(Mapped(Range(13, 27)));
  TakeLeftovers(mapped, &components_);
  ASSERT_EQ(components_.size(), 3);
  size_t num_images = 0;
  for (const ComponentToMap& component : components_) {
    EXPECT_EQ(component.coarse_index, 3);
    num_images += component.data.images.size();
  }
  // No image is lost or counted twice.
  EXPECT_EQ(num_images, 41);
  // Images 38-39 and 40 are too few for components.
  EXPECT_EQ(components_[0].coarse.size(), 18);
  EXPECT_EQ(components_[0].data.images.size(), 18);
  EXPECT_EQ(components_[1].coarse.size(), 12);
  EXPECT_EQ(components_[1].data.pairs.size(), 11);
  EXPECT_EQ(components_[1].data.frame_priors.size(), 11);
  EXPECT_EQ(components_[2].coarse.size(), 10);
  EXPECT_EQ(components_[2].data.images.count(41), 1);
  // New components use the camera that the model has refined.
  EXPECT_EQ(components_[0].data.cameras.at(1).MeanFocalLength(), 700.0);
  EXPECT_EQ(components_[1].data.cameras.at(1).MeanFocalLength(), 650.0);
}

TEST_F(LeftoverComponentsTest, FewImagesStayLost) {
  std::vector<MappedComponent> mapped;
  mapped.push_back(Mapped(Range(1, 37)));
  TakeLeftovers(mapped, &components_);
  ASSERT_EQ(components_.size(), 1);
  EXPECT_EQ(components_[0].data.images.size(), 41);
  EXPECT_EQ(components_[0].coarse.size(), 40);
}

TEST_F(LeftoverComponentsTest, NothingIsTakenFromAFailure) {
  std::vector<MappedComponent> mapped(1);
  TakeLeftovers(mapped, &components_);
  EXPECT_EQ(components_.size(), 1);
}

}  // namespace
}  // namespace adasfm
