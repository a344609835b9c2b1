// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>

#include "synthetic/synthetic_world.h"

namespace adasfm {

inline Eigen::Vector3d Center(const SyntheticImage& image) {
  return image.cam_from_world.TargetOriginInSource();
}

// The message of the error that these options cause; empty without an error.
inline std::string BuildError(const SyntheticWorldOptions& options) {
  try {
    BuildSyntheticWorld(options);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

}  // namespace adasfm
