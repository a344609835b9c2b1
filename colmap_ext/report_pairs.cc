// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report_pairs.h"

#include <algorithm>
#include <fstream>
#include <map>

#include "colmap_ext/host/database.h"
#include "colmap_ext/report_html.h"
#include "colmap_ext/two_view_geometry_backup.h"

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

std::map<ImagePair, PairCounts> CountMatches(SqliteConnection* database,
                                             bool* was_rewritten) {
  std::map<ImagePair, PairCounts> counts;
  for (const DatabaseTwoViewGeometry& row :
       ReadTwoViewGeometries(database, "two_view_geometries", kMinNumInliers)) {
    PairCounts& pair = counts[row.pair];
    pair.before = pair.after = row.inlier_matches.size();
  }
  *was_rewritten = database->HasTable(kTwoViewGeometryBackupTable);
  if (*was_rewritten) {
    std::map<ImagePair, int64_t> originals;
    for (const DatabaseTwoViewGeometry& row :
         ReadTwoViewGeometries(database, kTwoViewGeometryBackupTable, 0)) {
      originals[row.pair] = row.inlier_matches.size();
    }
    for (const ImagePair& pair : FindKeptOriginals(database)) {
      const int64_t before = originals[pair];
      counts[pair].before = before >= kMinNumInliers ? before : 0;
    }
  }
  ReadMatches(database, [&counts](const ImagePair& pair,
                                  const std::vector<FeatureMatch>& matches) {
    const auto entry = counts.find(pair);
    if (entry != counts.end()) entry->second.raw = matches.size();
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

nlohmann::json Histogram::ToJson() const {
  return {{"width", bin_width_}, {"counts", counts_}};
}

ReportPairs ReadReportPairs(const ReportScene& scene,
                            SqliteConnection* database) {
  ReportPairs report;
  std::vector<uint32_t> indices;
  std::vector<uint16_t> before, after;
  Histogram ratios_before(kRatioBinWidth, kNumRatioBins);
  Histogram ratios_after(kRatioBinWidth, kNumRatioBins);
  bool has_raw = false;
  for (const auto& [pair, counts] :
       CountMatches(database, &report.was_rewritten)) {
    const auto index1 = scene.index_of_id.find(pair.image_id1);
    const auto index2 = scene.index_of_id.find(pair.image_id2);
    if (index1 == scene.index_of_id.end() ||
        index2 == scene.index_of_id.end() ||
        (counts.before == 0 && counts.after == 0)) {
      continue;
    }
    indices.push_back(index1->second);
    indices.push_back(index2->second);
    before.push_back(Clamp16(counts.before));
    after.push_back(Clamp16(counts.after));
    report.num_before += counts.before > 0;
    report.num_after += counts.after > 0;
    if (counts.raw == 0) continue;
    has_raw = true;
    const double num_raw = counts.raw;
    if (counts.before > 0) ratios_before.Add(counts.before / num_raw);
    if (counts.after > 0) ratios_after.Add(counts.after / num_raw);
  }
  report.pairs = {{"images", PackUint32(indices)},
                  {"before", PackUint16(before)},
                  {"after", PackUint16(after)}};
  if (has_raw) {
    report.inlier_ratios_before = ratios_before.ToJson();
    report.inlier_ratios_after = ratios_after.ToJson();
  }
  return report;
}

RemovedPairs ReadRemovedPairs(const std::string& path,
                              const ReportScene& scene) {
  RemovedPairs removed;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
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
