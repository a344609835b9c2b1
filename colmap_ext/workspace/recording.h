// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/bags/extract_video.h"
#include "colmap_ext/io/step_journal.h"
#include "colmap_ext/workspace/automatic_reconstruction.h"
#include "core/status.h"

namespace adasfm {

// A bag or a video that photos are taken out of.

// What the files of a bag depend on. A bag of gigabytes is told by its size.
StatusOr<StepInputs> DigestBag(const std::string& path,
                               const BagExtractionOptions& options);

// The same of a video, but for its wheel log.
StepInputs DigestVideo(const std::string& path,
                       const VideoExtractionOptions& options);

// Fills the paths and the camera that the user has not given.
void UseBagFiles(const BagFiles& files, AutomaticReconstructionOptions* options,
                 AutomaticReconstructionPaths* paths);

}  // namespace adasfm
