// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <exception>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <tuple>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/camera_models.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/host/database_schema.h"
#include "colmap_ext/host/database_writer.h"
#include "colmap_ext/host/features.h"
#include "colmap_ext/host/host_features.h"
#include "colmap_ext/host/photo_header.h"
#include "core/parallel.h"

namespace adasfm {
namespace {

// Photos that all threads read at a time; only their headers stay in memory.
constexpr size_t kReadBlockSize = 16;
// COLMAP's guess for photos without EXIF.
constexpr double kDefaultFocalLengthFactor = 1.2;

bool ParseCameraParams(const FeatureOptions& options,
                       std::vector<double>* params) {
  if (options.camera_params.empty()) return true;
  params->clear();
  std::istringstream text(options.camera_params);
  for (std::string word; std::getline(text, word, ',');) {
    try {
      params->push_back(std::stod(word));
    } catch (const std::exception&) {
      return false;
    }
  }
  const int model_id = CameraModelId(options.camera_model).value();
  return static_cast<int>(params->size()) == *CameraModelNumParams(model_id) &&
         HasUsableParams(MakeCamera(0, model_id, 0, 0, *params, true));
}

colmap::Camera CameraOfPhoto(const FeatureOptions& options,
                             const PhotoHeader& header) {
  const int model_id = CameraModelId(options.camera_model).value();
  std::vector<double> params =
      InitialCameraParams(model_id,
                          header.focal_length_px.value_or(
                              kDefaultFocalLengthFactor *
                              std::max(header.width_px, header.height_px)),
                          header.width_px, header.height_px);
  ParseCameraParams(options, &params);
  return MakeCamera(
      0, model_id, header.width_px, header.height_px, params,
      !options.camera_params.empty() || header.focal_length_px.has_value());
}

// Writes images and finds which of them share a camera.
class ImageWriter {
 public:
  ImageWriter(const FeatureOptions& options, const std::string& database_path)
      : options_(options), path_(database_path) {
    // Creates the tables of a new database.
    writer_ = std::make_unique<DatabaseWriter>(database_path);
    writer_.reset();
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    const std::map<camera_t, colmap::Camera> cameras = ReadCameras(&database);
    for (const auto& [camera_id, camera] : cameras) Count(camera);
    for (const DatabaseImage& image : ReadImages(&database)) {
      cameras_.emplace(Key(cameras.at(image.camera_id), image.name),
                       image.camera_id);
      names_.insert(image.name);
    }
    result_.num_images = names_.size();
    writer_ = std::make_unique<DatabaseWriter>(database_path);
  }

  bool Exists(const std::string& name) const { return names_.count(name) > 0; }

  Status Write(const std::string& name, const PhotoHeader& header) {
    if (options_.camera_width_px > 0 &&
        (header.width_px != options_.camera_width_px ||
         header.height_px != options_.camera_height_px)) {
      return Status::Error(
          "the photo " + name + " has " + std::to_string(header.width_px) +
          "x" + std::to_string(header.height_px) +
          " pixels, but the camera is calibrated for " +
          std::to_string(options_.camera_width_px) + "x" +
          std::to_string(options_.camera_height_px) +
          " (resolution of cam0 in --sensors_path); give --camera_model and "
          "--camera_params");
    }
    const colmap::Camera camera = CameraOfPhoto(options_, header);
    if (options_.single_camera == 1 && !cameras_.empty() &&
        cameras_.count(Key(camera, name)) == 0) {
      return Status::Error("the photo " + name + " has " +
                           std::to_string(header.width_px) + "x" +
                           std::to_string(header.height_px) +
                           " pixels, others have other sizes; they cannot be "
                           "of one camera, use --single_camera -1");
    }
    const auto [entry, is_new] = cameras_.emplace(Key(camera, name), 0);
    const bool shares = options_.single_camera != 0 && !is_new;
    if (!shares) {
      entry->second = writer_->WriteNewCamera(camera);
      Count(camera);
    }
    writer_->WriteNewImage(name, entry->second, header.position);
    names_.insert(name);
    ++result_.num_images;
    return Status::Ok();
  }

  // Ends the transaction of what was written so far and begins another.
  void Commit() { writer_->Commit(); }

  // COLMAP reports no failed write. Call Write and Commit only before.
  bool IsComplete() {
    writer_.reset();
    SqliteConnection database(path_, SqliteConnection::Mode::kRead);
    return static_cast<int>(ReadImages(&database).size()) == result_.num_images;
  }

  ImageRegistration& Result() { return result_; }

 private:
  // What photos of one camera have in common; the last entry is the folder.
  using CameraKey =
      std::tuple<double, double, std::vector<double>, bool, std::string>;

  CameraKey Key(const colmap::Camera& camera, const std::string& name) const {
    // Ignores the parameters: focal lengths of EXIF may differ in their last
    // digits.
    if (options_.single_camera == 1) {
      return {WidthOf(camera), HeightOf(camera), {}, false, ""};
    }
    if (options_.single_camera == 2) {
      return {WidthOf(camera),
              HeightOf(camera),
              {},
              false,
              std::filesystem::path(name).parent_path().string()};
    }
    return {WidthOf(camera), HeightOf(camera), ParamsOf(camera),
            HasPriorFocalLength(camera), ""};
  }

  void Count(const colmap::Camera& camera) {
    ++result_.num_cameras;
    if (HasPriorFocalLength(camera)) ++result_.num_known_focal_lengths;
  }

  const FeatureOptions& options_;
  std::string path_;
  std::unique_ptr<DatabaseWriter> writer_;
  std::set<std::string> names_;
  std::map<CameraKey, camera_t> cameras_;
  ImageRegistration result_;
};

}  // namespace

bool FeatureOptions::IsValid(std::string* error) const {
  std::vector<double> params;
  const std::optional<int> model_id = CameraModelId(camera_model);
  if (!model_id) {
    *error = "camera_model = " + camera_model +
             " must be one of COLMAP's, as PINHOLE or OPENCV_FISHEYE";
  } else if (!ParseCameraParams(*this, &params)) {
    *error = "camera_params = " + camera_params +
             " must be the parameters, and the focal length positive, of " +
             camera_model + ": " + CameraModelParamsInfo(*model_id);
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
    writer.Commit();
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
