// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdlib>
#include <limits>
#include <map>
#include <optional>
#include <vector>

#include "core/rigid3d.h"
#include "core/types.h"

namespace adasfm {

enum class EdgeSource {
  kVisual,     // rotation and direction from matches
  kSensor,     // rotation and translation from a prior; vision has no edge
  kAugmented,  // rotation from matches, translation from a prior
};

// Why an edge was removed.
enum class EdgeRemoval {
  kKept,
  kFewInliers,
  kOdometryPose,  // contradicts the odometry, but others at its place do not
  kOdometry,      // contradicts the odometry
  kFalseLoop,     // is inconsistent with other loops
  kUnconfirmedClosure,  // alone joins two parts of a drive, and may be wrong
  kUnknownSize,         // joins parts of unknown relative scale
  kRotation,            // off the global rotations
  kTranslation,         // off the global positions
  kDisconnected,        // one of its images has no pose
};
const char* EdgeRemovalName(EdgeRemoval removal);

// One image pair. Directions without a length are unit vectors.
struct ViewGraphEdge {
  image_t image_id1 = kInvalidImageId;  // < image_id2
  image_t image_id2 = kInvalidImageId;
  // The translation has length_m where that is set, else length 1; without a
  // baseline, zero: both centres are one place.
  Rigid3d cam2_from_cam1;
  int num_inliers = 0;
  EdgeSource source = EdgeSource::kVisual;
  bool has_rotation = true;
  bool has_translation = true;
  // False: vision cannot distinguish both centres, and the direction means
  // nothing.
  bool has_baseline = true;
  // Distance of the camera centres in metres, from sensors.
  std::optional<double> length_m;

  // 1 sigma; what the stages weigh with. Overwritten where a stage measures it.
  double rotation_sigma_rad = 0.01;
  double direction_sigma_rad = 0.05;
  double length_sigma_m = std::numeric_limits<double>::infinity();

  EdgeRemoval removal = EdgeRemoval::kKept;

  bool IsKept() const { return removal == EdgeRemoval::kKept; }
  // Whether vision alone speaks of the pair, and cannot tell its centres apart.
  bool IsAtOnePlace() const {
    return IsKept() && source == EdgeSource::kVisual && has_rotation &&
           !has_baseline;
  }
  // Whether the pair then joins its images at one place.
  bool IsJoinAtRest() const {
    return IsAtOnePlace() && has_translation &&
           cam2_from_cam1.translation.isZero(0.0);
  }
  ImagePair Pair() const { return ImagePair(image_id1, image_id2); }
};

inline constexpr int64_t kRankGapOfDrives = int64_t{1} << 32;

struct ViewGraph {
  std::vector<image_t> images;       // sorted
  std::vector<ViewGraphEdge> edges;  // sorted by pair, one per pair
  // The position of each image in the order of capture, all different; empty:
  // the order of the ids. Where drives were captured at the same time, none of
  // them continues another: the ranks of each begin kRankGapOfDrives further.
  std::vector<int64_t> capture_ranks;
  // The same, of all drives together; empty: as above.
  std::vector<int64_t> capture_positions;

  // The position of an image in images, -1 when absent.
  int IndexOf(image_t image_id) const;
  // Of the image at an index.
  int64_t CaptureRank(int index) const {
    return capture_ranks.empty() ? images[index] : capture_ranks[index];
  }
  // How far two images are apart in the order of capture of all drives.
  int64_t PositionGap(int index1, int index2) const {
    return std::abs(capture_positions.empty()
                        ? CaptureRank(index1) - CaptureRank(index2)
                        : capture_positions[index1] -
                              capture_positions[index2]);
  }
  // Of a pair: how far its images are apart in the order of capture.
  int64_t CaptureGap(const ViewGraphEdge& edge) const {
    return std::abs(CaptureRank(IndexOf(edge.image_id2)) -
                    CaptureRank(IndexOf(edge.image_id1)));
  }
  // Throws std::invalid_argument unless both lists are sorted without
  // duplicates, all edges join two of the images, all kept values are finite,
  // and ranks are none or one per image.
  void Check() const;
};

// The images joined by kept edges (all kinds), largest component first, equal
// sizes by smallest id; images sorted. Images without edges are components of
// their own.
std::vector<std::vector<image_t>> FindConnectedComponents(
    const ViewGraph& graph);

// The images and the edges with both ends among them; sorted image ids.
ViewGraph ExtractSubgraph(const ViewGraph& graph,
                          const std::vector<image_t>& images);

// How many edges were removed, by reason.
std::map<EdgeRemoval, int> CountRemovals(const ViewGraph& graph);

// The index of the pair's edge, kept or not; -1 where there is none. Edges are
// in order of their pairs.
int FindEdge(const ViewGraph& graph, const ImagePair& pair);

}  // namespace adasfm
