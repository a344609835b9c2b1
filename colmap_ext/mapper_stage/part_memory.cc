// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/part_memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <set>
#include <string>

#include "colmap_ext/scene/pairs_among.h"

namespace adasfm {
namespace {

// Measured on drives of 500 to 4,000 images (docs/reference/mapper.md), rounded
// up.
constexpr double kBytesPerPart = 10e6;
constexpr double kBytesPerKeypoint = 600.0;
constexpr double kBytesPerMatch = 60.0;

}  // namespace

double EstimatePartMemoryBytes(const SceneData& data,
                               const std::vector<image_t>& part) {
  const std::set<image_t> images(part.begin(), part.end());
  double bytes = kBytesPerPart;
  for (const image_t image_id : images) {
    const auto image = data.images.find(image_id);
    if (image == data.images.end()) continue;
    bytes += kBytesPerKeypoint * image->second.keypoints.size();
  }
  for (const ScenePair* pair : FindPairsAmong(data, images)) {
    bytes += kBytesPerMatch * pair->inlier_matches.size();
  }
  return bytes;
}

double AvailableMemoryBytes() {
  std::ifstream file("/proc/meminfo");
  std::string line;
  while (std::getline(file, line)) {
    if (line.rfind("MemAvailable:", 0) != 0) continue;
    return 1024.0 * std::stod(line.substr(std::string("MemAvailable:").size()));
  }
  return 1.0 * sysconf(_SC_AVPHYS_PAGES) * sysconf(_SC_PAGESIZE);
}

int CountPartsThatFit(const std::vector<double>& part_memory_bytes,
                      double memory_bytes) {
  std::vector<double> biggest_first = part_memory_bytes;
  std::sort(biggest_first.begin(), biggest_first.end(), std::greater<>());
  int count = 0;
  double sum = 0.0;
  for (const double bytes : biggest_first) {
    sum += bytes;
    if (sum > memory_bytes) break;
    ++count;
  }
  return std::max(1, count);
}

}  // namespace adasfm
