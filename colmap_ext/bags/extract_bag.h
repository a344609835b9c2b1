// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/bags/select_photos.h"
#include "colmap_ext/datasets/calibrated_camera.h"
#include "core/progress.h"
#include "core/sensor_log.h"
#include "core/status.h"
#include "core/types.h"
#include "sensors/io/bag_topics.h"

namespace adasfm {

struct BagExtractionOptions {
  BagTopicNames topics;
  PhotoSelectionOptions photos;
  // Whether the user has a calibration, which makes the bag's extrinsics
  // unnecessary, and the type of its wheels if it has any.
  bool has_calibration = false;
  std::optional<WheelType> wheel_type;
};

// Files of an extraction; paths are empty where the bag lacks the data.
struct BagFiles {
  std::string image_path;        // folder images/, "<stamp in ns>.png" or .jpg
  std::string image_times_path;  // image_times.csv
  std::string imu_path;          // imu.csv
  std::string wheel_path;        // wheel.csv
  std::string gnss_path;         // gnss.csv
  std::string sensors_path;      // sensors.yaml: extrinsics from /tf_static
  CalibratedCamera camera;       // camera.txt: from CameraInfo
};

struct BagExtraction {
  std::string summary;  // one line
  std::vector<std::string> warnings;
};

// Writes a bag's photos, their times, logs and calibration as files
// (docs/reference/formats.md) into the folder: one pass for the logs, one for
// the photos. Existing photos are not written again, so that an interrupted
// extraction continues. One warning lists what the bag lacks. An error when
// sensor logs need extrinsics that neither the bag nor the user gives.
StatusOr<BagExtraction> ExtractBag(const std::string& bag_path,
                                   const BagExtractionOptions& options,
                                   const std::string& folder,
                                   const ProgressCallback& progress);

// The name of a photo without its extension, of constant length, so that names
// sort by time.
std::string PhotoStem(timestamp_t time_ns);

// The files of a finished extraction.
BagFiles FindBagFiles(const std::string& folder);

// Removes files that extractions write, and nothing else.
Status RemoveBagFiles(const std::string& folder);

}  // namespace adasfm
