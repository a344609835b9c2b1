// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/nearest_rows.h"

#include <algorithm>
#include <flann/flann.hpp>

#include "core/parallel.h"

namespace adasfm {
namespace {

// Rows that are searched for at a time.
constexpr int kSearchBlockSize = 256;

}  // namespace

std::vector<std::vector<int>> FindNearestRows(
    const RowMatrixXf& vectors, int num_neighbors, int num_threads,
    const ProgressCallback& progress) {
  const int num_rows = vectors.rows();
  std::vector<std::vector<int>> nearest(num_rows);
  // One more than asked for: the row itself is among them.
  const int num_found = std::min(num_neighbors + 1, num_rows);
  if (num_neighbors < 1 || num_rows < 2 || vectors.cols() == 0) return nearest;
  float* data = const_cast<float*>(vectors.data());
  flann::Index<flann::L2<float>> index(
      flann::Matrix<float>(data, num_rows, vectors.cols()),
      flann::LinearIndexParams());
  index.buildIndex();
  flann::SearchParams search(flann::FLANN_CHECKS_UNLIMITED);
  search.cores = EffectiveNumThreads(num_threads);
  std::vector<int> rows(kSearchBlockSize * num_found);
  std::vector<float> distances(rows.size());
  for (int begin = 0; begin < num_rows; begin += kSearchBlockSize) {
    const int count = std::min(kSearchBlockSize, num_rows - begin);
    const flann::Matrix<float> queries(data + begin * vectors.cols(), count,
                                       vectors.cols());
    flann::Matrix<int> found(rows.data(), count, num_found);
    flann::Matrix<float> found_distances(distances.data(), count, num_found);
    index.knnSearch(queries, found, found_distances, num_found, search);
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < num_found; ++k) {
        const int row = found[i][k];
        if (row != begin + i) nearest[begin + i].push_back(row);
      }
      if (static_cast<int>(nearest[begin + i].size()) > num_neighbors) {
        nearest[begin + i].pop_back();
      }
    }
    if (!progress) continue;
    progress("searching similar images",
             static_cast<double>(begin + count) / num_rows);
  }
  return nearest;
}

}  // namespace adasfm
