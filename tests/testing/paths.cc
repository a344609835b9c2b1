// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/paths.h"

namespace adasfm {

std::string SourceDir() { return ADASFM_SOURCE_DIR; }

std::string LauncherPath() { return ADASFM_LAUNCHER; }

}  // namespace adasfm
