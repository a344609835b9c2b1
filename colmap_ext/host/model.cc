// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/model.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>

#include "colmap_ext/host/camera_models.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// Walks through a binary file without believing its counts.
class BinaryWalker {
 public:
  explicit BinaryWalker(const std::string& path)
      : file_(path, std::ios::binary) {
    std::error_code error;
    const uintmax_t size = fs::file_size(path, error);
    if (!error) num_bytes_left_ = size;
  }

  // False at the end of the file, and from then on.
  bool Skip(uint64_t num_bytes) {
    if (!Take(num_bytes)) return false;
    file_.ignore(num_bytes);
    return static_cast<bool>(file_);
  }

  bool SkipArray(uint64_t count, uint64_t element_num_bytes) {
    return count <= num_bytes_left_ / element_num_bytes &&
           Skip(count * element_num_bytes);
  }

  template <typename T>
  bool Read(T* value) {
    return Take(sizeof(T)) &&
           file_.read(reinterpret_cast<char*>(value), sizeof(T));
  }

  bool SkipName() {
    char c = 1;
    while (c != '\0') {
      if (!Read(&c)) return false;
    }
    return true;
  }

  bool AtEnd() const { return num_bytes_left_ == 0; }

 private:
  bool Take(uint64_t num_bytes) {
    if (num_bytes > num_bytes_left_) return false;
    num_bytes_left_ -= num_bytes;
    return true;
  }

  std::ifstream file_;
  uint64_t num_bytes_left_ = 0;
};

// newer_model becomes the name of the first camera model that the linked
// library lacks and a newer COLMAP has.
bool WalkCameras(const std::string& path, std::string* newer_model) {
  BinaryWalker walker(path);
  uint64_t count = 0;
  if (!walker.Read(&count)) return false;
  for (uint64_t i = 0; i < count; ++i) {
    int32_t model_id = 0;
    if (!walker.Skip(4) || !walker.Read(&model_id)) return false;
    if (IsNewerCameraModel(model_id)) *newer_model = CameraModelName(model_id);
    const std::optional<int> num_params = CameraModelNumParams(model_id);
    if (!num_params || !walker.Skip(16) || !walker.SkipArray(*num_params, 8)) {
      return false;
    }
  }
  return walker.AtEnd();
}

bool IsCamerasFile(const std::string& path) {
  std::string newer_model;
  return WalkCameras(path, &newer_model);
}

bool IsImagesFile(const std::string& path) {
  BinaryWalker walker(path);
  uint64_t count = 0;
  if (!walker.Read(&count)) return false;
  for (uint64_t i = 0; i < count; ++i) {
    uint64_t num_points = 0;
    // Id, pose, camera id; name; points.
    if (!walker.Skip(4 + 7 * 8 + 4) || !walker.SkipName() ||
        !walker.Read(&num_points) || !walker.SkipArray(num_points, 24)) {
      return false;
    }
  }
  return walker.AtEnd();
}

bool IsPointsFile(const std::string& path) {
  BinaryWalker walker(path);
  uint64_t count = 0;
  if (!walker.Read(&count)) return false;
  for (uint64_t i = 0; i < count; ++i) {
    uint64_t track_length = 0;
    // Id, position, colour, error; track.
    if (!walker.Skip(8 + 3 * 8 + 3 + 8) || !walker.Read(&track_length) ||
        !walker.SkipArray(track_length, 8)) {
      return false;
    }
  }
  return walker.AtEnd();
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

}  // namespace adasfm
