// SPDX-License-Identifier: BSD-3-Clause
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>

#include "colmap_ext/host/database.h"
#include "colmap_ext/pairs/global_descriptors.h"
#include "core/strict_stream.h"

namespace adasfm {
namespace {

// "path, line 7: text".
Status LineError(const std::string& path, int line, const std::string& text) {
  return Status::Error(path + ", line " + std::to_string(line) + ": " + text);
}

// The vectors of a file by name, all of one length.
StatusOr<std::map<std::string, std::vector<float>>> ReadVectors(
    const std::string& path) {
  std::ifstream file(path);
  if (!file) return Status::Error("cannot read " + path + "; check the path");
  ThrowOnFailure(&file);
  std::map<std::string, std::vector<float>> vectors;
  size_t num_dimensions = 0;
  std::string text;
  for (int line = 1; std::getline(file, text); ++line) {
    std::istringstream words(text);
    ThrowOnFailure(&words);
    std::string name;
    if (!(words >> name) || name[0] == '#') continue;
    std::vector<float> vector;
    double squared_norm = 0.0;
    for (std::string word; words >> word;) {
      char* end = nullptr;
      const double value = std::strtod(word.c_str(), &end);
      if (*end != '\0' || !std::isfinite(value)) {
        return LineError(path, line, "'" + word + "' is not a number");
      }
      squared_norm += value * value;
      vector.push_back(value);
    }
    if (!(squared_norm > 0.0)) {
      return LineError(path, line, "the vector of " + name + " is zero");
    }
    if (num_dimensions == 0) num_dimensions = vector.size();
    if (vector.size() != num_dimensions) {
      return LineError(path, line,
                       "has " + std::to_string(vector.size()) +
                           " numbers, the lines before it " +
                           std::to_string(num_dimensions));
    }
    for (float& value : vector) value /= std::sqrt(squared_norm);
    if (!vectors.emplace(name, std::move(vector)).second) {
      return LineError(path, line, "image " + name + " has a vector already");
    }
  }
  if (vectors.empty()) {
    return Status::Error(path + " has no line `image_name v1 v2 ...`");
  }
  return vectors;
}

}  // namespace

StatusOr<GlobalDescriptors> ReadGlobalDescriptors(
    const std::string& path, const std::string& database_path) {
  const StatusOr<std::map<std::string, std::vector<float>>> vectors =
      ReadVectors(path);
  if (!vectors.ok()) return vectors.status();
  GlobalDescriptors result;
  std::vector<DatabaseImage> images;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    images = ReadImages(&database);
  } catch (const SqliteError& sqlite_error) {
    return Status::Error(database_path + ": " + sqlite_error.what());
  }
  result.vectors.resize(images.size(), vectors->begin()->second.size());
  for (const DatabaseImage& image : images) {
    const auto entry = vectors->find(image.name);
    if (entry == vectors->end()) continue;
    result.vectors.row(result.image_ids.size()) =
        Eigen::Map<const Eigen::RowVectorXf>(entry->second.data(),
                                             entry->second.size());
    result.image_ids.push_back(image.image_id);
  }
  const size_t num_known = result.image_ids.size();
  result.vectors.conservativeResize(num_known, Eigen::NoChange);
  if (num_known == 0) {
    return Status::Error(path + ": none of its " +
                         std::to_string(vectors->size()) +
                         " images is in the database (the first one is " +
                         vectors->begin()->first + ")");
  }
  if (num_known < vectors->size()) {
    result.warnings.push_back(path + ": " +
                              std::to_string(vectors->size() - num_known) +
                              " images are not in the database");
  }
  if (num_known < images.size()) {
    result.warnings.push_back(std::to_string(images.size() - num_known) +
                              " images of the database have no vector in " +
                              path);
  }
  return result;
}

}  // namespace adasfm
