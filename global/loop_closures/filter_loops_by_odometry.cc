// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/filter_loops_by_odometry.h"

#include <cstdlib>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "global/loop_closures/test_by_odometry.h"

namespace adasfm {
namespace {

// The tested pairs by where they stand in the chain, to find the neighbours of
// a pair: both ends within max_gap steps of its ends.
class PairGrid {
 public:
  PairGrid(const std::vector<OdometryTest>& tests, int max_gap)
      : tests_(tests), max_gap_(max_gap) {
    for (size_t e = 0; e < tests.size(); ++e) {
      if (tests[e].verdict != OdometryVerdict::kUntested) {
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
  std::pair<int, int> Cell(const OdometryTest& test) const {
    return {test.begin / (max_gap_ + 1), test.end / (max_gap_ + 1)};
  }
  bool IsNear(const OdometryTest& a, const OdometryTest& b) const {
    return std::abs(a.begin - b.begin) <= max_gap_ &&
           std::abs(a.end - b.end) <= max_gap_;
  }

  const std::vector<OdometryTest>& tests_;
  int max_gap_;
  std::map<std::pair<int, int>, std::vector<int>> cells_;
};

// Whether an open pair stands in a run that the chain excludes, or alone: where
// a drive truly comes back, many pairs see it.
bool IsInFalseRun(const LoopFilterOptions& options,
                  const std::vector<OdometryTest>& tests, const PairGrid& grid,
                  int e) {
  const std::vector<int> neighbours = grid.Neighbours(e);
  if (neighbours.empty()) {
    return tests[e].end - tests[e].begin > options.max_group_gap;
  }
  int num_contradicting = 0;
  int num_decided = 0;
  for (const int other : neighbours) {
    num_contradicting += tests[other].verdict == OdometryVerdict::kContradicts;
    num_decided += tests[other].verdict != OdometryVerdict::kOpen;
  }
  return num_contradicting > options.max_contradicting_ratio * num_decided;
}

// Runs of contradicting pairs.
int CountRuns(const std::vector<OdometryTest>& tests, const PairGrid& grid) {
  std::vector<bool> is_visited(tests.size(), false);
  int num_runs = 0;
  for (size_t first = 0; first < tests.size(); ++first) {
    if (is_visited[first] ||
        tests[first].verdict != OdometryVerdict::kContradicts) {
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
        if (tests[other].verdict != OdometryVerdict::kContradicts) continue;
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
  std::vector<OdometryTest> tests;
  for (size_t e = 0; e < graph->edges.size(); ++e) {
    tests.push_back(TestByOdometry(
        options, chain,
        lengths.metric ? lengths.lengths.at(e) : std::optional<EdgeLength>(),
        graph->edges[e]));
    report.num_tested += tests.back().verdict != OdometryVerdict::kUntested;
  }
  const PairGrid grid(tests, options.max_group_gap);
  report.num_false_runs = CountRuns(tests, grid);
  for (size_t e = 0; e < graph->edges.size(); ++e) {
    ViewGraphEdge& edge = graph->edges[e];
    if (tests[e].verdict == OdometryVerdict::kContradicts) {
      edge.removal = tests[e].rotation_sigmas > options.max_num_sigmas
                         ? EdgeRemoval::kOdometryRotation
                         : EdgeRemoval::kOdometryPosition;
      ++report.num_contradicting;
    } else if (tests[e].verdict == OdometryVerdict::kOpen &&
               IsInFalseRun(options, tests, grid, e)) {
      edge.removal = EdgeRemoval::kFalseLoop;
      ++report.num_in_false_runs;
    }
  }
  return report;
}

}  // namespace adasfm
