// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/open_workspace.h"

#include <filesystem>

#include "colmap_ext/bags/extract_bag.h"
#include "colmap_ext/workspace/reset_workspace.h"

namespace adasfm {

std::string BagFolder(const std::string& workspace_path) {
  return workspace_path + "/bag";
}

StatusOr<StepJournal> OpenWorkspace(const std::string& workspace_path,
                                    bool restart,
                                    const MessageCallback& message) {
  namespace fs = std::filesystem;
  const std::string database_path = workspace_path + "/database.db";
  const std::string journal_path = workspace_path + "/steps.json";
  std::error_code ignored;
  StatusOr<StepJournal> journal = StepJournal::Read(journal_path);
  if (!journal.ok()) return journal;
  if (!journal->Steps().empty() && !fs::exists(database_path)) {
    // Without the database nothing is done, whatever was recorded, but what
    // came before it.
    const Status status = journal->KeepOnly(kBagStep);
    if (!status.ok()) return status;
  }
  const std::string bag_folder = BagFolder(workspace_path);
  if (journal->Steps().empty() && fs::exists(bag_folder)) {
    return Status::Error("the workspace " + workspace_path + " has a folder " +
                         bag_folder +
                         " that this command did not make; choose an empty "
                         "folder");
  }
  if (journal->Steps().empty() && fs::exists(database_path)) {
    return Status::Error("the workspace " + workspace_path +
                         " has a database that this command did not make; "
                         "choose an empty folder");
  }
  if (!restart || journal->Steps().empty()) return journal;
  message("removing what earlier runs left in " + workspace_path);
  // The journal goes last: it is what tells our database from somebody's own.
  Status status = ResetFeatures(workspace_path);
  if (status.ok()) status = RemoveBagFiles(bag_folder);
  if (!status.ok()) return status;
  fs::remove(journal_path, ignored);
  return StepJournal::Read(journal_path);
}

}  // namespace adasfm
