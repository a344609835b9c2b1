// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/routes.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kBendLength = 18.0;  // m, along the path

int NumRouteNodes(const SyntheticWorldOptions& options) {
  const double length = options.spacing_m * options.num_images + 100.0;
  // Bends cut corners: a street is driven in a little less than its length.
  return static_cast<int>(std::ceil(length / (kBlockSize - 5.0))) + 3;
}

Route BuildStraightRoute(int num_nodes) {
  Route route;
  for (int i = 0; i < num_nodes; ++i) route.nodes.push_back({i, 0});
  return route;
}

// A random walk that never reverses, in a town so small that the walk must
// return to streets driven before. It prefers crossings that it has visited,
// follows its former way for one or two streets, and leaves it again.
class TownWalk {
 public:
  TownWalk(int num_nodes, Random* random)
      : num_nodes_(num_nodes),
        size_(std::max(
            3, static_cast<int>(std::lround(std::sqrt(0.5 * num_nodes))))),
        random_(random) {}

  Route Build() {
    Route route;
    GridNode node = {0, 0};
    GridNode step = {0, 1};
    route.nodes.push_back(node);
    while (static_cast<int>(route.nodes.size()) < num_nodes_) {
      const GridNode next = {node[0] + step[0], node[1] + step[1]};
      const bool is_repeat = !driven_.insert({node, next}).second;
      num_repeats_ = is_repeat ? num_repeats_ + 1 : 0;
      visited_.insert(node);
      node = next;
      route.nodes.push_back(node);
      step = ChooseStep(node, step);
    }
    return route;
  }

 private:
  GridNode ChooseStep(const GridNode& node, const GridNode& step) {
    std::vector<GridNode> choices;
    for (const GridNode& choice :
         {step, GridNode{-step[1], step[0]}, GridNode{step[1], -step[0]}}) {
      const GridNode next = {node[0] + choice[0], node[1] + choice[1]};
      if (std::min(next[0], next[1]) < 0 ||
          std::max(next[0], next[1]) >= size_) {
        continue;
      }
      int weight = visited_.count(next) > 0 ? 3 : 1;
      if (driven_.count({node, next}) > 0) weight = num_repeats_ < 2 ? 10 : 1;
      choices.insert(choices.end(), weight, choice);
    }
    return choices[random_->UniformInt(0, choices.size() - 1)];
  }

  int num_nodes_;
  int size_;
  Random* random_;
  std::set<GridNode> visited_;
  std::set<std::pair<GridNode, GridNode>> driven_;
  int num_repeats_ = 0;
};

// Parallel streets, driven up and down alternately.
Route BuildParallelRoute(int num_nodes, int num_blocks) {
  Route route;
  for (int column = 0; static_cast<int>(route.nodes.size()) < num_nodes;
       ++column) {
    for (int k = 0; k <= num_blocks; ++k) {
      route.nodes.push_back({column, column % 2 == 0 ? k : num_blocks - k});
    }
  }
  return route;
}

Route BuildLoops(int num_nodes) {
  const GridNode corners[] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  Route route;
  for (int i = 0; i < num_nodes; ++i) route.nodes.push_back(corners[i % 4]);
  return route;
}

// How far before and behind a crossing a bend reaches.
double BendReach() {
  return kBendLength * UnitBendDisplacement(1.0, 0.5 * kPi).x();
}

Path BuildLanes(const SyntheticWorldOptions& options) {
  Path path(Eigen::Vector2d::Zero(), 0.0);
  for (int lane = 0; lane <= NumLanes(options); ++lane) {
    path.AddStraight(options.lane_length_m);
    path.AddBend(lane % 2 == 0 ? kPi : -kPi, UTurnLength(options));
  }
  path.AddStraight(options.lane_length_m);
  return path;
}

}  // namespace

Route BuildRoute(const SyntheticWorldOptions& options, Random* random) {
  const int num_nodes = NumRouteNodes(options);
  switch (options.trajectory) {
    case SyntheticTrajectory::kStraight:
      return BuildStraightRoute(num_nodes);
    case SyntheticTrajectory::kParallel:
      return BuildParallelRoute(num_nodes, options.street_num_blocks);
    case SyntheticTrajectory::kFloors:
      return BuildLoops(num_nodes);
    case SyntheticTrajectory::kLanes:
      return Route();
    case SyntheticTrajectory::kTown:
      break;
  }
  return TownWalk(num_nodes, random).Build();
}

Path BuildPath(const SyntheticWorldOptions& options, const Route& route) {
  if (IsOnLawn(options)) return BuildLanes(options);
  const double reach = BendReach();
  const auto node = [&route](size_t i) {
    return Eigen::Vector2d(kBlockSize * route.nodes[i][0],
                           kBlockSize * route.nodes[i][1]);
  };
  const Eigen::Vector2d first = node(1) - node(0);
  Path path(node(0), std::atan2(first.y(), first.x()));
  double to_next = kBlockSize;
  for (size_t i = 1; i + 1 < route.nodes.size(); ++i) {
    const Eigen::Vector2d in = (node(i) - node(i - 1)) / kBlockSize;
    const Eigen::Vector2d out = (node(i + 1) - node(i)) / kBlockSize;
    const double turn = std::round(in.x() * out.y() - in.y() * out.x());
    path.AddStraight(to_next - std::abs(turn) * reach);
    if (turn != 0.0) path.AddBend(0.5 * kPi * turn, kBendLength);
    to_next = kBlockSize - std::abs(turn) * reach;
  }
  return path;
}

bool IsOnLawn(const SyntheticWorldOptions& options) {
  return options.trajectory == SyntheticTrajectory::kLanes;
}

bool IsPeriodic(const SyntheticWorldOptions& options) {
  return options.trajectory == SyntheticTrajectory::kParallel ||
         options.trajectory == SyntheticTrajectory::kFloors;
}

int NumLanes(const SyntheticWorldOptions& options) {
  return 1 + static_cast<int>(options.spacing_m * options.num_images /
                              (options.lane_length_m + UTurnLength(options)));
}

double UTurnLength(const SyntheticWorldOptions& options) {
  return options.lane_spacing_m / UnitBendDisplacement(1.0, kPi).y();
}

double RoadSlope(const SyntheticWorldOptions& options) {
  if (options.trajectory != SyntheticTrajectory::kFloors) return 0.0;
  return options.floor_height_m /
         (4.0 * (kBlockSize - 2.0 * BendReach() + kBendLength));
}

}  // namespace adasfm
