// SPDX-License-Identifier: BSD-3-Clause
// Three drives with sensors around one block, each in a lane of its own: what
// closures between several segments confirm together.
#include "global/loop_closures/segment_groups.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "global/loop_closures/filter_loop_closures.h"
#include "tests/testing/global/test_scene.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 80;
constexpr int kSide = 20;

// Image k of a drive: 1 m an image, a left turn after every kSide images.
Rigid3d PoseAt(int drive, int k) {
  const int side = k / kSide;
  Eigen::Vector3d center(0.0, drive, 0.0);
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();
  for (int s = 0; s <= side; ++s) {
    center += (s < side ? kSide : k % kSide) * direction;
    if (s < side) direction = Eigen::Vector3d(-direction.y(), direction.x(), 0);
  }
  const Eigen::Quaterniond street(
      Eigen::AngleAxisd(side * std::acos(0.0), Eigen::Vector3d::UnitZ()));
  return CamFromWorldWithCenter(street.conjugate(), center);
}

image_t IdOf(int drive, int k) { return 200 * drive + k + 1; }

class SegmentGroupsTest : public testing::Test {
 protected:
  SegmentGroupsTest() {
    Random random(1);
    for (int drive = 0; drive < 3; ++drive) {
      for (int k = 0; k < kNumImages; ++k) {
        graph_.images.push_back(IdOf(drive, k));
        if (k == 0) continue;
        odometry_.priors.push_back(BuildPrior(
            IdOf(drive, k - 1), IdOf(drive, k),
            ComputeCam2FromCam1(PoseAt(drive, k - 1), PoseAt(drive, k)), 1e-4,
            1e-3, &random));
        odometry_.priors.back().flags =
            kPriorRotation | kPriorDirection | kPriorLength;
      }
    }
    odometry_.chain = OdometryChain(odometry_.priors, OdometryChainOptions());
  }

  // Pairs of images k of both drives, seven at a place. Their poses are those
  // of image k + shift of the second drive.
  void AddPlace(int drive1, int drive2, int k, int shift = 0) {
    for (int i = k; i < k + 7; ++i) {
      ViewGraphEdge edge = BuildEdge(
          ImagePair(IdOf(drive1, i), IdOf(drive2, i)),
          ComputeCam2FromCam1(PoseAt(drive1, i), PoseAt(drive2, i + shift)));
      lengths_[edge.Pair()] = edge.cam2_from_cam1.translation.norm();
      edge.cam2_from_cam1.translation.normalize();
      edge.num_inliers = 100;
      edges_[edge.Pair()] = edge;
    }
  }

  LoopClosureReport Filter() {
    for (const auto& [pair, edge] : edges_) {
      graph_.edges.push_back(edge);
      odometry_.lengths.push_back(EdgeLength{lengths_.at(pair), 0.01});
    }
    return FilterLoopClosures(LoopClosureOptions(), odometry_, &graph_);
  }

  int CountKept(int drive1, int drive2) const {
    int num_kept = 0;
    for (const ViewGraphEdge& edge : graph_.edges) {
      num_kept += edge.IsKept() &&
                  static_cast<int>(edge.image_id1) / 200 == drive1 &&
                  static_cast<int>(edge.image_id2) / 200 == drive2;
    }
    return num_kept;
  }

  ViewGraph graph_;
  TrajectoryOdometry odometry_;
  std::map<ImagePair, ViewGraphEdge> edges_;
  std::map<ImagePair, double> lengths_;
};

// The third drive meets each of the others at one place, which confirms
// nothing, but these two are one by then.
TEST_F(SegmentGroupsTest, PlacesInJoinedDrivesConfirmTogether) {
  AddPlace(0, 1, 3);
  AddPlace(0, 1, 45);
  AddPlace(0, 2, 5);
  AddPlace(1, 2, 65);
  const LoopClosureReport report = Filter();
  EXPECT_EQ(report.num_segments, 3);
  EXPECT_EQ(report.num_confirmed_closures, 2);
  EXPECT_TRUE(report.unconfirmed_closures.empty());
  EXPECT_EQ(CountKept(0, 1), 14);
  EXPECT_EQ(CountKept(0, 2), 7);
  EXPECT_EQ(CountKept(1, 2), 7);
}

// A place that looks like another 5 m on contradicts the way through the other
// drives.
TEST_F(SegmentGroupsTest, AFalsePlaceIsTestedThroughJoinedDrives) {
  AddPlace(0, 1, 3);
  AddPlace(0, 1, 45);
  AddPlace(0, 2, 5);
  AddPlace(1, 2, 65, 5);
  const LoopClosureReport report = Filter();
  EXPECT_EQ(report.num_confirmed_closures, 1);
  EXPECT_EQ(report.unconfirmed_closures.size(), 1);
  EXPECT_EQ(CountKept(0, 1), 14);
  EXPECT_EQ(CountKept(0, 2), 0);
  EXPECT_EQ(CountKept(1, 2), 0);
}

// Two places on one street, in two drives that are one, are not beyond a turn.
TEST_F(SegmentGroupsTest, OneStreetOfJoinedDrivesConfirmsNothing) {
  AddPlace(0, 1, 3);
  AddPlace(0, 1, 45);
  AddPlace(0, 2, 1);
  AddPlace(1, 2, 12);
  const LoopClosureReport report = Filter();
  EXPECT_EQ(report.num_confirmed_closures, 1);
  EXPECT_EQ(CountKept(0, 2) + CountKept(1, 2), 0);
}

// A straight street confirms two drives that pass it together, image by image,
// not others.
TEST_F(SegmentGroupsTest, DrivesAtTheSameTimeNeedNoTurn) {
  for (const int delay : {0, 1000}) {
    graph_.edges.clear();
    odometry_.lengths.clear();
    graph_.capture_ranks.clear();
    graph_.capture_positions.clear();
    for (const image_t id : graph_.images) {
      const int64_t drive = id / 200;
      const int64_t k = id % 200;
      graph_.capture_ranks.push_back(drive * kRankGapOfDrives + k);
      graph_.capture_positions.push_back(3 * k + drive * (1 + delay));
    }
    AddPlace(0, 1, 1);
    AddPlace(0, 1, 12);
    const LoopClosureReport report = Filter();
    EXPECT_EQ(report.num_confirmed_closures, delay == 0 ? 1 : 0);
    EXPECT_EQ(CountKept(0, 1), delay == 0 ? 14 : 0);
  }
}

// The motion through the tree is the true one, within its own sigmas.
TEST_F(SegmentGroupsTest, MotionsLeadThroughClosures) {
  AddPlace(0, 1, 3);
  AddPlace(1, 2, 45);
  for (const auto& [pair, edge] : edges_) graph_.edges.push_back(edge);
  const TrajectorySegments segments = FindTrajectorySegments(
      LoopClosureOptions(), odometry_.priors, odometry_.chain, graph_);
  SegmentGroups groups(segments, odometry_.chain, graph_);
  const auto index = [this](int drive, int k) {
    return graph_.IndexOf(IdOf(drive, k));
  };
  EXPECT_FALSE(groups.FindMotion(index(2, 70), index(0, 10)));
  for (const auto& [drive, k] : {std::make_pair(0, 4), std::make_pair(1, 46)}) {
    const ImagePair pair(IdOf(drive, k), IdOf(drive + 1, k));
    groups.Join({index(drive, k), index(drive + 1, k),
                 MeasurePair(edges_.at(pair),
                             EdgeLength{lengths_.at(pair), 0.01}, 1.0)});
  }
  EXPECT_EQ(groups.GroupOf(index(2, 0)), groups.GroupOf(index(0, 0)));
  EXPECT_EQ(groups.NumImages(groups.GroupOf(0)), 3 * kNumImages);
  EXPECT_TRUE(groups.IsMetric(groups.GroupOf(0)));
  const auto motion = groups.FindMotion(index(2, 70), index(0, 10));
  ASSERT_TRUE(motion);
  EXPECT_TRUE(motion->has_position);
  const Rigid3d truth = ComputeCam2FromCam1(PoseAt(2, 70), PoseAt(0, 10));
  const Eigen::Matrix3d covariance =
      motion->j_from_i.covariance.bottomRightCorner<3, 3>();
  const Eigen::Vector3d error =
      motion->j_from_i.cam2_from_cam1.translation - truth.translation;
  EXPECT_LT(error.dot(covariance.ldlt().solve(error)), 3.0 * 9.0);
  EXPECT_LT(covariance.trace(), 4.0);  // m^2, after 90 m and two pairs
}

}  // namespace
}  // namespace adasfm
