// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/io/run_manifest.h"
#include "core/status.h"

namespace adasfm {

// Name of the step that extracts photos and logs from a bag, before there is a
// database, and the folder of its results.
constexpr char kBagStep[] = "bag";
std::string BagFolder(const std::string& workspace_path);

// The manifest steps.json of a workspace of the automatic reconstruction. With
// `restart`, removes the results of its steps and returns an empty manifest. An
// error for a database without a manifest, which belongs to somebody else, even
// with `restart`.
StatusOr<RunManifest> OpenWorkspace(const std::string& workspace_path,
                                    bool restart,
                                    const MessageCallback& message);

}  // namespace adasfm
