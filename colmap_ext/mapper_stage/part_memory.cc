// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/part_memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <limits>
#include <set>
#include <string>

#include "colmap_ext/scene/pairs_among.h"

namespace adasfm {
namespace {

// Measured on parts of 160 photos and of simulated images
// (docs/reference/mapper.md), rounded up.
constexpr double kBytesPerPart = 10e6;
constexpr double kBytesPerKeypoint = 250.0;
constexpr double kBytesPerMatch = 25.0;

double SystemMemoryBytes() {
  std::ifstream file("/proc/meminfo");
  std::string line;
  while (std::getline(file, line)) {
    if (line.rfind("MemAvailable:", 0) != 0) continue;
    return 1024.0 * std::stod(line.substr(std::string("MemAvailable:").size()));
  }
  return 1.0 * sysconf(_SC_AVPHYS_PAGES) * sysconf(_SC_PAGESIZE);
}

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

double MemoryLeftInGroup(const std::string& folder) {
  double limit = std::numeric_limits<double>::infinity();
  double used = 0.0;
  // Files of version 2 and of version 1; "max" is no number.
  for (const char* name : {"/memory.max", "/memory.limit_in_bytes"}) {
    std::ifstream(folder + name) >> limit;
    if (limit == 0.0) limit = std::numeric_limits<double>::infinity();
  }
  for (const char* name : {"/memory.current", "/memory.usage_in_bytes"}) {
    double value = 0.0;
    if (std::ifstream(folder + name) >> value) used = value;
  }
  std::ifstream statistics(folder + "/memory.stat");
  std::string key;
  double value = 0.0;
  while (statistics >> key >> value) {
    if (key == "inactive_file") used -= value;
  }
  return std::max(0.0, limit - std::max(0.0, used));
}

double AvailableMemoryBytes() {
  double available = SystemMemoryBytes();
  for (const char* folder : {"/sys/fs/cgroup", "/sys/fs/cgroup/memory"}) {
    available = std::min(available, MemoryLeftInGroup(folder));
  }
  rlimit limit;
  if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
    double num_pages = 0.0;
    std::ifstream("/proc/self/statm") >> num_pages;
    const double left = limit.rlim_cur - num_pages * sysconf(_SC_PAGESIZE);
    available = std::min(available, std::max(0.0, left));
  }
  return available;
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
