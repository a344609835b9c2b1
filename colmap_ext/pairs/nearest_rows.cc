// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/nearest_rows.h"

#include <algorithm>
#include <utility>

#include "core/parallel.h"

namespace adasfm {
namespace {

// Number of rows searched between two reports of progress.
constexpr int kSearchBlockSize = 256;

std::vector<int> FindNearest(
    const RowMatrixXf& vectors, int row, int num_neighbors,
    const std::function<bool(int, int)>& may_be_chosen) {
  std::vector<std::pair<float, int>> others;
  others.reserve(vectors.rows());
  for (int other = 0; other < vectors.rows(); ++other) {
    if (other == row) continue;
    others.emplace_back((vectors.row(other) - vectors.row(row)).squaredNorm(),
                        other);
  }
  std::sort(others.begin(), others.end());
  std::vector<int> nearest;
  for (const auto& [distance, other] : others) {
    if (static_cast<int>(nearest.size()) >= num_neighbors) break;
    if (!may_be_chosen || may_be_chosen(row, other)) nearest.push_back(other);
  }
  return nearest;
}

}  // namespace

std::vector<std::vector<int>> FindNearestRows(
    const RowMatrixXf& vectors, int num_neighbors, int num_threads,
    const std::function<bool(int, int)>& may_be_chosen,
    const ProgressCallback& progress) {
  const int num_rows = vectors.rows();
  std::vector<std::vector<int>> nearest(num_rows);
  if (num_neighbors < 1 || vectors.cols() == 0) return nearest;
  for (int begin = 0; begin < num_rows; begin += kSearchBlockSize) {
    const int count = std::min(kSearchBlockSize, num_rows - begin);
    ParallelFor(num_threads, count, [&](size_t i) {
      nearest[begin + i] =
          FindNearest(vectors, begin + i, num_neighbors, may_be_chosen);
    });
    if (!progress) continue;
    progress("searching similar images",
             static_cast<double>(begin + count) / num_rows);
  }
  return nearest;
}

}  // namespace adasfm
