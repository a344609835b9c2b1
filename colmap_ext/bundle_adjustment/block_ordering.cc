// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/block_ordering.h"

#include <Eigen/CholmodSupport>
#include <Eigen/SparseCore>
#include <algorithm>
#include <new>

namespace adasfm {
namespace {

// CHOLMOD's own nested dissection takes longer than both other methods, and
// saves a twentieth of the factor of 30,000 images, an eighth of that of 4,000.
constexpr int kMinNumBlocksToDissect = 2000;

class BlockAnalysis
    : public Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> {
 public:
  // pattern: the lower triangle; its values are not used.
  explicit BlockAnalysis(const Eigen::SparseMatrix<double>& pattern) {
    cholmod().print = 0;
    cholmod().nmethods = pattern.rows() < kMinNumBlocksToDissect ? 2 : 3;
    cholmod().method[0].ordering = CHOLMOD_AMD;
    cholmod().method[1].ordering = CHOLMOD_METIS;
    cholmod().method[2].ordering = CHOLMOD_NESDIS;
    analyzePattern(pattern);
    if (m_cholmodFactor == nullptr) throw std::bad_alloc();
  }
  const int* Order() const {
    return static_cast<const int*>(m_cholmodFactor->Perm);
  }
  // Including the diagonal.
  double NumFactorBlocks() { return cholmod().lnz; }
};

Eigen::SparseMatrix<double> BuildPattern(
    const std::vector<std::vector<int>>& neighbors) {
  const int size = static_cast<int>(neighbors.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (int node = 0; node < size; ++node) {
    entries.emplace_back(node, node, 1.0);
    for (const int neighbor : neighbors[node]) {
      entries.emplace_back(std::max(node, neighbor), std::min(node, neighbor),
                           1.0);
    }
  }
  Eigen::SparseMatrix<double> pattern(size, size);
  pattern.setFromTriplets(entries.begin(), entries.end());
  return pattern;
}

}  // namespace

BlockOrdering FindBlockOrdering(
    const std::vector<std::vector<int>>& neighbors) {
  BlockOrdering ordering;
  if (neighbors.empty()) return ordering;
  BlockAnalysis analysis(BuildPattern(neighbors));
  ordering.block_of_number.assign(analysis.Order(),
                                  analysis.Order() + neighbors.size());
  ordering.num_factor_blocks =
      static_cast<size_t>(analysis.NumFactorBlocks()) - neighbors.size();
  return ordering;
}

}  // namespace adasfm
