// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/host_mapper.h"

#include <gtest/gtest.h>

#include <map>
#include <thread>
#include <vector>

#include "colmap_ext/host/pose_conversion.h"
#include "tests/testing/colmap_ext/mapper_world.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

constexpr image_t kFirst = 10;
constexpr image_t kSecond = 11;
constexpr image_t kLonely = 1000;

// A world's images, and one image without matches.
class HostMapperTest : public testing::Test {
 protected:
  HostMapperTest() {
    MapperWorldOptions options;
    options.world.num_images = 20;
    options.world.pixel_noise_px = 0.0;
    world_ = BuildMapperWorld(options);
  }

  void Fill(HostMapper* mapper) const {
    for (const auto& [camera_id, camera] : world_.data.cameras) {
      mapper->AddCamera(camera);
    }
    for (const auto& [image_id, image] : world_.data.images) {
      mapper->AddImage(image_id, image.name, image.camera_id, image.keypoints);
    }
    mapper->AddImage(kLonely, "lonely", 1, {Eigen::Vector2d(10.0, 10.0)});
    for (const ScenePair& pair : world_.data.pairs) {
      mapper->AddMatches(pair.image_id1, pair.image_id2, pair.inlier_matches);
    }
    mapper->Begin();
  }

  void RegisterAtTruth(image_t image_id, HostMapper* mapper) const {
    mapper->Register(image_id, world_.true_poses.at(image_id));
    mapper->TriangulateImage(image_id, 0.1);
  }

  // Maps all images, starting from two of them.
  std::map<image_t, Rigid3d> Map() const {
    colmap::Reconstruction model;
    HostMapper mapper(&model);
    Fill(&mapper);
    RegisterAtTruth(kFirst, &mapper);
    RegisterAtTruth(kSecond, &mapper);
    for (bool grew = true; grew;) {
      grew = false;
      for (const image_t image_id : mapper.FindNextImages(15)) {
        if (!mapper.RegisterNextImage(image_id, 8.0, 15)) continue;
        mapper.TriangulateImage(image_id, 0.1);
        grew = true;
      }
    }
    mapper.TriangulateImage(kLonely, 0.1);
    mapper.CompleteAndMergeTracks(4.0);
    mapper.FilterPoints(4.0, 0.1);
    EXPECT_EQ(model.NumImages(), 21);
    mapper.End();
    EXPECT_EQ(model.NumImages(), 20);
    return CamsFromWorld(model);
  }

  MapperWorld world_;
};

TEST_F(HostMapperTest, FindsTheTrueModelFromTwoImages) {
  const auto poses = Map();
  ASSERT_EQ(poses.size(), 20);
  for (const auto& [image_id, pose] : poses) {
    EXPECT_TRUE(PosesNear(pose, world_.true_poses.at(image_id), 1e-4, 1e-3));
  }
}

TEST_F(HostMapperTest, NextImagesSeeEnoughPointsMostFirst) {
  colmap::Reconstruction model;
  HostMapper mapper(&model);
  Fill(&mapper);
  EXPECT_TRUE(mapper.FindNextImages(1).empty());
  RegisterAtTruth(kFirst, &mapper);
  RegisterAtTruth(kSecond, &mapper);
  const std::vector<image_t> images = mapper.FindNextImages(10);
  ASSERT_GT(images.size(), 2);
  for (size_t i = 0; i < images.size(); ++i) {
    EXPECT_FALSE(model.IsImageRegistered(images[i]));
    const size_t num_visible = model.Image(images[i]).NumVisiblePoints3D();
    EXPECT_GE(num_visible, 10);
    if (i > 0) {
      EXPECT_LE(num_visible, model.Image(images[i - 1]).NumVisiblePoints3D());
    }
  }
  const size_t most = model.Image(images[0]).NumVisiblePoints3D();
  EXPECT_TRUE(mapper.FindNextImages(static_cast<int>(most) + 1).empty());
  // More inliers than there are points.
  EXPECT_FALSE(
      mapper.RegisterNextImage(images[0], 8.0, static_cast<int>(most) + 1));
  EXPECT_FALSE(model.IsImageRegistered(images[0]));
  // The image comes last after the failure, and may be tried again.
  EXPECT_EQ(mapper.FindNextImages(10).back(), images[0]);
  EXPECT_TRUE(mapper.RegisterNextImage(images[0], 8.0, 10));
}

// Filters work without the matches, which are released to save memory.
TEST_F(HostMapperTest, FiltersAlikeWithoutMatches) {
  std::vector<size_t> num_points;
  for (const bool releases : {false, true}) {
    colmap::Reconstruction model;
    HostMapper mapper(&model);
    Fill(&mapper);
    for (const image_t image_id : {kFirst, kSecond}) {
      RegisterAtTruth(image_id, &mapper);
    }
    const size_t num_before = model.NumPoints3D();
    if (releases) mapper.ReleaseMatches();
    EXPECT_EQ(model.NumImages(), 21);
    // Every second point is moved out of its observations.
    for (const colmap::point3D_t id : model.Point3DIds()) {
      if (id % 2 == 0) model.Point3D(id).XYZ() *= 3.0;
    }
    mapper.FilterPoints(4.0, 0.1);
    EXPECT_LT(model.NumPoints3D(), num_before);
    EXPECT_GT(model.NumPoints3D(), 0);
    num_points.push_back(model.NumPoints3D());
  }
  EXPECT_EQ(num_points[0], num_points[1]);
}

TEST_F(HostMapperTest, ThreadsDoNotChangeTheResult) {
  const auto expected = Map();
  std::vector<std::map<image_t, Rigid3d>> results(3);
  std::vector<std::thread> threads;
  for (auto& result : results) {
    threads.emplace_back([this, &result] { result = Map(); });
  }
  for (std::thread& thread : threads) thread.join();
  for (const auto& result : results) {
    ASSERT_EQ(result.size(), expected.size());
    for (const auto& [image_id, pose] : expected) {
      EXPECT_EQ(result.at(image_id).translation, pose.translation);
      EXPECT_EQ(result.at(image_id).rotation.coeffs(), pose.rotation.coeffs());
    }
  }
}

}  // namespace
}  // namespace adasfm
