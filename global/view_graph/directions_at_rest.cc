// SPDX-License-Identifier: BSD-3-Clause
#include "global/view_graph/directions_at_rest.h"

#include <set>
#include <vector>

namespace adasfm {
namespace {

// Fewer witnesses may err together.
constexpr int kMinNumWitnesses = 2;

// By image, the images of its pairs without a baseline and with one.
struct Neighbors {
  std::set<int> at_rest;
  std::set<int> moving;
};

// Images without a baseline to i: how many have none to j, less those that have
// one.
int CountWitnesses(const std::vector<Neighbors>& neighbors, int i, int j) {
  int count = 0;
  for (const int witness : neighbors[i].at_rest) {
    count += neighbors[j].at_rest.count(witness);
    count -= neighbors[j].moving.count(witness);
  }
  return count;
}

}  // namespace

int DropDirectionsAtRest(ViewGraph* graph) {
  std::vector<Neighbors> neighbors(graph->images.size());
  std::vector<ViewGraphEdge*> moving;
  for (ViewGraphEdge& edge : graph->edges) {
    if (!edge.IsKept() || edge.source != EdgeSource::kVisual) continue;
    const int i = graph->IndexOf(edge.image_id1);
    const int j = graph->IndexOf(edge.image_id2);
    const auto list =
        edge.has_baseline ? &Neighbors::moving : &Neighbors::at_rest;
    (neighbors[i].*list).insert(j);
    (neighbors[j].*list).insert(i);
    if (edge.has_baseline) moving.push_back(&edge);
  }
  int num_dropped = 0;
  // A pair whose direction goes is a witness for others.
  for (bool has_changed = true; has_changed;) {
    has_changed = false;
    for (ViewGraphEdge* edge : moving) {
      const int i = graph->IndexOf(edge->image_id1);
      const int j = graph->IndexOf(edge->image_id2);
      if (!edge->has_baseline ||
          CountWitnesses(neighbors, i, j) < kMinNumWitnesses ||
          CountWitnesses(neighbors, j, i) < kMinNumWitnesses) {
        continue;
      }
      edge->has_baseline = edge->has_translation = false;
      neighbors[i].moving.erase(j);
      neighbors[j].moving.erase(i);
      neighbors[i].at_rest.insert(j);
      neighbors[j].at_rest.insert(i);
      has_changed = true;
      ++num_dropped;
    }
  }
  return num_dropped;
}

}  // namespace adasfm
