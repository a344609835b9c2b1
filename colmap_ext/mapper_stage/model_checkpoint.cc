// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/model_checkpoint.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <vector>

#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/io/digest.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/mapper_stage/checkpoint_file.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr char kStateName[] = "state.json";
constexpr char kTemporaryStateName[] = "state.json.tmp";
constexpr const char* kModelFiles[] = {"cameras.bin", "images.bin",
                                       "points3D.bin"};

Status RemoveCheckpoint(const std::string& path) {
  return RemoveModelFolder(path, {kStateName, kTemporaryStateName});
}

// Size and digest of the model's files, by name.
StatusOr<nlohmann::json> DescribeModelFiles(const std::string& path) {
  nlohmann::json files = nlohmann::json::object();
  for (const char* name : kModelFiles) {
    const std::string file = path + "/" + name;
    std::error_code error;
    const uintmax_t size = fs::file_size(file, error);
    if (error) return Status::Error(file + " is missing");
    const StatusOr<std::string> digest = DigestPath(file);
    if (!digest.ok()) return digest.status();
    files[name] = {{"size", size}, {"digest", *digest}};
  }
  return files;
}

bool IsPlanName(const std::string& name) {
  return name == "plan.json" || name == "plan.json.tmp";
}

bool IsCheckpointName(const std::string& name) {
  static const std::regex pattern("(part|refine)_[0-9]+(\\.tmp)?");
  return std::regex_match(name, pattern);
}

}  // namespace

Status WriteModelCheckpoint(const std::string& path,
                            const std::string& fingerprint,
                            nlohmann::json state,
                            const colmap::Reconstruction* model) {
  const std::string temporary_path = path + ".tmp";
  Status status = RemoveCheckpoint(temporary_path);
  if (status.ok()) status = PrepareOutputFolder(temporary_path);
  if (!status.ok()) return status;
  if (model != nullptr) {
    status = WriteBinaryModel(*model, temporary_path);
    if (!status.ok()) return status;
    const StatusOr<nlohmann::json> files = DescribeModelFiles(temporary_path);
    if (!files.ok()) return files.status();
    state["files"] = *files;
  }
  status = WriteCheckpointFile(temporary_path + "/" + kStateName, fingerprint,
                               std::move(state));
  if (status.ok()) status = RemoveCheckpoint(path);
  if (!status.ok()) return status;
  std::error_code error;
  fs::rename(temporary_path, path, error);
  if (error) {
    return Status::Error("cannot write the folder " + path + ": " +
                         error.message());
  }
  return SyncToDisk(fs::path(path).parent_path().string());
}

StatusOr<nlohmann::json> ReadCheckpointState(const std::string& path,
                                             const std::string& fingerprint) {
  CheckpointFile file =
      ReadCheckpointFile(path + "/" + kStateName, fingerprint);
  if (file.condition != CheckpointCondition::kSound) {
    return Status::Error(file.problem);
  }
  if (file.content.contains("files")) {
    const StatusOr<nlohmann::json> found = DescribeModelFiles(path);
    if (!found.ok()) return found.status();
    for (const char* name : kModelFiles) {
      if ((*found)[name] == file.content["files"][name]) continue;
      return Status::Error(path + "/" + name + " is damaged");
    }
  }
  return std::move(file.content);
}

StatusOr<colmap::Reconstruction> ReadCheckpointModel(const std::string& path) {
  return ReadModel(path);
}

Status CheckCheckpointFolder(const std::string& path) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
    const std::string name = entry.path().filename().string();
    if (IsPlanName(name) && entry.is_regular_file()) continue;
    if (!IsCheckpointName(name)) {
      return Status::Error(entry.path().string() +
                           " is no checkpoint of adasfm_mapper; choose another "
                           "output folder, or move it");
    }
    const Status status = CheckModelFolder(entry.path().string(),
                                           {kStateName, kTemporaryStateName});
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

Status RemoveCheckpoints(const std::string& path) {
  Status status = CheckCheckpointFolder(path);
  if (!status.ok()) return status;
  std::vector<fs::path> entries;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
    entries.push_back(entry.path());
  }
  for (const fs::path& entry : entries) {
    if (IsPlanName(entry.filename().string())) {
      fs::remove(entry, error);
    } else {
      status = RemoveCheckpoint(entry.string());
      if (!status.ok()) return status;
    }
  }
  return status;
}

}  // namespace adasfm
