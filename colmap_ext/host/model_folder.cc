// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/model_folder.h"

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr char kTemporaryName[] = ".models.tmp";

// COLMAP does not report short writes: the number of records at the head of a
// file and a size of at least that many bytes are what can be checked.
bool IsWritten(const fs::path& path, size_t num_records, size_t record_size) {
  std::ifstream file(path, std::ios::binary);
  uint64_t num_written = 0;
  file.read(reinterpret_cast<char*>(&num_written), sizeof(num_written));
  return file && num_written == num_records &&
         fs::file_size(path) >= sizeof(num_written) + num_records * record_size;
}

bool WriteModel(const colmap::Reconstruction& model,
                const std::map<image_t, FrameOfImage>& frames,
                const fs::path& path) {
  fs::create_directories(path);
  model.WriteBinary(path.string());
  if (!frames.empty() && !WriteFrameFiles(model, frames, path.string())) {
    return false;
  }
  // Least bytes of a record: see COLMAP's file formats.
  return IsWritten(path / "cameras.bin", model.NumCameras(), 24) &&
         IsWritten(path / "images.bin", model.NumRegImages(), 73) &&
         IsWritten(path / "points3D.bin", model.NumPoints3D(), 51);
}

}  // namespace

Status WriteModelFolder(
    const std::string& output_path,
    const std::vector<const colmap::Reconstruction*>& models,
    const std::map<image_t, FrameOfImage>& frames) {
  const fs::path folder(output_path);
  const fs::path temporary = folder / kTemporaryName;
  try {
    fs::remove_all(temporary);
    for (size_t i = 0; i < models.size(); ++i) {
      if (!WriteModel(*models[i], frames, temporary / std::to_string(i))) {
        fs::remove_all(temporary);
        return Status::Error("cannot write a model to " + output_path +
                             "; check the free space");
      }
    }
    for (size_t i = 0; i < models.size(); ++i) {
      const std::string name = std::to_string(i);
      fs::remove_all(folder / name);
      fs::rename(temporary / name, folder / name);
    }
    for (size_t i = models.size(); fs::exists(folder / std::to_string(i));
         ++i) {
      fs::remove_all(folder / std::to_string(i));
    }
    fs::remove_all(temporary);
  } catch (const fs::filesystem_error& error) {
    return Status::Error("cannot write to " + output_path + ": " +
                         error.code().message());
  }
  return Status::Ok();
}

}  // namespace adasfm
