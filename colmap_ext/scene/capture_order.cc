// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/capture_order.h"

#include <algorithm>
#include <cctype>

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

}  // namespace adasfm
