// SPDX-License-Identifier: BSD-3-Clause
#include "global/view_graph/laplacian_solver.h"

#include <algorithm>
#include <cstddef>

namespace adasfm {

LaplacianSolver::LaplacianSolver(int num_nodes,
                                 std::vector<std::pair<int, int>> edges)
    : edges_(std::move(edges)), equations_(num_nodes, edges_) {}

bool LaplacianSolver::Solve(const std::vector<double>& weights,
                            const Vectors& differences, Vectors* nodes) {
  const double max_weight =
      weights.empty() ? 0.0 : *std::max_element(weights.begin(), weights.end());
  // The ridge is far below the weakest useful weight: long chains of weak
  // edges keep their shape.
  for (const double ridge : {0.0, 1e-13, 1e-10}) {
    equations_.Clear(ridge * max_weight);
    for (size_t e = 0; e < edges_.size(); ++e) {
      equations_.Add(edges_[e].first, edges_[e].second,
                     NodeEquations<1>::Weight(weights[e]),
                     differences.row(e).transpose());
    }
    if (equations_.Solve(1e-14, nodes)) return true;
  }
  return false;
}

}  // namespace adasfm
