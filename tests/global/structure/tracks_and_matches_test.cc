// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/so3.h"
#include "global/structure/match_refinement.h"
#include "global/structure/triangulate_tracks.h"
#include "global/view_graph/tracks.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

std::vector<Track> FindTracks(
    const std::map<ImagePair, std::vector<FeatureMatch>>& matches,
    int max_track_length = 12) {
  return SelectTracks(max_track_length, BuildTracks(matches));
}

// Images 1 2 3: keypoint 0 is the same point in all of them. A wrong match
// would join keypoint 5 of image 3 to this point:
//   1:0 - 2:0 - 3:0      2:0 - 3:5 (in a pair with fewer matches, so later)
TEST(BuildTracks, KeepsOneKeypointPerImage) {
  std::map<ImagePair, std::vector<FeatureMatch>> matches;
  matches[ImagePair(1, 2)] = {{0, 0}, {1, 1}, {2, 2}};
  matches[ImagePair(1, 3)] = {{0, 0}, {1, 1}};
  matches[ImagePair(2, 3)] = {{0, 5}};
  const std::vector<Track> tracks = FindTracks(matches);
  ASSERT_EQ(tracks.size(), 2);
  EXPECT_EQ(tracks[0], (Track{{1, 0}, {2, 0}, {3, 0}}));
  EXPECT_EQ(tracks[1], (Track{{1, 1}, {2, 1}, {3, 1}}));
}

// Matches of images with 150 points in 1 2 3 4, 50 in 1 2 3 and 50 in 2 3 5.
// An image needs 120 tracks: the long ones suffice for 1 2 3 4, image 5 needs
// its own.
TEST(SelectTracks, TakesLongTracksFirstUntilImagesHaveEnough) {
  std::map<ImagePair, std::vector<FeatureMatch>> matches;
  const auto add = [&matches](image_t i, image_t j, point2D_t begin,
                              point2D_t end) {
    for (point2D_t k = begin; k < end; ++k) {
      matches[ImagePair(i, j)].push_back({k, k});
    }
  };
  add(1, 2, 0, 200);
  add(2, 3, 0, 250);
  add(3, 4, 0, 150);
  add(3, 5, 200, 250);
  std::map<size_t, int> num_of_length;
  int num_in_5 = 0;
  for (const Track& track : FindTracks(matches)) {
    ++num_of_length[track.size()];
    num_in_5 += track.back().image_id == 5;
  }
  EXPECT_EQ(num_of_length[4], 120);
  EXPECT_EQ(num_of_length[3], 50);
  EXPECT_EQ(num_in_5, 50);
}

TEST(BuildTracks, ShortensLongTracksEvenly) {
  constexpr int kNumImages = 40;
  constexpr int kNumTracks = 64;
  std::map<ImagePair, std::vector<FeatureMatch>> matches;
  for (image_t i = 1; i < kNumImages; ++i) {
    for (point2D_t k = 0; k < kNumTracks; ++k) {
      matches[ImagePair(i, i + 1)].push_back({k, k});
    }
  }
  for (const int max_length : {3, 4, 12, 39, 40, 50}) {
    const std::vector<Track> tracks = FindTracks(matches, max_length);
    ASSERT_EQ(tracks.size(), kNumTracks);
    std::map<image_t, int> num_tracks;
    const int length = std::min(max_length, kNumImages);
    for (const Track& track : tracks) {
      ASSERT_EQ(track.size(), length);
      EXPECT_EQ(track.front().image_id, 1);
      EXPECT_EQ(track.back().image_id, kNumImages);
      for (int k = 1; k < length; ++k) {
        EXPECT_EQ(track[k].point2D_idx, track[0].point2D_idx);
        EXPECT_GT(track[k].image_id, track[k - 1].image_id);
        if (length > 3) {
          EXPECT_LE(track[k].image_id - track[k - 1].image_id,
                    2 * (kNumImages - 1) / (length - 2));
        }
      }
      for (const TrackElement& element : track) ++num_tracks[element.image_id];
    }
    // Each image keeps some of its tracks.
    if (max_length >= 12) {
      EXPECT_EQ(num_tracks.size(), kNumImages);
    }
  }
}

TEST(EstimateTrackBytes, CoversTheTracksAndGrowsWithTheMatches) {
  std::map<ImagePair, std::vector<FeatureMatch>> matches;
  EXPECT_EQ(EstimateTrackBytes(matches), 0);
  size_t last = 0;
  for (image_t i = 1; i < 30; ++i) {
    for (point2D_t k = 0; k < 100; ++k) {
      matches[ImagePair(i, i + 1)].push_back({k, k});
    }
    const size_t estimate = EstimateTrackBytes(matches);
    EXPECT_GT(estimate, last);
    last = estimate;
    size_t num_bytes = 0;
    for (const Track& track : FindTracks(matches)) {
      num_bytes += sizeof(Track) + track.capacity() * sizeof(TrackElement);
    }
    EXPECT_GT(estimate, num_bytes);
  }
}

TEST(TriangulateTracks, FindsThePointsDespiteWrongObservations) {
  for (const bool fisheye : {false, true}) {
    TestSceneOptions options;
    options.noise_px = 0.3;
    options.fisheye = fisheye;
    const TestScene scene = BuildTestScene(options, 1);
    std::vector<Track> tracks;
    for (int k = 0; k < options.num_landmarks; ++k) {
      tracks.emplace_back();
      for (const image_t image_id : scene.graph.images) {
        // Image 4 observes other landmarks.
        const point2D_t wrong = (k + 7) % options.num_landmarks;
        tracks.back().push_back({image_id, image_id == 4 ? wrong : k});
      }
    }
    TrackTriangulationOptions triangulation;
    triangulation.max_reproj_error_px = 4.0;
    const auto points =
        TriangulateTracks(triangulation, scene.cams_from_world,
                          scene.correspondences.bearings, tracks);
    EXPECT_GT(points.size(), 0.95 * tracks.size());
    for (const TriangulatedTrack& point : points) {
      const Eigen::Vector3d& truth =
          scene.landmarks[point.track.front().point2D_idx];
      // 0.3 px at 20 m over a baseline of some 5 m and at least 250 px.
      EXPECT_LT((point.point_in_world - truth).norm(), 0.6);
      EXPECT_GE(point.angle_deg, triangulation.min_triangulation_angle_deg);
      EXPECT_LT(point.mean_reproj_error_px, 2.0);
    }
    triangulation.min_triangulation_angle_deg = 90.0;
    EXPECT_TRUE(TriangulateTracks(triangulation, scene.cams_from_world,
                                  scene.correspondences.bearings, tracks)
                    .empty());
  }
}

TEST(RefineMatches, RecoversTrueMatchesAndDropsFalseOnes) {
  for (const bool fisheye : {false, true}) {
    TestSceneOptions options;
    options.noise_px = 0.5;
    options.outlier_ratio = 0.4;
    options.fisheye = fisheye;
    const TestScene scene = BuildTestScene(options, 2);
    const MatchRefinementReport report = RefineMatches(
        MatchRefinementOptions(), scene.cams_from_world,
        scene.correspondences.bearings, scene.correspondences.matches);
    int num_true = 0;
    int num_true_kept = 0;
    int num_kept = 0;
    for (const auto& [pair, matches] : scene.correspondences.matches) {
      for (const FeatureMatch& match : matches) {
        num_true += match.point2D_idx1 == match.point2D_idx2;
      }
    }
    for (const RefinedPair& pair : report.pairs) {
      for (const FeatureMatch& match : pair.matches) {
        ++num_kept;
        num_true_kept += match.point2D_idx1 == match.point2D_idx2;
      }
    }
    // Noise of twice 0.7 px is small against 4 px: nearly all true matches are
    // kept. A wrong match lies in the epipolar band by chance in about 4 px of
    // 500.
    EXPECT_GT(num_true_kept, 0.97 * num_true);
    EXPECT_GT(num_true_kept, 0.96 * num_kept);
    EXPECT_EQ(report.num_removed_pairs, 0);
    // Half of a pair's points have more than the median parallax.
    for (const RefinedPair& pair : report.pairs) {
      const auto centre = [&](image_t image_id) {
        return scene.cams_from_world.at(image_id).TargetOriginInSource();
      };
      int num_larger = 0;
      for (const FeatureMatch& match : pair.matches) {
        const Eigen::Vector3d& point = scene.landmarks[match.point2D_idx1];
        const Eigen::Vector3d ray1 = point - centre(pair.pair.image_id1);
        const Eigen::Vector3d ray2 = point - centre(pair.pair.image_id2);
        num_larger += std::atan2(ray1.cross(ray2).norm(), ray1.dot(ray2)) >
                      pair.median_parallax_rad;
      }
      EXPECT_NEAR(num_larger, 0.5 * pair.matches.size(),
                  0.1 * pair.matches.size());
    }
  }
}

TEST(RefineMatches, RemovesPairsAndSkipsImagesWithoutPose) {
  const TestScene scene = BuildTestScene(TestSceneOptions(), 2);
  auto candidates = scene.correspondences.matches;
  candidates[ImagePair(1, 2)].resize(10);
  auto poses = scene.cams_from_world;
  poses.erase(8);
  const MatchRefinementReport report =
      RefineMatches(MatchRefinementOptions(), poses,
                    scene.correspondences.bearings, candidates);
  EXPECT_EQ(report.num_removed_pairs, 1);
  EXPECT_TRUE(report.pairs.front().removed);
  EXPECT_EQ(report.num_skipped_pairs, 4);
  MatchRefinementOptions options;
  options.min_num_matches = 10;
  EXPECT_EQ(
      RefineMatches(options, poses, scene.correspondences.bearings, candidates)
          .num_removed_pairs,
      0);
}

}  // namespace
}  // namespace adasfm
