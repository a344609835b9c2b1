// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/select_pairs.h"

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/pairs/nearest_rows.h"
#include "colmap_ext/scene/capture_order.h"
#include "colmap_ext/scene/image_finder.h"
#include "core/parallel.h"
#include "sensors/io/read_image_times.h"

namespace adasfm {
namespace {

StatusOr<std::map<image_t, timestamp_t>> TimesFromDatabase(
    const std::string& database_path) {
  const StatusOr<LoadedPriorTables> tables = ReadPriorTables(database_path);
  if (!tables.ok()) return tables.status();
  std::map<image_t, timestamp_t> times;
  for (const ImageTimeRow& row : tables->tables.image_times) {
    times[row.image_id] = row.timestamp_ns;
  }
  return times;
}

StatusOr<std::map<image_t, timestamp_t>> TimesFromFile(
    const std::string& path, const std::vector<DatabaseImage>& images,
    std::vector<std::string>* warnings) {
  const StatusOr<std::vector<ImageTime>> list = ReadImageTimes(path);
  if (!list.ok()) return list.status();
  ImageFinder finder;
  for (const DatabaseImage& image : images) {
    finder.Add(image.image_id, image.name);
  }
  std::map<image_t, timestamp_t> times;
  for (const ImageTime& time : *list) {
    const image_t image_id = finder.Find(time.name);
    if (image_id == kInvalidImageId) continue;
    if (!times.emplace(image_id, time.timestamp_ns).second) {
      return Status::Error(path + ": image " + time.name + " has two times");
    }
  }
  if (times.empty() && !images.empty()) {
    return Status::Error(path +
                         " has no image of the database (whose first one is " +
                         images.front().name + "); check --image_times_path");
  }
  if (times.size() < images.size()) {
    warnings->push_back(path + " has times of " + std::to_string(times.size()) +
                        " of the " + std::to_string(images.size()) +
                        " images: the order of the names is taken");
  }
  return times;
}

StatusOr<GlobalDescriptors> GetDescriptors(const PairSelectionOptions& options,
                                           const std::string& database_path,
                                           const ProgressCallback& progress) {
  if (!options.descriptors_path.empty()) {
    return ReadGlobalDescriptors(options.descriptors_path, database_path);
  }
  return ComputeGlobalDescriptors(
      database_path, options.num_threads,
      [&progress](const std::string& what, double share_done) {
        if (progress) progress(what, 0.7 * share_done);
      });
}

// Predictions of the odometry for all pairs except neighbours in time.
struct OdometryPairs {
  // Pairs with enough overlap, at most num_similar_images per image.
  std::set<ImagePair> chosen;
  // Whether the prediction is uncertain for other pairs.
  bool has_unsure = false;
};

OdometryPairs PredictPairs(const PairSelectionOptions& options,
                           const std::vector<image_t>& image_ids,
                           const std::set<ImagePair>& neighbors,
                           const OverlapPredictor& predictor) {
  const size_t num_images = image_ids.size();
  std::vector<std::vector<std::pair<double, image_t>>> partners(num_images);
  std::vector<char> has_unsure(num_images, false);
  ParallelFor(options.num_threads, num_images, [&](size_t i) {
    for (const image_t image_id : image_ids) {
      const ImagePair pair(image_ids[i], image_id);
      if (image_id == image_ids[i] || neighbors.count(pair) > 0) continue;
      const std::optional<double> overlap = predictor.Predict(pair);
      if (!overlap) {
        has_unsure[i] = true;
      } else if (*overlap >= options.odometry.min_overlap) {
        partners[i].emplace_back(-*overlap, image_id);
      }
    }
    std::sort(partners[i].begin(), partners[i].end());
    if (static_cast<int>(partners[i].size()) > options.num_similar_images) {
      partners[i].resize(options.num_similar_images);
    }
  });
  OdometryPairs pairs;
  for (size_t i = 0; i < num_images; ++i) {
    for (const auto& [order, image_id] : partners[i]) {
      pairs.chosen.insert(ImagePair(image_ids[i], image_id));
    }
    pairs.has_unsure |= has_unsure[i];
  }
  return pairs;
}

// Adds pairs of the most similar images among those that may_be_chosen allows.
Status AddSimilarPairs(
    const PairSelectionOptions& options, const std::string& database_path,
    const std::function<bool(const ImagePair&)>& may_be_chosen,
    const ProgressCallback& progress, std::set<ImagePair>* pairs,
    PairSelection* selection) {
  const StatusOr<GlobalDescriptors> descriptors =
      GetDescriptors(options, database_path, progress);
  if (!descriptors.ok()) return descriptors.status();
  selection->warnings.insert(selection->warnings.end(),
                             descriptors->warnings.begin(),
                             descriptors->warnings.end());
  const std::vector<image_t>& ids = descriptors->image_ids;
  const std::vector<std::vector<int>> nearest = FindNearestRows(
      descriptors->vectors, options.num_similar_images, options.num_threads,
      [&](int i, int k) { return may_be_chosen(ImagePair(ids[i], ids[k])); },
      [&progress](const std::string& what, double share_done) {
        if (progress) progress(what, 0.7 + 0.3 * share_done);
      });
  for (size_t i = 0; i < nearest.size(); ++i) {
    for (const int k : nearest[i]) {
      if (pairs->insert(ImagePair(ids[i], ids[k])).second) {
        ++selection->num_similar;
      }
    }
  }
  return Status::Ok();
}

// Adds pairs beyond the neighbours in time: by the odometry where it is
// certain, else by similarity.
Status AddDistantPairs(const PairSelectionOptions& options,
                       const std::string& database_path,
                       const std::vector<image_t>& image_ids,
                       const ProgressCallback& progress,
                       std::set<ImagePair>* pairs, PairSelection* selection) {
  const StatusOr<OverlapPredictor> predictor =
      OverlapPredictor::Read(options.odometry, database_path);
  if (!predictor.ok()) return predictor.status();
  // In a sequence the next images are the most similar ones and are already
  // chosen. They are excluded here, so that they do not displace revisited
  // places.
  const std::set<ImagePair> neighbors = *pairs;
  if (predictor->HasOdometry()) {
    const OdometryPairs predicted =
        PredictPairs(options, image_ids, neighbors, *predictor);
    pairs->insert(predicted.chosen.begin(), predicted.chosen.end());
    selection->num_predicted = predicted.chosen.size();
    if (!predicted.has_unsure) return Status::Ok();
  }
  if (!options.use_similarity) return Status::Ok();
  return AddSimilarPairs(
      options, database_path,
      [&](const ImagePair& pair) {
        return neighbors.count(pair) == 0 && !predictor->Predict(pair);
      },
      progress, pairs, selection);
}

}  // namespace

bool PairSelectionOptions::IsValid(std::string* error) const {
  const std::pair<const char*, int> counts[] = {
      {"num_temporal_neighbors", num_temporal_neighbors},
      {"num_similar_images", num_similar_images}};
  for (const auto& [name, value] : counts) {
    if (value >= 0) continue;
    *error = std::string("AdaSfmPairs.") + name + " = " +
             std::to_string(value) + " must not be negative";
    return false;
  }
  if (num_temporal_neighbors == 0 && num_similar_images == 0) {
    *error =
        "AdaSfmPairs.num_temporal_neighbors and .num_similar_images are both "
        "0; one of them must be positive";
    return false;
  }
  return odometry.IsValid(error);
}

StatusOr<std::vector<image_t>> OrderImages(const std::string& database_path,
                                           const std::string& image_times_path,
                                           bool* ordered_by_time,
                                           std::vector<std::string>* warnings) {
  std::vector<std::string> unread_warnings;
  if (warnings == nullptr) warnings = &unread_warnings;
  std::vector<DatabaseImage> images;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    images = ReadImages(&database);
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  const StatusOr<std::map<image_t, timestamp_t>> times_or =
      image_times_path.empty()
          ? TimesFromDatabase(database_path)
          : TimesFromFile(image_times_path, images, warnings);
  if (!times_or.ok()) return times_or.status();
  const std::map<image_t, timestamp_t>& times = *times_or;
  std::vector<CapturedImage> captured;
  for (const DatabaseImage& image : images) {
    const auto time = times.find(image.image_id);
    captured.push_back({image.image_id, image.name,
                        time == times.end()
                            ? std::nullopt
                            : std::optional<timestamp_t>(time->second)});
  }
  return OrderByCapture(std::move(captured), ordered_by_time);
}

StatusOr<PairSelection> SelectPairs(const PairSelectionOptions& options,
                                    const std::string& database_path,
                                    const ProgressCallback& progress) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  Status status = CheckDatabase(database_path);
  if (!status.ok()) return status;
  PairSelection selection;
  const StatusOr<std::vector<image_t>> order =
      OrderImages(database_path, options.image_times_path,
                  &selection.ordered_by_time, &selection.warnings);
  if (!order.ok()) return order.status();
  const int num_images = order->size();
  selection.num_images = num_images;
  std::set<ImagePair> pairs;
  for (int i = 0; i < num_images; ++i) {
    const int end =
        std::min(num_images - 1, i + options.num_temporal_neighbors);
    for (int k = i + 1; k <= end; ++k) {
      pairs.insert(ImagePair((*order)[i], (*order)[k]));
    }
  }
  selection.num_temporal = pairs.size();
  if (options.num_similar_images > 0) {
    status = AddDistantPairs(options, database_path, *order, progress, &pairs,
                             &selection);
    if (!status.ok()) return status;
  }
  selection.pairs.assign(pairs.begin(), pairs.end());
  return selection;
}

StatusOr<std::string> FormatPairList(const std::vector<ImagePair>& pairs,
                                     const std::string& database_path) {
  std::map<image_t, std::string> names;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    for (const DatabaseImage& image : ReadImages(&database)) {
      if (image.name.find_first_of(" \t\n") != std::string::npos) {
        return Status::Error("the image name '" + image.name +
                             "' has a space, which COLMAP's pair lists cannot "
                             "hold; rename the file");
      }
      names[image.image_id] = image.name;
    }
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  std::string text;
  for (const ImagePair& pair : pairs) {
    text += names.at(pair.image_id1) + " " + names.at(pair.image_id2) + "\n";
  }
  return text;
}

}  // namespace adasfm
