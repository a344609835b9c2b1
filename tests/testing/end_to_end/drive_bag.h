// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "tests/testing/bag_writer.h"

namespace adasfm {

struct DriveBagOptions {
  BagWriterOptions writer;
  bool has_raw_images = false;  // bgr8 in place of the files' bytes
  bool has_extrinsics = true;   // /tf_static
  bool has_second_imu = false;  // topic /imu/raw
};

// Records the drive that adasfm_synthesizer left in a folder (with photos) as a
// robot would: photos and CameraInfo of /camera, /imu, the wheels' speeds
// integrated to poses as /odom, and the extrinsics as /tf_static.
void WriteDriveBag(const std::string& folder, const std::string& bag_path,
                   const DriveBagOptions& options);

}  // namespace adasfm
