// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper/merge_reconstructions.h"

#include <gtest/gtest.h>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/mapper/align_parts.h"
#include "colmap_ext/mapper/local_mapper.h"
#include "tests/testing/colmap_ext/mapper_world.h"
#include "tests/testing/matchers.h"

namespace adasfm {
namespace {

std::set<image_t> Interval(image_t first, image_t last) {
  std::set<image_t> images;
  for (image_t i = first; i <= last; ++i) images.insert(i);
  return images;
}

void Move(const Sim3d& new_from_old, colmap::Reconstruction* reconstruction) {
  for (const image_t image_id : reconstruction->RegImageIds()) {
    colmap::Image& image = reconstruction->Image(image_id);
    SetCamFromWorld(TransformCamFromWorld(new_from_old, CamFromWorld(image)),
                    &image);
  }
  for (const auto& point : reconstruction->Points3D()) {
    Eigen::Vector3d& xyz = reconstruction->Point3D(point.first).XYZ();
    xyz = new_from_old * xyz;
  }
}

// Two overlapping halves of a drive, reconstructed on their own.
class MergeTest : public testing::Test {
 protected:
  void Build(uint64_t seed) {
    MapperWorldOptions options;
    options.world.num_images = 60;
    options.world.seed = seed;
    world_ = BuildMapperWorld(options);
    parts_.clear();
    for (const auto& images : {Interval(1, 36), Interval(25, 60)}) {
      LocalMapResult local =
          ReconstructLocally({}, world_.data, world_.coarse_poses, images);
      EXPECT_EQ(local.reconstruction.NumRegImages(), images.size());
      PartModel part;
      part.part_index = static_cast<int>(parts_.size());
      part.reconstruction = std::move(local.reconstruction);
      part.prior_only_images = local.prior_only_images;
      parts_.push_back(std::move(part));
    }
  }

  std::unique_ptr<MapperScene> BuildScene(bool with_matches = false) const {
    return BuildMapperScene(world_.data, world_.coarse_poses, Interval(1, 60),
                            with_matches);
  }

  MapperWorld world_;
  std::vector<PartModel> parts_;
};

TEST_F(MergeTest, PartsInOtherFramesComeTogether) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Build(seed);
    Random random(seed);
    Move(Sim3d(2.5, ExpSo3(random.UnitVector()), random.GaussianVector(30.0)),
         &parts_[1].reconstruction);
    const AlignPartsResult aligned =
        AlignParts({}, world_.coarse_poses, parts_);
    ASSERT_TRUE(aligned.alignments[0].success);
    ASSERT_TRUE(aligned.alignments[1].success);
    EXPECT_NEAR(aligned.world_from_parts[1].scale, 1.0 / 2.5, 0.02);
    EXPECT_GT(aligned.num_separators, 0);
    EXPECT_LE(aligned.separator_rmse_after, aligned.separator_rmse_before);
    auto scene = BuildScene();
    const MergeSummary summary = MergeParts(aligned, parts_, scene.get());
    EXPECT_TRUE(summary.coarse_images.empty());
    EXPECT_GT(summary.num_merged_points, 0);
    EXPECT_EQ(scene->reconstruction.NumRegImages(), 60);
    // The merged points agree with all their images, up to what the alignment
    // of two pieces leaves.
    EXPECT_LT(scene->reconstruction.ComputeMeanReprojectionError(), 8.0);
  }
}

// A part that is bent in the middle must not get into the model.
TEST_F(MergeTest, CorruptedPartIsNotMerged) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Build(seed);
    const Eigen::Vector3d hinge =
        CamFromWorld(parts_[1].reconstruction.Image(42)).TargetOriginInSource();
    const Eigen::Quaterniond turn = ExpSo3(Eigen::Vector3d(0.0, 0.0, 0.8));
    const Sim3d bend(1.0, turn, hinge - turn * hinge);
    for (image_t image_id = 43; image_id <= 60; ++image_id) {
      colmap::Image& image = parts_[1].reconstruction.Image(image_id);
      SetCamFromWorld(TransformCamFromWorld(bend, CamFromWorld(image)), &image);
    }
    const AlignPartsResult aligned =
        AlignParts({}, world_.coarse_poses, parts_);
    EXPECT_TRUE(aligned.alignments[0].success);
    EXPECT_FALSE(aligned.alignments[1].success);
    auto scene = BuildScene();
    const MergeSummary summary = MergeParts(aligned, parts_, scene.get());
    // Its images keep coarse poses instead.
    EXPECT_EQ(summary.coarse_images, Interval(37, 60));
    EXPECT_EQ(scene->reconstruction.NumRegImages(), 60);
    for (const image_t image_id : Interval(37, 60)) {
      EXPECT_TRUE(PosesNear(CamFromWorld(scene->reconstruction.Image(image_id)),
                            world_.coarse_poses.at(image_id), 0.1, 2.0));
      EXPECT_EQ(scene->reconstruction.Image(image_id).NumPoints3D(), 0);
    }
  }
}

TEST_F(MergeTest, MatchesChangeNothing) {
  Build(1);
  const AlignPartsResult aligned = AlignParts({}, world_.coarse_poses, parts_);
  const auto with = BuildScene(/*with_matches=*/true);
  const auto without = BuildScene(/*with_matches=*/false);
  EXPECT_EQ(MergeParts(aligned, parts_, with.get()).num_points,
            MergeParts(aligned, parts_, without.get()).num_points);
  const colmap::Reconstruction& expected = with->reconstruction;
  const colmap::Reconstruction& model = without->reconstruction;
  for (const image_t image_id : Interval(1, 60)) {
    EXPECT_TRUE(PosesNear(CamFromWorld(model.Image(image_id)),
                          CamFromWorld(expected.Image(image_id)), 1e-12,
                          1e-12));
  }
  ASSERT_GT(model.NumPoints3D(), 0);
  for (const auto& [point_id, point] : expected.Points3D()) {
    EXPECT_EQ(XyzOf(model.Point3D(point_id)), XyzOf(point));
    EXPECT_EQ(TrackOf(model.Point3D(point_id)).Length(),
              TrackOf(point).Length());
  }
}

}  // namespace
}  // namespace adasfm
