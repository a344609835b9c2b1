// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/host_features.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "colmap_ext/host/database.h"
#include "colmap_ext/host/host_program.h"

namespace adasfm {
namespace {

// Pairs that one run of the program matches: progress can be shown only between
// runs, and each start of the program takes a second.
constexpr size_t kNumPairsPerRun = 500;

// A file of lines for the program, removed in the end.
class ListFile {
 public:
  ListFile(const std::string& path, const std::vector<std::string>& lines)
      : path_(path) {
    std::ofstream file(path);
    for (const std::string& line : lines) file << line << '\n';
    is_written_ = static_cast<bool>(file.flush());
  }
  ~ListFile() {
    std::error_code none;
    std::filesystem::remove(path_, none);
  }
  ListFile(const ListFile&) = delete;
  ListFile& operator=(const ListFile&) = delete;

  Status Check() const {
    return is_written_ ? Status::Ok()
                       : Status::Error("cannot write " + path_ +
                                       "; check the free space");
  }

 private:
  std::string path_;
  bool is_written_ = false;
};

int CountLines(const std::string& path, std::streamoff begin,
               const std::string& word) {
  std::ifstream file(path);
  file.seekg(begin);
  int count = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.find(word) != std::string::npos) ++count;
  }
  return count;
}

// The options that both commands have, in the group new_group since COLMAP 3.13
// and in old_group before.
std::vector<std::string> CommonArguments(const FeatureOptions& options,
                                         const std::string& help,
                                         const std::string& old_group,
                                         const std::string& new_group,
                                         bool use_gpu) {
  const std::string group =
      help.find("--" + new_group + ".use_gpu") != std::string::npos ? new_group
                                                                    : old_group;
  return {"--" + group + ".use_gpu", use_gpu ? "1" : "0",
          "--" + group + ".num_threads", std::to_string(options.num_threads)};
}

bool UsesHostGpu(const FeatureOptions& options, const std::string& program) {
  if (options.use_gpu >= 0) return options.use_gpu == 1;
  return ReadHostHelp(program, "help").find("with CUDA") != std::string::npos;
}

int64_t Count(SqliteConnection* database, const std::string& from) {
  SqliteStatement statement(database, "SELECT count(*) FROM " + from);
  statement.Step();
  return statement.Int(0);
}

}  // namespace

bool UsesHostProgram() {
  const char* chosen = std::getenv("ADASFM_HOST_COLMAP");
  return chosen != nullptr && *chosen != '\0';
}

StatusOr<ImageRegistration> ReadRegistration(
    const std::vector<std::string>& names, const std::string& database_path) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    ImageRegistration result;
    std::set<std::string> registered;
    for (const DatabaseImage& image : ReadImages(&database)) {
      registered.insert(image.name);
    }
    for (const std::string& name : names) {
      if (registered.count(name) == 0) result.unreadable.push_back(name);
    }
    result.num_images = registered.size();
    result.num_cameras = Count(&database, "cameras");
    result.num_known_focal_lengths =
        Count(&database, "cameras WHERE prior_focal_length <> 0");
    return result;
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
}

Status ExtractFeaturesByHost(const FeatureOptions& options,
                             const std::string& image_path,
                             const std::string& database_path,
                             const std::string& log_path,
                             const ProgressCallback& progress) {
  std::vector<std::string> names;
  int num_images = 0;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    for (const DatabaseImage& image : ReadImagesWithoutFeatures(&database)) {
      names.push_back(image.name);
    }
    num_images = Count(&database, "images");
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  if (names.empty()) return Status::Ok();
  const std::string program = FindHostProgram();
  const ListFile list(log_path + ".images.txt", names);
  Status status = list.Check();
  if (!status.ok()) return status;
  const std::string help = ReadHostHelp(program, "feature_extractor -h");
  std::vector<std::string> arguments =
      CommonArguments(options, help, "SiftExtraction", "FeatureExtraction",
                      UsesHostGpu(options, program));
  const std::string& group = arguments[0];
  arguments.insert(
      arguments.begin(),
      {"feature_extractor", "--database_path", database_path, "--image_path",
       image_path, "--image_list_path", log_path + ".images.txt",
       group.substr(0, group.find('.')) + ".max_image_size",
       std::to_string(options.max_image_size),
       "--SiftExtraction.max_num_features",
       std::to_string(options.max_num_features),
       "--SiftExtraction.first_octave", std::to_string(options.first_octave)});
  std::error_code none;
  const bool has_log = std::filesystem::exists(log_path, none);
  const std::streamoff begin =
      has_log ? std::filesystem::file_size(log_path, none) : 0;
  const int num_done = num_images - static_cast<int>(names.size());
  return RunHost(program, arguments, log_path, [&] {
    const int count = std::min(
        num_images, num_done + CountLines(log_path, begin, "Processed file"));
    progress("features of image " + std::to_string(count) + " of " +
                 std::to_string(num_images),
             static_cast<double>(count) / num_images);
  });
}

Status MatchPairsByHost(const FeatureOptions& options,
                        const std::vector<ImagePair>& pairs,
                        const std::string& database_path,
                        const std::string& log_path,
                        const ProgressCallback& progress) {
  std::map<image_t, std::string> names;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    for (DatabaseImage& image : ReadImages(&database)) {
      names[image.image_id] = std::move(image.name);
    }
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  const std::string program = FindHostProgram();
  const std::string list_path = log_path + ".pairs.txt";
  std::vector<std::string> arguments = CommonArguments(
      options, ReadHostHelp(program, "matches_importer -h"), "SiftMatching",
      "FeatureMatching", UsesHostGpu(options, program));
  arguments.insert(arguments.begin(),
                   {"matches_importer", "--database_path", database_path,
                    "--match_list_path", list_path, "--match_type", "pairs"});
  for (size_t begin = 0; begin < pairs.size(); begin += kNumPairsPerRun) {
    const auto report = [&](size_t num_pairs) {
      progress("matched " + std::to_string(num_pairs) + " of " +
                   std::to_string(pairs.size()) + " pairs",
               static_cast<double>(num_pairs) / pairs.size());
    };
    const size_t end = std::min(pairs.size(), begin + kNumPairsPerRun);
    std::vector<std::string> lines;
    for (size_t i = begin; i < end; ++i) {
      lines.push_back(names.at(pairs[i].image_id1) + " " +
                      names.at(pairs[i].image_id2));
    }
    const ListFile list(list_path, lines);
    Status status = list.Check();
    if (status.ok()) {
      status = RunHost(program, arguments, log_path, [&] { report(begin); });
    }
    if (!status.ok()) return status;
    report(end);
  }
  return Status::Ok();
}

}  // namespace adasfm
