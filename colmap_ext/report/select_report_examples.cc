// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdlib>
#include <tuple>

#include "colmap_ext/report/report_examples.h"

namespace adasfm {
namespace {

// Two pairs show about the same places if their first images, and their second
// images, are at most this far apart, as a share of all images.
constexpr double kSamePlaceShare = 0.05;

bool IsSame(const ReportPair& a, const ReportPair& b) {
  return a.index1 == b.index1 && a.index2 == b.index2;
}

bool IsNear(const ReportPair& a, const ReportPair& b, size_t num_images) {
  const auto distance = [](size_t i, size_t j) {
    return i < j ? j - i : i - j;
  };
  const double near = kSamePlaceShare * num_images;
  return distance(a.index1, b.index1) <= near &&
         distance(a.index2, b.index2) <= near;
}

// Adds the first of the ranked pairs that differs from all chosen ones.
bool ChooseNext(const std::vector<ReportPair>& ranked, size_t num_images,
                bool allow_near, std::vector<ReportPair>* chosen) {
  for (const ReportPair& pair : ranked) {
    const bool taken = std::any_of(
        chosen->begin(), chosen->end(), [&](const ReportPair& other) {
          return allow_near ? IsSame(pair, other)
                            : IsNear(pair, other, num_images);
        });
    if (taken) continue;
    chosen->push_back(pair);
    return true;
  }
  return false;
}

// Chooses from the rankings in turn.
std::vector<ReportPair> Choose(
    const std::vector<std::vector<ReportPair>>& rankings, size_t num_images,
    size_t max_num_pairs) {
  std::vector<ReportPair> chosen;
  for (const bool allow_near : {false, true}) {
    bool any = true;
    while (any && chosen.size() < max_num_pairs) {
      any = false;
      for (const std::vector<ReportPair>& ranked : rankings) {
        if (chosen.size() >= max_num_pairs) break;
        any = ChooseNext(ranked, num_images, allow_near, &chosen) || any;
      }
    }
  }
  return chosen;
}

template <typename Key>
std::vector<ReportPair> Rank(std::vector<ReportPair> pairs, const Key& key) {
  std::stable_sort(pairs.begin(), pairs.end(),
                   [&key](const ReportPair& a, const ReportPair& b) {
                     return std::make_tuple(key(a), a.index1, a.index2) <
                            std::make_tuple(key(b), b.index1, b.index2);
                   });
  return pairs;
}

}  // namespace

std::vector<ReportPair> SelectRemovedExamples(const ReportPairs& pairs,
                                              size_t num_images,
                                              size_t max_num_pairs) {
  std::vector<ReportPair> removed;
  for (const ReportPair& pair : pairs.pairs) {
    if (pair.num_before > 0 && pair.num_after == 0) removed.push_back(pair);
  }
  return Choose({Rank(std::move(removed),
                      [](const ReportPair& pair) { return -pair.num_before; })},
                num_images, max_num_pairs);
}

std::vector<ReportPair> SelectKeptExamples(const ReportPairs& pairs,
                                           size_t num_images,
                                           size_t max_num_pairs) {
  std::vector<ReportPair> kept;
  for (const ReportPair& pair : pairs.pairs) {
    if (pair.num_after > 0) kept.push_back(pair);
  }
  const auto far_first = [](const ReportPair& pair) {
    return -static_cast<int64_t>(pair.index2 - pair.index1);
  };
  const auto weak_first = [](const ReportPair& pair) { return pair.num_after; };
  return Choose({Rank(kept, far_first), Rank(kept, weak_first)}, num_images,
                max_num_pairs);
}

}  // namespace adasfm
