// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report/report_pairs.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <numeric>

#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/report/report_html.h"
#include "core/strict_stream.h"

namespace adasfm {
namespace {

constexpr int kMinNumInliers = 15;
constexpr double kRatioBinWidth = 0.04;
constexpr int kNumRatioBins = 25;

struct PairCounts {
  int64_t before = 0;
  int64_t after = 0;
  int64_t raw = 0;
};

std::map<ImagePair, PairCounts> CountAllMatches(SqliteConnection* database,
                                                bool* was_rewritten) {
  std::map<ImagePair, PairCounts> counts;
  CountMatches(database, "two_view_geometries", kMinNumInliers,
               [&counts](const ImagePair& pair, int64_t count) {
                 PairCounts& entry = counts[pair];
                 entry.before = entry.after = count;
               });
  *was_rewritten = database->HasTable(kTwoViewGeometryBackupTable);
  if (*was_rewritten) {
    std::map<ImagePair, int64_t> originals;
    CountMatches(database, kTwoViewGeometryBackupTable, kMinNumInliers,
                 [&originals](const ImagePair& pair, int64_t count) {
                   originals[pair] = count;
                 });
    for (const ImagePair& pair : FindKeptOriginals(database)) {
      const auto original = originals.find(pair);
      counts[pair].before = original == originals.end() ? 0 : original->second;
    }
  }
  CountMatches(database, "matches", 1,
               [&counts](const ImagePair& pair, int64_t count) {
                 const auto entry = counts.find(pair);
                 if (entry != counts.end()) entry->second.raw = count;
               });
  return counts;
}

uint16_t Clamp16(int64_t value) { return std::min<int64_t>(value, 65535); }

}  // namespace

void Histogram::Add(double value) {
  const int last = static_cast<int>(counts_.size()) - 1;
  const double bin = value / bin_width_;
  counts_[bin < last ? std::max(0, static_cast<int>(bin)) : last]++;
}

int64_t Histogram::Count() const {
  return std::accumulate(counts_.begin(), counts_.end(), int64_t{0});
}

nlohmann::json Histogram::ToJson() const {
  return {{"width", bin_width_}, {"counts", counts_}};
}

ReportPairs ReadReportPairs(const ReportScene& scene,
                            SqliteConnection* database) {
  ReportPairs report;
  Histogram ratios_before(kRatioBinWidth, kNumRatioBins);
  Histogram ratios_after(kRatioBinWidth, kNumRatioBins);
  bool has_raw = false;
  for (const auto& [pair, counts] :
       CountAllMatches(database, &report.was_rewritten)) {
    const auto index1 = scene.index_of_id.find(pair.image_id1);
    const auto index2 = scene.index_of_id.find(pair.image_id2);
    if (index1 == scene.index_of_id.end() ||
        index2 == scene.index_of_id.end() ||
        (counts.before == 0 && counts.after == 0)) {
      continue;
    }
    report.pairs.push_back({std::min(index1->second, index2->second),
                            std::max(index1->second, index2->second),
                            counts.before, counts.after, counts.raw});
    report.num_before += counts.before > 0;
    report.num_after += counts.after > 0;
    if (counts.raw == 0) continue;
    has_raw = true;
    const double num_raw = counts.raw;
    if (counts.before > 0) ratios_before.Add(counts.before / num_raw);
    if (counts.after > 0) ratios_after.Add(counts.after / num_raw);
  }
  if (has_raw) {
    report.inlier_ratios_before = ratios_before.ToJson();
    report.inlier_ratios_after = ratios_after.ToJson();
  }
  return report;
}

nlohmann::json PairsToJson(const ReportPairs& pairs, size_t num_images,
                           size_t max_size) {
  const size_t size = std::max<size_t>(1, std::min(num_images, max_size));
  const auto cell_of = [&](size_t index) { return index * size / num_images; };
  std::map<std::pair<size_t, size_t>, PairCounts> cells;
  for (const ReportPair& pair : pairs.pairs) {
    PairCounts& cell = cells[{cell_of(pair.index1), cell_of(pair.index2)}];
    cell.before = std::max(cell.before, pair.num_before);
    cell.after = std::max(cell.after, pair.num_after);
  }
  std::vector<uint16_t> indices, before, after;
  for (const auto& [cell, counts] : cells) {
    indices.push_back(cell.first);
    indices.push_back(cell.second);
    before.push_back(Clamp16(counts.before));
    after.push_back(Clamp16(counts.after));
  }
  return {{"size", size},
          {"images", PackUint16(indices)},
          {"before", PackUint16(before)},
          {"after", PackUint16(after)},
          {"num_before", pairs.num_before},
          {"num_after", pairs.num_after},
          {"was_rewritten", pairs.was_rewritten}};
}

RemovedPairs ReadRemovedPairs(const std::string& path,
                              const ReportScene& scene) {
  RemovedPairs removed;
  std::ifstream file(path);
  ThrowOnFailure(&file);
  std::string line;
  while (std::getline(file, line)) {
    line = line.substr(0, line.find('\t'));  // the reason follows the tab
    bool found = false;
    for (size_t space = line.find(' '); space != std::string::npos && !found;
         space = line.find(' ', space + 1)) {
      const auto index1 = scene.index_of_name.find(line.substr(0, space));
      const auto index2 = scene.index_of_name.find(line.substr(space + 1));
      found = index1 != scene.index_of_name.end() &&
              index2 != scene.index_of_name.end();
      if (found) removed.pairs.emplace_back(index1->second, index2->second);
    }
    if (!found) ++removed.num_unknown;
  }
  return removed;
}

}  // namespace adasfm
