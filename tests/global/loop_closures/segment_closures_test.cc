// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "core/random.h"
#include "core/so3.h"
#include "global/loop_closures/filter_loop_closures.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

// Two drives around the same block, 1 m an image. No sensors and no pairs of
// neighbouring images connect the drives:
//
//    60 --<-- 41     Ids 1 ... 80; the second drive has ids 201 ... 280 in a
//    |         |     lane 1 m beside. Images of the two drives that see each
//    61       40     other may have a pair.
//    |         |
//    80 .. 1 -> 20
constexpr int kNumImages = 80;
constexpr image_t kSecond = 200;
constexpr int kSide = 20;

Rigid3d PoseAt(int k, bool is_second, int side_length = kSide) {
  const int side = k / side_length;
  Eigen::Vector3d center(0.0, is_second ? 1.0 : 0.0, 0.0);
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  for (int s = 0; s <= side; ++s) {
    center += (s < side ? side_length : k % side_length) * direction;
    if (s < side) direction = Eigen::Vector3d(-direction.y(), direction.x(), 0);
  }
  const Eigen::Quaterniond street(
      Eigen::AngleAxisd(side * std::acos(0.0), Eigen::Vector3d::UnitZ()));
  return CamFromWorldWithCenter(street.conjugate(), center);
}

struct Drives {
  ViewGraph graph;
  std::vector<std::optional<EdgeLength>> lengths;
  std::vector<RelativePosePrior> priors;
};

Rigid3d PoseOf(image_t id, int side_length = kSide) {
  return id > kSecond ? PoseAt(id - kSecond - 1, true, side_length)
                      : PoseAt(id - 1, false, side_length);
}

void AddPair(image_t i, image_t j, const Rigid3d& motion, Drives* drives) {
  ViewGraphEdge edge = BuildEdge(ImagePair(i, j), motion);
  edge.cam2_from_cam1.translation.normalize();
  edge.num_inliers = 100;
  const auto place = std::upper_bound(
      drives->graph.edges.begin(), drives->graph.edges.end(), edge,
      [](const auto& a, const auto& b) { return a.Pair() < b.Pair(); });
  drives->lengths.insert(
      drives->lengths.begin() + (place - drives->graph.edges.begin()),
      EdgeLength{motion.translation.norm(), 0.01});
  drives->graph.edges.insert(place, edge);
}

// Only the first drive has sensors.
Drives BuildDrives(double scale_of_second = 1.0,
                   image_t num_images = kNumImages, int side_length = kSide) {
  Drives drives;
  Random random(1);
  for (const image_t offset : {image_t{0}, kSecond}) {
    for (image_t i = offset + 1; i <= offset + num_images; ++i) {
      drives.graph.images.push_back(i);
      for (image_t j = i + 1; j <= std::min(i + 3, offset + num_images); ++j) {
        Rigid3d motion =
            ComputeCam2FromCam1(PoseOf(i, side_length), PoseOf(j, side_length));
        if (j == i + 1 && offset == 0) {
          drives.priors.push_back(
              BuildPrior(i, j, motion, 1e-4, 1e-3, &random));
          drives.priors.back().flags =
              kPriorRotation | kPriorDirection | kPriorLength;
        }
        if (offset > 0) motion.translation *= scale_of_second;
        AddPair(i, j, motion, &drives);
      }
    }
  }
  return drives;
}

// Adds pairs of image k in the first drive and image k + shift in the second.
// The pairs' poses place the images at k and k + apparent.
void AddPlace(int begin, int end, int shift, int apparent, Drives* drives,
              int side_length = kSide) {
  for (int k = begin; k < end; ++k) {
    for (const int skew : {0, 1}) {
      const int j = k + shift + skew;
      AddPair(
          k + 1, kSecond + j + 1,
          ComputeCam2FromCam1(PoseAt(k, false, side_length),
                              PoseAt(k + apparent + skew, true, side_length)),
          drives);
    }
  }
}

void AddTruePlace(int begin, int end, Drives* drives) {
  AddPlace(begin, end, 0, 0, drives);
}

// Chains the sensors' steps and the second drive's consecutive pairs.
LoopClosureReport Filter(Drives* drives,
                         const LoopClosureOptions& options = {}) {
  std::vector<RelativePosePrior> steps = drives->priors;
  for (size_t e = 0; e < drives->graph.edges.size(); ++e) {
    const ViewGraphEdge& edge = drives->graph.edges[e];
    if (edge.image_id1 <= kSecond || edge.image_id2 != edge.image_id1 + 1) {
      continue;
    }
    RelativePosePrior step;
    step.image_id1 = edge.image_id1;
    step.image_id2 = edge.image_id2;
    step.cam2_from_cam1 = edge.cam2_from_cam1;
    step.cam2_from_cam1.translation *= drives->lengths[e]->length;
    step.covariance = 1e-5 * Eigen::Matrix<double, 6, 6>::Identity();
    step.flags = kPriorRotation | kPriorDirection | kPriorLength;
    steps.push_back(step);
  }
  TrajectoryOdometry odometry;
  odometry.chain = OdometryChain(steps, OdometryChainOptions());
  odometry.lengths = drives->lengths;
  odometry.priors = drives->priors;
  return FilterLoopClosures(options, odometry, &drives->graph);
}

int CountKeptJoins(const ViewGraph& graph) {
  int num_kept = 0;
  for (const ViewGraphEdge& edge : graph.edges) {
    if (edge.image_id1 > kSecond || edge.image_id2 <= kSecond) {
      EXPECT_TRUE(edge.IsKept());
    } else {
      num_kept += edge.IsKept();
    }
  }
  return num_kept;
}

TEST(FilterLoopClosures, OnePlaceJoinsNothing) {
  Drives drives = BuildDrives();
  AddTruePlace(3, 18, &drives);
  const LoopClosureReport report = Filter(&drives);
  EXPECT_EQ(report.num_segments, 2);
  EXPECT_EQ(report.num_confirmed_closures, 0);
  EXPECT_EQ(report.num_pairs_of_unconfirmed_closures, 30);
  ASSERT_EQ(report.unconfirmed_closures.size(), 1);
  EXPECT_EQ(report.unconfirmed_closures[0].num_pairs, 30);
  EXPECT_EQ(report.unconfirmed_closures[0].num_images, kNumImages);
  EXPECT_LE(report.unconfirmed_closures[0].image_id1, kSecond);
  EXPECT_GT(report.unconfirmed_closures[0].image_id2, kSecond);
  EXPECT_EQ(CountKeptJoins(drives.graph), 0);
  EXPECT_EQ(FindConnectedComponents(drives.graph).size(), 2);
}

TEST(FilterLoopClosures, ASecondPlaceBehindATurnConfirms) {
  // The unit of the part without sensors is free within a factor of two.
  for (const double scale : {1.0, 0.7, 1.5}) {
    Drives drives = BuildDrives(scale);
    AddTruePlace(3, 10, &drives);
    AddTruePlace(45, 52, &drives);
    const LoopClosureReport report = Filter(&drives);
    EXPECT_EQ(report.num_confirmed_closures, 1) << scale;
    EXPECT_TRUE(report.unconfirmed_closures.empty());
    ASSERT_EQ(report.closures_by_vision.size(), 1);
    EXPECT_EQ(report.closures_by_vision[0].num_pairs, 28);
    EXPECT_EQ(report.closures_by_vision[0].num_images, kNumImages);
    EXPECT_EQ(CountKeptJoins(drives.graph), 28) << scale;
  }
}

TEST(FilterLoopClosures, MetresOnBothSidesConfirmToo) {
  Drives drives = BuildDrives();
  AddTruePlace(3, 10, &drives);
  AddTruePlace(45, 52, &drives);
  Random random(2);
  for (image_t i = kSecond + 1; i < kSecond + kNumImages; ++i) {
    drives.priors.push_back(
        BuildPrior(i, i + 1, ComputeCam2FromCam1(PoseOf(i), PoseOf(i + 1)),
                   1e-4, 1e-3, &random));
    drives.priors.back().flags =
        kPriorRotation | kPriorDirection | kPriorLength;
  }
  const LoopClosureReport report = Filter(&drives);
  EXPECT_EQ(report.num_confirmed_closures, 1);
  EXPECT_TRUE(report.closures_by_vision.empty());
}

// Repetitive facades give false pairs all along two parallel streets. Such
// pairs are consistent with each other, however many there are.
TEST(FilterLoopClosures, AStraightStreetConfirmsNothing) {
  for (const int num_images : {20, 150}) {
    Drives drives = BuildDrives(1.0, num_images, 1000);
    AddPlace(0, num_images - 1, 0, 0, &drives, 1000);
    const LoopClosureReport report = Filter(&drives);
    EXPECT_EQ(report.num_confirmed_closures, 0) << num_images;
    EXPECT_EQ(report.unconfirmed_closures.size(), 1);
    EXPECT_EQ(CountKeptJoins(drives.graph), 0) << num_images;
  }
}

// A straight street confirms two drives that pass it together, image by image.
TEST(FilterLoopClosures, DrivesAtTheSameTimeNeedNoTurn) {
  for (const int delay : {0, 1000}) {
    Drives drives = BuildDrives();
    AddTruePlace(1, 5, &drives);
    AddTruePlace(13, 18, &drives);
    for (const image_t id : drives.graph.images) {
      const int64_t drive = id > kSecond;
      const int64_t k = id % kSecond;
      drives.graph.capture_ranks.push_back(drive * kRankGapOfDrives + k);
      drives.graph.capture_positions.push_back(2 * k + drive * (1 + delay));
    }
    const LoopClosureReport report = Filter(&drives);
    EXPECT_EQ(report.num_confirmed_closures, delay == 0) << delay;
    EXPECT_TRUE(report.closures_by_vision.empty());
    EXPECT_EQ(CountKeptJoins(drives.graph), delay == 0 ? 18 : 0) << delay;
  }
}

TEST(FilterLoopClosures, LongRunsAroundCornersConfirmThemselves) {
  Drives drives = BuildDrives();
  AddTruePlace(5, 50, &drives);
  EXPECT_EQ(Filter(&drives).num_confirmed_closures, 1);
  EXPECT_EQ(CountKeptJoins(drives.graph), 90);
}

// Aliased places are consistent neither with true ones nor with each other.
TEST(FilterLoopClosures, FalsePlacesGo) {
  // The second image is one street further than the pair's pose states.
  Drives drives = BuildDrives();
  AddPlace(4, 12, 22, 2, &drives);
  AddPlace(64, 72, -21, -1, &drives);
  Drives with_truth = drives;
  EXPECT_EQ(Filter(&drives).num_confirmed_closures, 0);
  EXPECT_EQ(CountKeptJoins(drives.graph), 0);

  AddTruePlace(3, 10, &with_truth);
  AddTruePlace(45, 52, &with_truth);
  EXPECT_EQ(Filter(&with_truth).num_confirmed_closures, 1);
  for (const ViewGraphEdge& edge : with_truth.graph.edges) {
    if (edge.image_id1 > kSecond || edge.image_id2 <= kSecond) continue;
    const int shift = edge.image_id2 - kSecond - edge.image_id1;
    EXPECT_EQ(edge.IsKept(), shift == 0 || shift == 1)
        << edge.image_id1 << " and " << edge.image_id2;
  }
}

TEST(FilterLoopClosures, SmallPartsFollowOneOther) {
  Drives drives = BuildDrives();
  // One image that sees a little of one drive and more of the other.
  drives.graph.images.push_back(300);
  AddPair(10, 300, PoseAt(2, true), &drives);
  AddPair(kSecond + 10, 300, PoseAt(2, true), &drives);
  AddPair(kSecond + 11, 300, PoseAt(2, true), &drives);
  Filter(&drives);
  for (const ViewGraphEdge& edge : drives.graph.edges) {
    if (edge.image_id2 != 300) continue;
    EXPECT_EQ(edge.IsKept(), edge.image_id1 != 10);
  }
  EXPECT_EQ(FindConnectedComponents(drives.graph).size(), 2);
}

TEST(FilterLoopClosures, SensorsAndNeighboursMakeOnePart) {
  Drives drives = BuildDrives();
  AddTruePlace(3, 10, &drives);
  // A prior over the gap.
  Drives joined = drives;
  joined.priors.push_back(joined.priors.front());
  joined.priors.back().image_id1 = kNumImages;
  joined.priors.back().image_id2 = kSecond + 1;
  joined.priors.back().cam2_from_cam1 =
      ComputeCam2FromCam1(PoseOf(kNumImages), PoseOf(kSecond + 1));
  EXPECT_EQ(Filter(&joined).num_segments, 1);
  EXPECT_EQ(CountKeptJoins(joined.graph), 14);
  // A rotation alone does not constrain the place.
  Drives turned = drives;
  turned.priors.push_back(joined.priors.back());
  turned.priors.back().flags = kPriorRotation;
  EXPECT_EQ(Filter(&turned).num_segments, 2);
  // Consecutive ids within max_sequence_gap.
  LoopClosureOptions options;
  options.max_sequence_gap = kSecond + 1 - kNumImages;
  AddPair(kNumImages, kSecond + 1,
          ComputeCam2FromCam1(PoseOf(kNumImages), PoseOf(kSecond + 1)),
          &drives);
  EXPECT_EQ(Filter(&drives, options).num_segments, 1);
}

// Each option changes the outcome.
TEST(FilterLoopClosures, JoinOptionsDecide) {
  // The second place is turned by 8 degrees.
  const auto build = [](double angle_rad, double scale) {
    Drives places = BuildDrives(scale);
    AddTruePlace(3, 10, &places);
    for (int k = 45; k < 52; ++k) {
      Rigid3d second = PoseAt(k, true);
      second.rotation =
          ExpSo3(Eigen::Vector3d(0, 0, angle_rad)) * second.rotation;
      AddPair(k + 1, kSecond + k + 1,
              ComputeCam2FromCam1(PoseAt(k, false), second), &places);
    }
    return places;
  };
  const auto confirms = [](const Drives& drives,
                           std::function<void(LoopClosureOptions*)> change) {
    Drives copy = drives;
    LoopClosureOptions options;
    change(&options);
    return Filter(&copy, options).num_confirmed_closures == 1;
  };
  const auto as_it_is = [](LoopClosureOptions*) {};
  const Drives turned = build(0.14, 1.0);
  EXPECT_FALSE(confirms(turned, as_it_is));
  EXPECT_TRUE(confirms(turned, [](auto* o) { o->significance = 1e-30; }));
  EXPECT_TRUE(confirms(build(0.0, 1.0), as_it_is));
  EXPECT_TRUE(confirms(build(0.0, 1.7), as_it_is));
  // One place is not confirmed.
  Drives joined = BuildDrives();
  AddTruePlace(3, 10, &joined);
  LoopClosureOptions keep;
  keep.split_unconfirmed_closures = false;
  const LoopClosureReport report = Filter(&joined, keep);
  EXPECT_EQ(report.num_pairs_of_unconfirmed_closures, 0);
  ASSERT_EQ(report.unconfirmed_closures.size(), 1);
  EXPECT_EQ(report.unconfirmed_closures[0].num_pairs, 14);
  EXPECT_EQ(CountKeptJoins(joined.graph), 14);
  for (int i = 0; i < 2; ++i) {
    LoopClosureOptions options;
    std::string error;
    if (i == 0) options.max_sequence_gap = 0;
    if (i == 1) options.significance = 1.0;
    EXPECT_FALSE(options.IsValid(&error)) << i;
    EXPECT_THROW(Filter(&joined, options), std::invalid_argument) << i;
  }
}

}  // namespace
}  // namespace adasfm
