// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/bags/extract_video.h"
#include "colmap_ext/io/run_manifest.h"
#include "colmap_ext/workspace/automatic_reconstruction.h"
#include "core/status.h"

namespace adasfm {

// A bag or a video from which photos are extracted.

// Inputs of a bag's extraction. The bag itself is identified by names and
// sizes.
StatusOr<StepInputs> DigestBag(const std::string& path,
                               const BagExtractionOptions& options);

// The same for a video, without its wheel log.
StepInputs DigestVideo(const std::string& path,
                       const VideoExtractionOptions& options);

// Sets the paths and the camera that the user has not given.
void UseBagFiles(const BagFiles& files, AutomaticReconstructionOptions* options,
                 AutomaticReconstructionPaths* paths);

}  // namespace adasfm
