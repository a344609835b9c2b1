// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/open_workspace.h"

#include <filesystem>

#include "colmap_ext/bags/extract_bag.h"
#include "colmap_ext/workspace/reset_workspace.h"

namespace adasfm {

std::string BagFolder(const std::string& workspace_path) {
  return workspace_path + "/bag";
}

StatusOr<RunManifest> OpenWorkspace(const std::string& workspace_path,
                                    bool restart,
                                    const MessageCallback& message) {
  namespace fs = std::filesystem;
  const std::string database_path = workspace_path + "/database.db";
  const std::string manifest_path = workspace_path + "/steps.json";
  std::error_code ignored;
  StatusOr<RunManifest> manifest = RunManifest::Read(manifest_path);
  if (!manifest.ok()) return manifest;
  if (!manifest->Steps().empty() && !fs::exists(database_path)) {
    // Without the database no recorded step is done, except the extraction of
    // photos, which precedes it.
    const Status status = manifest->KeepOnly(kBagStep);
    if (!status.ok()) return status;
  }
  const std::string bag_folder = BagFolder(workspace_path);
  if (manifest->Steps().empty() && fs::exists(bag_folder)) {
    return Status::Error("the workspace " + workspace_path + " has a folder " +
                         bag_folder +
                         " that this command did not make; choose an empty "
                         "folder");
  }
  if (manifest->Steps().empty() && fs::exists(database_path)) {
    return Status::Error("the workspace " + workspace_path +
                         " has a database that this command did not make; "
                         "choose an empty folder");
  }
  if (!restart || manifest->Steps().empty()) return manifest;
  message("removing what earlier runs left in " + workspace_path);
  // The manifest is removed last, since it identifies the database as ours.
  Status status = ResetFeatures(workspace_path);
  if (status.ok()) status = RemoveBagFiles(bag_folder);
  if (!status.ok()) return status;
  fs::remove(manifest_path, ignored);
  return RunManifest::Read(manifest_path);
}

}  // namespace adasfm
