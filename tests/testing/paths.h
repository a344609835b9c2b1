// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace adasfm {

// The checkout that the tests were built from, without a trailing slash.
std::string SourceDir();

// Our `colmap` in the build folder.
std::string LauncherPath();

}  // namespace adasfm
