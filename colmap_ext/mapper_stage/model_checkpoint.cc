// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/model_checkpoint.h"

#include <fcntl.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr char kStateName[] = "state.json";

// Waits until the file's, or the folder's, content is on the disk.
void Sync(const fs::path& path) {
  const int file = open(path.c_str(), O_RDONLY);
  if (file < 0) return;
  fsync(file);
  close(file);
}

}  // namespace

Status WriteModelCheckpoint(const std::string& path,
                            const std::string& fingerprint,
                            nlohmann::json state,
                            const colmap::Reconstruction* model) {
  const std::string temporary_path = path + ".tmp";
  std::error_code error;
  fs::remove_all(temporary_path, error);
  fs::create_directories(temporary_path, error);
  if (error) return Status::Error("cannot create the folder " + temporary_path);
  if (model != nullptr) model->WriteBinary(temporary_path);
  state["fingerprint"] = fingerprint;
  {
    std::ofstream file(temporary_path + "/" + kStateName);
    file << state.dump(1) << "\n";
    file.flush();
    if (!file) return Status::Error("cannot write to " + temporary_path);
  }
  for (const fs::directory_entry& entry :
       fs::directory_iterator(temporary_path)) {
    Sync(entry.path());
  }
  Sync(temporary_path);
  fs::remove_all(path, error);
  fs::rename(temporary_path, path, error);
  if (error) return Status::Error("cannot write the folder " + path);
  Sync(fs::path(path).parent_path());
  return Status::Ok();
}

StatusOr<nlohmann::json> ReadCheckpointState(const std::string& path,
                                             const std::string& fingerprint) {
  std::ifstream file(path + "/" + kStateName);
  if (!file) return Status::Error("nothing at " + path);
  try {
    const nlohmann::json state = nlohmann::json::parse(file);
    if (state.at("fingerprint").get<std::string>() != fingerprint) {
      return Status::Error(path +
                           " was made with other options or another database");
    }
    return state;
  } catch (const nlohmann::json::exception&) {
    return Status::Error(path + "/" + kStateName + " is damaged");
  }
}

bool HasCheckpointModel(const std::string& path) {
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    if (!fs::exists(path + "/" + name)) return false;
  }
  return true;
}

void ReadCheckpointModel(const std::string& path,
                         colmap::Reconstruction* model) {
  model->ReadBinary(path);
}

}  // namespace adasfm
