// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/datasets/calibrated_camera.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "colmap_ext/datasets/dataset_files.h"

namespace adasfm {
namespace {

constexpr size_t kNumFisheye = 4;
constexpr size_t kNumTangential = 4;
constexpr size_t kNumRational = 8;

bool IsZero(double value) { return value == 0.0; }

template <typename T>
StatusOr<T> ReadField(const YAML::Node& node, const char* key, T fallback) {
  if (!node[key]) return fallback;
  try {
    return node[key].as<T>();
  } catch (const YAML::Exception&) {
    return Status::Error(std::string("its ") + key + " cannot be read");
  }
}

StatusOr<CalibratedCamera> CameraOfNode(const YAML::Node& cam) {
  const auto model = ReadField<std::string>(cam, "camera_model", "pinhole");
  if (!model.ok()) return model.status();
  if (*model != "pinhole") {
    return Status::Error("its camera_model '" + *model + "' is not pinhole");
  }
  const auto distortion_model =
      ReadField<std::string>(cam, "distortion_model", "none");
  if (!distortion_model.ok()) return distortion_model.status();
  const auto intrinsics = ReadField<std::vector<double>>(cam, "intrinsics", {});
  if (!intrinsics.ok()) return intrinsics.status();
  const auto distortion =
      ReadField<std::vector<double>>(cam, "distortion_coeffs", {});
  if (!distortion.ok()) return distortion.status();
  StatusOr<CalibratedCamera> camera =
      CameraOfCalibration(*distortion_model, *intrinsics, *distortion);
  if (!camera.ok()) return camera.status();
  const auto size = ReadField<std::vector<int>>(cam, "resolution", {0, 0});
  if (!size.ok()) return size.status();
  if (size->size() != 2) {
    return Status::Error("its resolution is not two sides");
  }
  camera->width_px = size->front();
  camera->height_px = size->back();
  return camera;
}

}  // namespace

StatusOr<CalibratedCamera> CameraOfCalibration(
    const std::string& distortion_model, const std::vector<double>& intrinsics,
    std::vector<double> distortion) {
  if (intrinsics.size() != 4) {
    return Status::Error("its intrinsics are not the four fu, fv, cu, cv");
  }
  const auto is_finite = [](double value) { return std::isfinite(value); };
  if (!std::all_of(intrinsics.begin(), intrinsics.end(), is_finite) ||
      !std::all_of(distortion.begin(), distortion.end(), is_finite) ||
      intrinsics[0] <= 0.0 || intrinsics[1] <= 0.0) {
    return Status::Error("it is uncalibrated");
  }
  std::vector<double> params = {intrinsics[0], intrinsics[1],
                                intrinsics[2] + 0.5, intrinsics[3] + 0.5};
  CalibratedCamera camera;
  const bool is_none = distortion_model.empty() || distortion_model == "none";
  if (distortion_model == "equidistant" || distortion_model == "fisheye") {
    if (distortion.size() != kNumFisheye) {
      return Status::Error("its distortion has not 4 coefficients");
    }
    camera.model = "OPENCV_FISHEYE";
  } else if (std::all_of(distortion.begin(), distortion.end(), IsZero)) {
    distortion.clear();
    camera.model = "PINHOLE";
  } else if (distortion_model == "radtan" ||
             distortion_model == "radial-tangential" ||
             distortion_model == "plumb_bob" ||
             distortion_model == "rational_polynomial") {
    if (distortion.size() < kNumTangential ||
        distortion.size() > kNumRational) {
      return Status::Error("its distortion has not 4 to 8 coefficients");
    }
    const bool is_short = std::all_of(distortion.begin() + kNumTangential,
                                      distortion.end(), IsZero);
    distortion.resize(is_short ? kNumTangential : kNumRational, 0.0);
    camera.model = is_short ? "OPENCV" : "FULL_OPENCV";
  } else if (is_none) {
    return Status::Error("its distortion has coefficients, but no model");
  } else {
    return Status::Error("its distortion model '" +
                         distortion_model.substr(0, 40) +
                         "' is neither radtan nor equidistant");
  }
  params.insert(params.end(), distortion.begin(), distortion.end());
  camera.params = JoinNumbers(params);
  return camera;
}

StatusOr<std::optional<CalibratedCamera>> ReadSensorsCamera(
    const std::string& path) {
  const std::optional<CalibratedCamera> none;
  try {
    const YAML::Node root = YAML::LoadFile(path);
    const YAML::Node cam0 = root["cam0"];
    if (!cam0 || !cam0["intrinsics"] || root["cam1"]) return none;
    const StatusOr<CalibratedCamera> camera = CameraOfNode(cam0);
    if (camera.ok()) return std::optional<CalibratedCamera>(*camera);
    return Status::Error(
        path +
        ": cam0 cannot be used for the photos: " + camera.status().message() +
        "; mend it, or give --camera_model and --camera_params");
  } catch (const YAML::Exception&) {
    return none;
  }
}

}  // namespace adasfm
