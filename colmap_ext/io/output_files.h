// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/status.h"

namespace adasfm {

// Creates the folder, and its parents, unless it exists; an error when it
// cannot be written to.
Status PrepareOutputFolder(const std::string& path);

// Writes a file under a temporary name and renames it when it is complete.
Status WriteTextFile(const std::string& path, const std::string& text);

}  // namespace adasfm
