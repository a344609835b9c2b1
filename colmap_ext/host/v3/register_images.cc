// SPDX-License-Identifier: BSD-3-Clause
#include <base/camera_models.h>
#include <base/database.h>
#include <util/bitmap.h>
#include <util/misc.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <map>
#include <optional>
#include <tuple>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/database_schema.h"
#include "colmap_ext/host/features.h"
#include "colmap_ext/host/host_features.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

// Photos that are read at a time, on all threads; only their sizes are kept.
constexpr size_t kReadBlockSize = 16;
// COLMAP's guess for photos without EXIF.
constexpr double kDefaultFocalLengthFactor = 1.2;

struct PhotoHeader {
  int width = 0;
  int height = 0;
  std::optional<double> focal_length_px;
  // Latitude and longitude in degrees, altitude in m.
  std::optional<Eigen::Vector3d> position;
};

std::optional<PhotoHeader> ReadPhotoHeader(const std::string& path) {
  colmap::Bitmap bitmap;
  if (!bitmap.Read(path, /*as_rgb=*/false)) return std::nullopt;
  PhotoHeader header{bitmap.Width(), bitmap.Height(), std::nullopt,
                     std::nullopt};
  double focal_length_px = 0.0;
  if (bitmap.ExifFocalLength(&focal_length_px) && focal_length_px > 0.0) {
    header.focal_length_px = focal_length_px;
  }
  Eigen::Vector3d position;
  if (bitmap.ExifLatitude(&position.x()) &&
      bitmap.ExifLongitude(&position.y()) &&
      bitmap.ExifAltitude(&position.z())) {
    header.position = position;
  }
  return header;
}

bool ParseCameraParams(const FeatureOptions& options,
                       std::vector<double>* params) {
  if (options.camera_params.empty()) return true;
  try {
    *params = colmap::CSVToVector<double>(options.camera_params);
  } catch (const std::exception&) {
    return false;
  }
  const int model_id = colmap::CameraModelNameToId(options.camera_model);
  if (!colmap::CameraModelVerifyParams(model_id, *params)) return false;
  colmap::Camera camera;
  camera.SetModelId(model_id);
  camera.SetParams(*params);
  return HasUsableParams(camera);
}

colmap::Camera MakeCamera(const FeatureOptions& options,
                          const PhotoHeader& header) {
  colmap::Camera camera;
  const bool has_prior =
      !options.camera_params.empty() || header.focal_length_px.has_value();
  camera.InitializeWithName(
      options.camera_model,
      header.focal_length_px.value_or(kDefaultFocalLengthFactor *
                                      std::max(header.width, header.height)),
      header.width, header.height);
  if (!options.camera_params.empty()) {
    std::vector<double> params;
    ParseCameraParams(options, &params);
    camera.SetParams(params);
  }
  camera.SetPriorFocalLength(has_prior);
  return camera;
}

// Writes images and finds which of them share a camera.
class ImageWriter {
 public:
  ImageWriter(const FeatureOptions& options, const std::string& database_path)
      : options_(options), database_(database_path) {
    for (const colmap::Camera& camera : database_.ReadAllCameras()) {
      Count(camera);
    }
    for (const colmap::Image& image : database_.ReadAllImages()) {
      cameras_.emplace(
          Key(database_.ReadCamera(image.CameraId()), image.Name()),
          image.CameraId());
    }
    result_.num_images = database_.NumImages();
  }

  bool Exists(const std::string& name) const {
    return database_.ExistsImageWithName(name);
  }

  Status Write(const std::string& name, const PhotoHeader& header) {
    colmap::Camera camera = MakeCamera(options_, header);
    if (options_.single_camera == 1 && !cameras_.empty() &&
        cameras_.count(Key(camera, name)) == 0) {
      return Status::Error("the photo " + name + " has " +
                           std::to_string(header.width) + "x" +
                           std::to_string(header.height) +
                           " pixels, others have other sizes; they cannot be "
                           "of one camera, use --single_camera -1");
    }
    const auto [entry, is_new] = cameras_.emplace(Key(camera, name), 0);
    const bool shares = options_.single_camera != 0 && !is_new;
    if (!shares) {
      entry->second = database_.WriteCamera(camera);
      Count(camera);
    }
    colmap::Image image;
    image.SetName(name);
    image.SetCameraId(entry->second);
    // Where COLMAP's feature_extractor puts it.
    if (header.position.has_value()) image.SetTvecPrior(*header.position);
    database_.WriteImage(image);
    ++result_.num_images;
    return Status::Ok();
  }

  // COLMAP reports no failed write.
  bool IsComplete() const {
    return static_cast<int>(database_.NumImages()) == result_.num_images;
  }

  ImageRegistration& Result() { return result_; }

 private:
  // What photos of one camera have in common; the last one is the folder.
  using CameraKey =
      std::tuple<size_t, size_t, std::vector<double>, bool, std::string>;

  CameraKey Key(const colmap::Camera& camera, const std::string& name) const {
    // EXIF may differ in its last digits.
    if (options_.single_camera == 1) {
      return {camera.Width(), camera.Height(), {}, false, ""};
    }
    if (options_.single_camera == 2) {
      return {camera.Width(),
              camera.Height(),
              {},
              false,
              std::filesystem::path(name).parent_path().string()};
    }
    return {camera.Width(), camera.Height(), camera.Params(),
            camera.HasPriorFocalLength(), ""};
  }

  void Count(const colmap::Camera& camera) {
    ++result_.num_cameras;
    if (camera.HasPriorFocalLength()) ++result_.num_known_focal_lengths;
  }

  const FeatureOptions& options_;
  colmap::Database database_;
  std::map<CameraKey, camera_t> cameras_;
  ImageRegistration result_;
};

}  // namespace

bool FeatureOptions::IsValid(std::string* error) const {
  std::vector<double> params;
  if (!colmap::ExistsCameraModelWithName(camera_model)) {
    *error = "camera_model = " + camera_model +
             " must be one of COLMAP's, as PINHOLE or OPENCV_FISHEYE";
  } else if (!ParseCameraParams(*this, &params)) {
    *error = "camera_params = " + camera_params +
             " must be the parameters, and the focal length positive, of " +
             camera_model + ": " +
             colmap::CameraModelParamsInfo(
                 colmap::CameraModelNameToId(camera_model));
  } else if (single_camera < -1 || single_camera > 2) {
    *error = "single_camera = " + std::to_string(single_camera) +
             " must be -1, 0, 1 or 2";
  } else if (use_gpu < -1 || use_gpu > 1) {
    *error = "use_gpu = " + std::to_string(use_gpu) + " must be -1, 0 or 1";
  } else if (matcher != "adasfm" && matcher != "host") {
    *error = "matcher = " + matcher + " must be adasfm or host";
  } else if (max_image_size < 1) {
    *error = "max_image_size = " + std::to_string(max_image_size) +
             " must be positive";
  } else if (max_num_features < 1) {
    *error = "max_num_features = " + std::to_string(max_num_features) +
             " must be positive";
  } else if (first_octave < -1 || first_octave > 0) {
    *error =
        "first_octave = " + std::to_string(first_octave) + " must be -1 or 0";
  } else if (extractor != "colmap" && extractor != "opencv") {
    *error = "extractor = " + extractor + " must be colmap or opencv";
  } else if (extractor == "opencv" && (first_octave == 0 || use_gpu == 1)) {
    *error = "extractor = opencv takes first_octave = -1 only, and has no GPU";
  } else {
    return true;
  }
  return false;
}

StatusOr<ImageRegistration> RegisterImages(
    const FeatureOptions& options, const std::string& image_path,
    const std::vector<std::string>& names, const std::string& database_path,
    const ProgressCallback& progress) {
  const Status opens = CheckLibraryOpens(database_path);
  if (!opens.ok()) {
    if (UsesHostProgram()) return ReadRegistration(names, database_path);
    return opens;
  }
  ImageWriter writer(options, database_path);
  for (size_t begin = 0; begin < names.size(); begin += kReadBlockSize) {
    const size_t count = std::min(kReadBlockSize, names.size() - begin);
    std::vector<std::optional<PhotoHeader>> headers(count);
    std::vector<char> exists(count);
    for (size_t i = 0; i < count; ++i) {
      exists[i] = writer.Exists(names[begin + i]);
    }
    ParallelFor(options.num_threads, count, [&](size_t i) {
      if (exists[i]) return;
      headers[i] = ReadPhotoHeader(image_path + "/" + names[begin + i]);
    });
    for (size_t i = 0; i < count; ++i) {
      const std::string& name = names[begin + i];
      if (exists[i]) continue;
      if (!headers[i].has_value()) {
        writer.Result().unreadable.push_back(name);
        continue;
      }
      const Status status = writer.Write(name, *headers[i]);
      if (!status.ok()) return status;
    }
    progress("reading photo " + std::to_string(begin + count) + " of " +
                 std::to_string(names.size()),
             static_cast<double>(begin + count) / names.size());
  }
  if (writer.Result().num_images == 0) {
    return Status::Error("none of the " + std::to_string(names.size()) +
                         " files in " + image_path +
                         " is an image; check --image_path");
  }
  if (!writer.IsComplete()) {
    return Status::Error(database_path +
                         ": not all images could be written; make sure that "
                         "the disk has room, and run again");
  }
  return writer.Result();
}

}  // namespace adasfm
