// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/capture_order.h"

#include <algorithm>
#include <cctype>

#include "global/view_graph/view_graph.h"

namespace adasfm {
namespace {

bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)); }

// The end of the number that begins at `begin`; *first skips leading zeros.
size_t SkipNumber(const std::string& text, size_t begin, size_t* first) {
  *first = begin;
  while (*first < text.size() && text[*first] == '0') ++*first;
  size_t end = *first;
  while (end < text.size() && IsDigit(text[end])) ++end;
  return end;
}

// Runs of digits are compared as numbers, everything else byte by byte.
bool NaturallyLess(const std::string& a, const std::string& b) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!IsDigit(a[i]) || !IsDigit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    size_t first_i = 0, first_j = 0;
    const size_t end_i = SkipNumber(a, i, &first_i);
    const size_t end_j = SkipNumber(b, j, &first_j);
    if (end_i - first_i != end_j - first_j) {
      return end_i - first_i < end_j - first_j;
    }
    const int order =
        a.compare(first_i, end_i - first_i, b, first_j, end_j - first_j);
    if (order != 0) return order < 0;
    i = end_i, j = end_j;
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

}  // namespace

std::vector<image_t> OrderByCapture(std::vector<CapturedImage> images,
                                    bool* by_time) {
  const bool has_times =
      !images.empty() &&
      std::all_of(images.begin(), images.end(), [](const CapturedImage& image) {
        return image.timestamp_ns.has_value();
      });
  if (by_time != nullptr) *by_time = has_times;
  std::stable_sort(images.begin(), images.end(),
                   [has_times](const CapturedImage& a, const CapturedImage& b) {
                     return has_times ? *a.timestamp_ns < *b.timestamp_ns
                                      : NaturallyLess(a.name, b.name);
                   });
  std::vector<image_t> image_ids;
  for (const CapturedImage& image : images) image_ids.push_back(image.image_id);
  return image_ids;
}

std::map<image_t, CaptureRank> RankByCapture(
    const std::vector<CapturedImage>& images) {
  std::map<image_t, int> drive_of;
  for (const CapturedImage& image : images) {
    drive_of[image.image_id] = image.drive;
  }
  const std::vector<image_t> image_ids = OrderByCapture(images);
  std::map<int, size_t> last_of;
  for (size_t k = 0; k < image_ids.size(); ++k) {
    last_of[drive_of[image_ids[k]]] = k;
  }
  // Drives of one lane do not overlap. Images without a drive are in the first.
  struct Lane {
    size_t end = 0;
    int64_t num_images = 0;
  };
  std::vector<Lane> lanes(1);
  std::map<int, size_t> lane_of = {{-1, 0}};
  std::map<image_t, CaptureRank> ranks;
  for (size_t k = 0; k < image_ids.size(); ++k) {
    const int drive = drive_of[image_ids[k]];
    const auto [found, is_new] = lane_of.emplace(drive, lanes.size());
    if (is_new) {
      const auto lane =
          std::find_if(lanes.begin(), lanes.end(),
                       [k](const Lane& lane) { return lane.end <= k; });
      found->second = lane - lanes.begin();
      if (lane == lanes.end()) lanes.emplace_back();
      lanes[found->second].end = last_of[drive] + 1;
    }
    CaptureRank& rank = ranks[image_ids[k]];
    rank.rank =
        found->second * kRankGapOfDrives + lanes[found->second].num_images++;
    rank.position = k;
  }
  return ranks;
}

}  // namespace adasfm
