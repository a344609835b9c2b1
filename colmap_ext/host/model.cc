// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/model.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <utility>

#include "colmap_ext/host/binary_file_reader.h"
#include "colmap_ext/host/camera_models.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// Whether the file has exactly the declared number of records, and nothing
// else.
bool WalkRecords(const std::string& path,
                 const std::function<void(BinaryFileReader*)>& read_record) {
  BinaryFileReader file(path);
  const auto count = file.Read<uint64_t>();
  for (uint64_t i = 0; i < count && file.ok(); ++i) read_record(&file);
  return file.AtEnd();
}

// newer_model becomes the name of a camera model that the linked library lacks
// and a newer COLMAP has.
bool WalkCameras(const std::string& path, std::string* newer_model) {
  return WalkRecords(path, [newer_model](BinaryFileReader* file) {
    file->Skip(4);  // Id.
    const auto model_id = file->Read<int32_t>();
    if (IsNewerCameraModel(model_id)) *newer_model = CameraModelName(model_id);
    const std::optional<int> num_params = CameraModelNumParams(model_id);
    if (!num_params) return file->Fail();
    file->Skip(16);  // Width and height.
    file->SkipArray(*num_params, 8);
  });
}

bool IsCamerasFile(const std::string& path) {
  std::string newer_model;
  return WalkCameras(path, &newer_model);
}

bool IsImagesFile(const std::string& path) {
  return WalkRecords(path, [](BinaryFileReader* file) {
    file->Skip(4 + 7 * 8 + 4);  // Id, pose, camera id.
    file->SkipName();
    file->SkipArray(file->Read<uint64_t>(), 24);  // Points.
  });
}

bool IsPointsFile(const std::string& path) {
  return WalkRecords(path, [](BinaryFileReader* file) {
    file->Skip(8 + 3 * 8 + 3 + 8);               // Id, position, colour, error.
    file->SkipArray(file->Read<uint64_t>(), 8);  // Track.
  });
}

bool HasFiles(const std::string& path, const std::string& extension) {
  std::error_code error;
  for (const char* name : {"cameras", "images", "points3D"}) {
    if (!fs::is_regular_file(fs::path(path) / (name + extension), error)) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::vector<std::string> FindModels(const std::string& path) {
  const auto has_model = [](const std::string& folder) {
    return HasFiles(folder, ".bin") || HasFiles(folder, ".txt");
  };
  if (has_model(path)) return {path};
  std::vector<std::string> models;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
    const std::string folder = entry.path().string();
    if (has_model(folder)) models.push_back(folder);
  }
  std::sort(models.begin(), models.end());
  return models;
}

Status CheckBinaryModelFile(const std::string& path) {
  const std::pair<const char*, bool (*)(const std::string&)> files[] = {
      {"cameras.bin", IsCamerasFile},
      {"images.bin", IsImagesFile},
      {"points3D.bin", IsPointsFile}};
  const std::string file_name = fs::path(path).filename().string();
  for (const auto& [name, is_valid] : files) {
    if (name == file_name && is_valid(path)) return Status::Ok();
  }
  return Status::Error(path +
                       " is cut short or not COLMAP's; make the model again");
}

StatusOr<colmap::Reconstruction> ReadModel(const std::string& path) {
  const bool is_binary = HasFiles(path, ".bin");
  if (!is_binary && !HasFiles(path, ".txt")) {
    return Status::Error("there is no COLMAP model in " + path +
                         " (cameras, images and points3D as .bin or .txt); "
                         "check the path");
  }
  if (is_binary) {
    const fs::path folder(path);
    std::string newer;
    WalkCameras((folder / "cameras.bin").string(), &newer);
    if (!newer.empty()) {
      return Status::Error("the model in " + path +
                           " has a camera of the model " + newer +
                           ", which this program does not have; make the "
                           "model with another camera model");
    }
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
      const Status status = CheckBinaryModelFile((folder / name).string());
      if (!status.ok()) return status;
    }
  }
  colmap::Reconstruction reconstruction;
  try {
    reconstruction.Read(path);
  } catch (const std::exception& error) {
    return Status::Error("cannot read the model in " + path + ": " +
                         error.what() + "; make the model again");
  }
  ReleaseVisibility(&reconstruction);
  return reconstruction;
}

StatusOr<LargestModel> ReadLargestModel(
    const std::vector<std::string>& folders) {
  std::optional<LargestModel> largest;
  for (const std::string& folder : folders) {
    StatusOr<colmap::Reconstruction> model = ReadModel(folder);
    if (!model.ok()) return model.status();
    if (!largest ||
        model->NumRegImages() > largest->reconstruction.NumRegImages()) {
      largest = LargestModel{std::move(model).value(), folder};
    }
  }
  return *std::move(largest);
}

}  // namespace adasfm
