// SPDX-License-Identifier: BSD-3-Clause
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/database/merge_databases.h"
#include "core/strict_stream.h"

namespace adasfm {
namespace {

std::vector<std::string> SplitAtCommas(const std::string& text) {
  std::vector<std::string> items;
  std::istringstream stream(text);
  std::string item;
  while (std::getline(stream, item, ',')) items.push_back(item);
  if (!text.empty() && text.back() == ',') items.push_back("");
  return items;
}

StatusOr<std::vector<std::string>> ReadPathList(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    return Status::Error("cannot read " + path + "; check --input_list_path");
  }
  ThrowOnFailure(&file);
  std::vector<std::string> paths;
  std::string line;
  while (std::getline(file, line)) {
    if (!line.empty()) paths.push_back(line);
  }
  return paths;
}

StatusOr<std::vector<DatabaseToMerge>> FindInputs(
    const std::string& input_paths, const std::string& input_list_path,
    const std::string& prefixes) {
  if (input_paths.empty() == input_list_path.empty()) {
    return Status::Error("give either --input_paths or --input_list_path");
  }
  std::vector<std::string> paths = SplitAtCommas(input_paths);
  if (!input_list_path.empty()) {
    StatusOr<std::vector<std::string>> list = ReadPathList(input_list_path);
    if (!list.ok()) return list.status();
    paths = std::move(*list);
  }
  std::vector<std::string> texts = SplitAtCommas(prefixes);
  if (texts.empty()) texts.resize(paths.size());
  if (texts.size() != paths.size()) {
    return Status::Error("--prefixes has " + std::to_string(texts.size()) +
                         " entries for " + std::to_string(paths.size()) +
                         " databases");
  }
  std::vector<DatabaseToMerge> inputs;
  for (size_t i = 0; i < paths.size(); ++i) {
    inputs.push_back({paths[i], texts[i]});
  }
  return inputs;
}

}  // namespace

Status RunAdasfmDatabaseMerger(int argc, char** argv) {
  std::string input_paths;
  std::string input_list_path;
  std::string prefixes;
  std::string output_path;
  MergeDatabasesOptions options;
  CommandOptions command(
      "adasfm_database_merger",
      "Joins COLMAP databases: shards of one image list, or several sessions "
      "whose image names get different prefixes.");
  command.AddDefault("input_paths", &input_paths,
                     "the databases, separated by commas");
  command.AddDefault(
      "input_list_path", &input_list_path,
      "in place of --input_paths: text file with one path per line");
  command.AddRequired("output_path", &output_path,
                      "the joined database; an existing database is extended");
  command.AddDefault("prefixes", &prefixes,
                     "prefixes of the image names of each database, separated "
                     "by commas, e.g. monday/,tuesday/");
  command.AddDefault("share_cameras", &options.share_cameras,
                     "equal cameras of databases with the same prefix become "
                     "one");
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;
  const StatusOr<std::vector<DatabaseToMerge>> inputs =
      FindInputs(input_paths, input_list_path, prefixes);
  if (!inputs.ok()) return inputs.status();
  const StatusOr<MergedDatabase> merged =
      MergeDatabases(options, *inputs, output_path);
  if (!merged.ok()) return merged.status();
  std::cout << inputs->size() << " databases joined, " << merged->num_new_rows
            << " new rows: " << merged->num_cameras << " cameras, "
            << merged->num_images << " images, " << merged->num_keypoint_rows
            << " of them with keypoints, " << merged->num_match_rows
            << " matched and " << merged->num_verified_pairs
            << " verified pairs in " << output_path << std::endl;
  return Status::Ok();
}

}  // namespace adasfm
