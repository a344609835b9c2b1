// SPDX-License-Identifier: BSD-3-Clause
#include "global/filter_loops_by_odometry.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "core/so3.h"

namespace adasfm {
namespace {

enum class Verdict { kUntested, kAgrees, kOpen, kContradicts };

// How one pair stands to the chain. Discrepancies in sigmas; negative when they
// could not be tested.
struct Test {
  Verdict verdict = Verdict::kUntested;
  double rotation_sigmas = -1.0;
  double position_sigmas = -1.0;
  // Indices in the chain, the smaller first.
  int begin = 0;
  int end = 0;
};

double TestRotation(const LoopFilterOptions& options, const ChainMotion& motion,
                    const ViewGraphEdge& edge) {
  const Eigen::Vector3d error =
      LogSo3(edge.cam2_from_cam1.rotation *
             motion.cam2_from_cam1.rotation.conjugate());
  const double sigma =
      DegToRad(options.min_rotation_error_deg) / options.max_num_sigmas +
      edge.rotation_sigma_rad;
  const Eigen::Matrix3d covariance =
      motion.covariance.topLeftCorner<3, 3>() +
      sigma * sigma * Eigen::Matrix3d::Identity();
  return std::sqrt(error.dot(covariance.ldlt().solve(error)));
}

// The pair's metric translation against the chain's, in camera 2's frame. The
// pair's own error: along its direction that of its length, across it that of
// its direction.
double TestPosition(const LoopFilterOptions& options, const ChainMotion& motion,
                    const EdgeLength& length, const ViewGraphEdge& edge) {
  const Eigen::Vector3d direction =
      edge.cam2_from_cam1.translation.normalized();
  const Eigen::Vector3d error =
      length.length * direction - motion.cam2_from_cam1.translation;
  const double floor_m = options.min_position_error_m / options.max_num_sigmas;
  const double along_m =
      length.length * (options.length_error_ratio / options.max_num_sigmas +
                       length.log_sigma) +
      floor_m;
  const double across_m =
      length.length *
          (DegToRad(options.min_direction_error_deg) / options.max_num_sigmas +
           edge.direction_sigma_rad) +
      floor_m;
  const Eigen::Matrix3d along = direction * direction.transpose();
  const Eigen::Matrix3d covariance =
      motion.covariance.bottomRightCorner<3, 3>() + along_m * along_m * along +
      across_m * across_m * (Eigen::Matrix3d::Identity() - along);
  return std::sqrt(error.dot(covariance.ldlt().solve(error)));
}

Verdict Judge(const LoopFilterOptions& options, const Test& test) {
  const double sigmas = std::max(test.rotation_sigmas, test.position_sigmas);
  if (sigmas > options.max_num_sigmas) return Verdict::kContradicts;
  // Without a position, look-alike places cannot be told from the same place.
  if (test.position_sigmas < 0.0) return Verdict::kOpen;
  return sigmas > 0.5 * options.max_num_sigmas ? Verdict::kOpen
                                               : Verdict::kAgrees;
}

Test TestEdge(const LoopFilterOptions& options, const OdometryChain& chain,
              const std::optional<EdgeLength>& length,
              const ViewGraphEdge& edge) {
  Test test;
  if (!edge.IsKept() || edge.source == EdgeSource::kSensor ||
      !edge.has_rotation ||
      !chain.IsConnected(edge.image_id1, edge.image_id2)) {
    return test;
  }
  const ChainMotion motion = chain.Motion(edge.image_id1, edge.image_id2);
  if (!motion.has_rotation) return test;
  std::tie(test.begin, test.end) =
      std::minmax(chain.Index(edge.image_id1), chain.Index(edge.image_id2));
  test.rotation_sigmas = TestRotation(options, motion, edge);
  if (motion.has_position && edge.has_translation && length.has_value()) {
    test.position_sigmas = TestPosition(options, motion, *length, edge);
  }
  test.verdict = Judge(options, test);
  return test;
}

// The tested pairs by where they stand in the chain, to find the neighbours of
// a pair: both ends within max_gap steps of its ends.
class PairGrid {
 public:
  PairGrid(const std::vector<Test>& tests, int max_gap)
      : tests_(tests), max_gap_(max_gap) {
    for (size_t e = 0; e < tests.size(); ++e) {
      if (tests[e].verdict != Verdict::kUntested) {
        cells_[Cell(tests[e])].push_back(e);
      }
    }
  }

  std::vector<int> Neighbours(int e) const {
    std::vector<int> neighbours;
    const auto [row, col] = Cell(tests_[e]);
    for (int r = row - 1; r <= row + 1; ++r) {
      for (int c = col - 1; c <= col + 1; ++c) {
        const auto it = cells_.find({r, c});
        if (it == cells_.end()) continue;
        for (const int other : it->second) {
          if (other != e && IsNear(tests_[other], tests_[e])) {
            neighbours.push_back(other);
          }
        }
      }
    }
    return neighbours;
  }

 private:
  std::pair<int, int> Cell(const Test& test) const {
    return {test.begin / (max_gap_ + 1), test.end / (max_gap_ + 1)};
  }
  bool IsNear(const Test& a, const Test& b) const {
    return std::abs(a.begin - b.begin) <= max_gap_ &&
           std::abs(a.end - b.end) <= max_gap_;
  }

  const std::vector<Test>& tests_;
  int max_gap_;
  std::map<std::pair<int, int>, std::vector<int>> cells_;
};

// Whether an open pair stands in a run that the chain excludes, or alone: where
// a drive truly comes back, many pairs see it.
bool IsInFalseRun(const LoopFilterOptions& options,
                  const std::vector<Test>& tests, const PairGrid& grid, int e) {
  const std::vector<int> neighbours = grid.Neighbours(e);
  if (neighbours.empty()) {
    return tests[e].end - tests[e].begin > options.max_group_gap;
  }
  int num_contradicting = 0;
  int num_decided = 0;
  for (const int other : neighbours) {
    num_contradicting += tests[other].verdict == Verdict::kContradicts;
    num_decided += tests[other].verdict != Verdict::kOpen;
  }
  return num_contradicting > options.max_contradicting_ratio * num_decided;
}

// Runs of contradicting pairs.
int CountRuns(const std::vector<Test>& tests, const PairGrid& grid) {
  std::vector<bool> is_visited(tests.size(), false);
  int num_runs = 0;
  for (size_t first = 0; first < tests.size(); ++first) {
    if (is_visited[first] || tests[first].verdict != Verdict::kContradicts) {
      continue;
    }
    ++num_runs;
    std::vector<int> stack = {static_cast<int>(first)};
    is_visited[first] = true;
    while (!stack.empty()) {
      const int e = stack.back();
      stack.pop_back();
      for (const int other : grid.Neighbours(e)) {
        if (is_visited[other]) continue;
        if (tests[other].verdict != Verdict::kContradicts) continue;
        is_visited[other] = true;
        stack.push_back(other);
      }
    }
  }
  return num_runs;
}

}  // namespace

bool LoopFilterOptions::IsValid(std::string* error) const {
  if (!(max_num_sigmas > 0.0)) {
    *error =
        "max_num_sigmas = " + std::to_string(max_num_sigmas) + " must be > 0";
    return false;
  }
  if (!(min_rotation_error_deg >= 0.0) || !(min_direction_error_deg >= 0.0) ||
      !(length_error_ratio >= 0.0) || !(min_position_error_m > 0.0)) {
    *error =
        "min_rotation_error_deg, min_direction_error_deg and "
        "length_error_ratio must be >= 0, min_position_error_m = " +
        std::to_string(min_position_error_m) + " > 0";
    return false;
  }
  if (max_group_gap < 0 ||
      !(max_contradicting_ratio >= 0.0 && max_contradicting_ratio <= 1.0)) {
    *error = "max_group_gap = " + std::to_string(max_group_gap) +
             " must be >= 0, max_contradicting_ratio = " +
             std::to_string(max_contradicting_ratio) + " in [0, 1]";
    return false;
  }
  return true;
}

LoopFilterReport FilterLoopsByOdometry(const LoopFilterOptions& options,
                                       const OdometryChain& chain,
                                       const EdgeLengths& lengths,
                                       ViewGraph* graph) {
  LoopFilterReport report;
  std::vector<Test> tests;
  for (size_t e = 0; e < graph->edges.size(); ++e) {
    tests.push_back(TestEdge(
        options, chain,
        lengths.metric ? lengths.lengths.at(e) : std::optional<EdgeLength>(),
        graph->edges[e]));
    report.num_tested += tests.back().verdict != Verdict::kUntested;
  }
  const PairGrid grid(tests, options.max_group_gap);
  report.num_false_runs = CountRuns(tests, grid);
  for (size_t e = 0; e < graph->edges.size(); ++e) {
    ViewGraphEdge& edge = graph->edges[e];
    if (tests[e].verdict == Verdict::kContradicts) {
      edge.removal = tests[e].rotation_sigmas > options.max_num_sigmas
                         ? EdgeRemoval::kOdometryRotation
                         : EdgeRemoval::kOdometryPosition;
      ++report.num_contradicting;
    } else if (tests[e].verdict == Verdict::kOpen &&
               IsInFalseRun(options, tests, grid, e)) {
      edge.removal = EdgeRemoval::kFalseLoop;
      ++report.num_in_false_runs;
    }
  }
  return report;
}

}  // namespace adasfm
