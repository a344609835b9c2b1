// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/datasets/calibrated_camera.h"

#include <yaml-cpp/yaml.h>

#include <stdexcept>

#include "colmap_ext/datasets/dataset_files.h"

namespace adasfm {

CalibratedCamera CameraOfCalibration(const std::string& distortion_model,
                                     const std::vector<double>& intrinsics,
                                     const std::vector<double>& distortion,
                                     const std::string& path) {
  if (intrinsics.size() != 4) {
    throw std::runtime_error(path + ": intrinsics are not fu, fv, cu, cv");
  }
  std::vector<double> params = {intrinsics[0], intrinsics[1],
                                intrinsics[2] + 0.5, intrinsics[3] + 0.5};
  CalibratedCamera camera;
  bool is_zero = true;
  for (const double k : distortion) is_zero = is_zero && k == 0.0;
  const bool is_fisheye = distortion_model == "equidistant";
  if (distortion_model == "none" || distortion.empty() ||
      (is_zero && !is_fisheye)) {
    camera.model = "PINHOLE";
  } else if (distortion.size() != 4) {
    throw std::runtime_error(path + ": the distortion has " +
                             std::to_string(distortion.size()) +
                             " coefficients; 4 are expected");
  } else {
    if (!is_fisheye && distortion_model != "radial-tangential" &&
        distortion_model != "radtan") {
      throw std::runtime_error(path +
                               ": distortion_model = " + distortion_model +
                               " must be radial-tangential or equidistant; "
                               "give --camera_model and --camera_params "
                               "without --data_format");
    }
    camera.model = is_fisheye ? "OPENCV_FISHEYE" : "OPENCV";
    params.insert(params.end(), distortion.begin(), distortion.end());
  }
  camera.params = JoinNumbers(params);
  return camera;
}

std::optional<CalibratedCamera> ReadSensorsCamera(const std::string& path) {
  try {
    const YAML::Node root = YAML::LoadFile(path);
    const YAML::Node cam0 = root["cam0"];
    if (!cam0 || !cam0["intrinsics"] || root["cam1"]) return std::nullopt;
    if (cam0["camera_model"].as<std::string>("pinhole") != "pinhole") {
      return std::nullopt;
    }
    CalibratedCamera camera =
        CameraOfCalibration(cam0["distortion_model"].as<std::string>("none"),
                            cam0["intrinsics"].as<std::vector<double>>(),
                            cam0["distortion_coeffs"].as<std::vector<double>>(
                                std::vector<double>()),
                            path);
    const auto size =
        cam0["resolution"].as<std::vector<int>>(std::vector<int>());
    if (size.size() == 2) {
      camera.width_px = size[0];
      camera.height_px = size[1];
    }
    return camera;
  } catch (const std::exception&) {
    // What is wrong with the file the importer says.
    return std::nullopt;
  }
}

}  // namespace adasfm
