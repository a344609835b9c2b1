// SPDX-License-Identifier: BSD-3-Clause
#include "global/loop_closures/drive_parts.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "core/disjoint_sets.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// A motion between two images; those of sensors first, then by distance.
struct Link {
  int rank = 0;
  int i = 0;
  int j = 0;
  Rigid3d j_from_i;
};

bool HasPosition(const RelativePosePrior& prior) {
  return prior.HasRotation() && prior.HasDirection() && prior.HasLength();
}

// Joins the parts on its way.
std::vector<Link> CollectLinks(
    const ViewGraph& graph, const std::vector<RelativePosePrior>& priors,
    const std::vector<std::optional<EdgeLength>>& lengths, int max_gap,
    DisjointSets* parts) {
  std::vector<Link> links;
  for (const RelativePosePrior& prior : priors) {
    const int i = graph.IndexOf(prior.image_id1);
    const int j = graph.IndexOf(prior.image_id2);
    if (i < 0 || j < 0 || !HasPosition(prior)) continue;
    parts->Join(i, j);
    links.push_back({0, i, j, prior.cam2_from_cam1});
  }
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewGraphEdge& edge = graph.edges[e];
    const int gap = static_cast<int>(
        std::min<int64_t>(graph.CaptureGap(edge), int64_t{max_gap} + 1));
    if (!edge.IsKept() || edge.source == EdgeSource::kSensor || gap > max_gap) {
      continue;
    }
    Link link{gap, graph.IndexOf(edge.image_id1), graph.IndexOf(edge.image_id2),
              edge.cam2_from_cam1};
    parts->Join(link.i, link.j);
    if (!edge.has_rotation || !edge.has_translation || e >= lengths.size() ||
        !lengths[e].has_value()) {
      continue;
    }
    link.j_from_i.translation =
        lengths[e]->length * edge.cam2_from_cam1.translation.normalized();
    links.push_back(link);
  }
  std::stable_sort(
      links.begin(), links.end(), [](const auto& a, const auto& b) {
        return std::tie(a.rank, a.i, a.j) < std::tie(b.rank, b.i, b.j);
      });
  return links;
}

// Poses along the tree of the best links, from the first image of each tree.
void PlaceImages(const std::vector<Link>& links, DriveParts* parts) {
  const int size = parts->part_of.size();
  DisjointSets trees(size);
  std::vector<std::vector<std::pair<int, Rigid3d>>> neighbours(size);
  for (const Link& link : links) {
    if (trees.Find(link.i) == trees.Find(link.j)) continue;
    trees.Join(link.i, link.j);
    neighbours[link.i].emplace_back(link.j, link.j_from_i);
    neighbours[link.j].emplace_back(link.i, link.j_from_i.Inverse());
  }
  parts->frame_of.assign(size, -1);
  parts->cams_from_part.resize(size);
  for (int root = 0; root < size; ++root) {
    if (parts->frame_of[root] >= 0 || neighbours[root].empty()) continue;
    std::vector<int> stack = {root};
    parts->frame_of[root] = root;
    while (!stack.empty()) {
      const int i = stack.back();
      stack.pop_back();
      for (const auto& [j, j_from_i] : neighbours[i]) {
        if (parts->frame_of[j] >= 0) continue;
        parts->frame_of[j] = root;
        parts->cams_from_part[j] = j_from_i * parts->cams_from_part[i];
        stack.push_back(j);
      }
    }
  }
}

void MeasureWays(double min_turn_deg, DriveParts* parts) {
  struct Last {
    int image = 0;
    Eigen::Quaterniond street = Eigen::Quaterniond::Identity();
  };
  const int size = parts->part_of.size();
  parts->way.assign(size, 0.0);
  parts->street_of.assign(size, 0);
  std::vector<int> order(size);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [parts](int a, int b) {
    return parts->rank_of[a] < parts->rank_of[b];
  });
  std::map<int, Last> last_of;  // by frame
  for (const int i : order) {
    if (parts->frame_of[i] < 0) continue;
    const Rigid3d& pose = parts->cams_from_part[i];
    const auto [it, is_first] =
        last_of.try_emplace(parts->frame_of[i], Last{i, pose.rotation});
    if (is_first) continue;
    Last& last = it->second;
    parts->way[i] = parts->way[last.image] +
                    (parts->cams_from_part[last.image].TargetOriginInSource() -
                     pose.TargetOriginInSource())
                        .norm();
    parts->street_of[i] = parts->street_of[last.image];
    if (pose.rotation.angularDistance(last.street) > DegToRad(min_turn_deg)) {
      ++parts->street_of[i];
      last.street = pose.rotation;
    }
    last.image = i;
  }
}

}  // namespace

DriveParts FindDriveParts(const ViewGraph& graph,
                          const std::vector<RelativePosePrior>& priors,
                          const std::vector<std::optional<EdgeLength>>& lengths,
                          int max_gap, double min_turn_deg) {
  const int size = graph.images.size();
  DisjointSets sets(size);
  const std::vector<Link> links =
      CollectLinks(graph, priors, lengths, max_gap, &sets);
  DriveParts parts;
  parts.num_images.assign(size, 0);
  parts.is_metric.assign(size, false);
  for (int i = 0; i < size; ++i) {
    parts.part_of.push_back(sets.Find(i));
    parts.rank_of.push_back(graph.CaptureRank(i));
    ++parts.num_images[parts.part_of[i]];
  }
  for (const Link& link : links) {
    if (link.rank == 0) parts.is_metric[parts.part_of[link.i]] = true;
  }
  PlaceImages(links, &parts);
  MeasureWays(min_turn_deg, &parts);
  return parts;
}

}  // namespace adasfm
