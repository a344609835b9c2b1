// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/model_folder.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "colmap_ext/host/model.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/output_files.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr char kTemporaryName[] = ".models.tmp";

bool IsModelFile(const std::string& name) {
  static const std::vector<std::string> names = {
      "cameras.bin",  "cameras.txt",  "images.bin",  "images.txt",
      "points3D.bin", "points3D.txt", "rigs.bin",    "rigs.txt",
      "frames.bin",   "frames.txt",   "project.ini", kFolderLockName};
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool IsNumber(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
    return c >= '0' && c <= '9';
  });
}

// Compares with the count at the beginning of each file.
bool HasRecords(const fs::path& path, uint64_t num_records) {
  std::ifstream file(path, std::ios::binary);
  uint64_t num_written = 0;
  file.read(reinterpret_cast<char*>(&num_written), sizeof(num_written));
  return file && num_written == num_records;
}

Status WriteModels(const std::vector<const colmap::Reconstruction*>& models,
                   const ModelFrames& frames, const fs::path& temporary) {
  for (size_t i = 0; i < models.size(); ++i) {
    const fs::path path = temporary / std::to_string(i);
    fs::create_directories(path);
    const Status status = WriteBinaryModel(*models[i], path.string(), frames);
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

// Replaces the models of an earlier run.
Status ReplaceModels(const fs::path& temporary, const fs::path& folder,
                     size_t num_models) {
  Status status;
  for (size_t i = 0; status.ok() && i < num_models; ++i) {
    const std::string name = std::to_string(i);
    status = RemoveModelFolder((folder / name).string());
    if (status.ok()) fs::rename(temporary / name, folder / name);
  }
  for (size_t i = num_models; status.ok(); ++i) {
    const fs::path path = folder / std::to_string(i);
    if (fs::symlink_status(path).type() == fs::file_type::not_found) break;
    status = RemoveModelFolder(path.string());
  }
  return status.ok() ? SyncToDisk(folder.string()) : status;
}

}  // namespace

Status WriteBinaryModel(const colmap::Reconstruction& model,
                        const std::string& path, const ModelFrames& frames) {
  const std::vector<std::string> frame_files = {path + "/rigs.bin",
                                                path + "/frames.bin"};
  std::error_code none;
  // Files of a model that was here before would list other images.
  for (const std::string& file : frame_files) fs::remove(file, none);
  model.WriteBinary(path);
  const std::pair<const char*, uint64_t> files[] = {
      {"cameras.bin", model.NumCameras()},
      {"images.bin", model.NumRegImages()},
      {"points3D.bin", model.NumPoints3D()}};
  for (const auto& [name, num_records] : files) {
    const std::string file = path + "/" + name;
    if (!HasRecords(file, num_records) || !CheckBinaryModelFile(file).ok()) {
      return Status::Error("cannot write " + file + ": " +
                           DescribeWriteFailure(file));
    }
    const Status status = SyncToDisk(file);
    if (!status.ok()) return status;
  }
  if (!frames.frames.empty()) {
    if (!WriteFrameFiles(model, frames, path)) {
      return Status::Error("cannot write the frames of a model to " + path +
                           "; check the free space");
    }
    for (const std::string& file : frame_files) {
      const Status status = SyncToDisk(file);
      if (!status.ok()) return status;
    }
  }
  return SyncToDisk(path);
}

Status ReplacePoints(const colmap::Reconstruction& model,
                     const std::string& path) {
  const fs::path temporary = fs::path(path).parent_path() / kTemporaryName;
  Status status;
  try {
    fs::remove_all(temporary);
    fs::create_directory(temporary);
    status = WriteBinaryModel(model, temporary.string());
    if (status.ok()) {
      fs::rename(temporary / "points3D.bin", fs::path(path) / "points3D.bin");
      status = SyncToDisk(path);
    }
    fs::remove_all(temporary);
  } catch (const fs::filesystem_error& error) {
    return Status::Error("cannot write to " + path + ": " +
                         error.code().message());
  }
  return status;
}

Status WriteModelFolder(
    const std::string& output_path,
    const std::vector<const colmap::Reconstruction*>& models,
    const ModelFrames& frames) {
  const fs::path folder(output_path);
  const fs::path temporary = folder / kTemporaryName;
  Status status = CheckModelFolders(output_path);
  if (!status.ok()) return status;
  try {
    fs::remove_all(temporary);
    status = WriteModels(models, frames, temporary);
    if (status.ok()) status = ReplaceModels(temporary, folder, models.size());
    fs::remove_all(temporary);
  } catch (const fs::filesystem_error& error) {
    return Status::Error("cannot write to " + output_path + ": " +
                         error.code().message());
  }
  return status;
}

Status CheckModelFolders(const std::string& output_path) {
  std::error_code error;
  for (const fs::directory_entry& entry :
       fs::directory_iterator(output_path, error)) {
    if (!IsNumber(entry.path().filename().string())) continue;
    const Status status = CheckModelFolder(entry.path().string());
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

Status CheckModelFolder(const std::string& path,
                        const std::vector<std::string>& other_names) {
  constexpr char kAdvice[] =
      " is in the way of a model and is not replaced; choose another output "
      "folder, or move it";
  std::error_code error;
  const fs::file_type type = fs::symlink_status(path, error).type();
  if (type == fs::file_type::not_found) return Status::Ok();
  if (type != fs::file_type::directory) {
    return Status::Error(path + ", which is not a folder," + kAdvice);
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
    const std::string name = entry.path().filename().string();
    const bool is_known =
        IsModelFile(name) || std::find(other_names.begin(), other_names.end(),
                                       name) != other_names.end();
    if (is_known && entry.symlink_status().type() == fs::file_type::regular) {
      continue;
    }
    return Status::Error(entry.path().string() +
                         ", which is no file of a model," + kAdvice);
  }
  if (error) {
    return Status::Error("cannot read " + path + ": " + error.message());
  }
  return Status::Ok();
}

Status RemoveModelFolder(const std::string& path,
                         const std::vector<std::string>& other_names) {
  const Status status = CheckModelFolder(path, other_names);
  std::error_code error;
  if (!status.ok() || !fs::exists(path, error)) return status;
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
    files.push_back(entry.path());
  }
  // Removes only the listed files: a file that appears meanwhile stays, and the
  // folder with it.
  for (const fs::path& file : files) fs::remove(file, error);
  fs::remove(path, error);
  if (!error) return Status::Ok();
  return Status::Error("cannot remove " + path + ": " + error.message());
}

}  // namespace adasfm
