// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/open_workspace.h"

#include <filesystem>

#include "colmap_ext/workspace/reset_workspace.h"

namespace adasfm {

StatusOr<StepJournal> OpenWorkspace(const std::string& workspace_path,
                                    bool restart,
                                    const MessageCallback& message) {
  namespace fs = std::filesystem;
  const std::string database_path = workspace_path + "/database.db";
  const std::string journal_path = workspace_path + "/steps.json";
  std::error_code ignored;
  // Without the database nothing is done, whatever was recorded.
  if (!fs::exists(database_path)) fs::remove(journal_path, ignored);
  StatusOr<StepJournal> journal = StepJournal::Read(journal_path);
  if (!journal.ok()) return journal;
  if (journal->Steps().empty() && fs::exists(database_path)) {
    return Status::Error("the workspace " + workspace_path +
                         " has a database that this command did not make; "
                         "choose an empty folder");
  }
  if (!restart || journal->Steps().empty()) return journal;
  message("removing what earlier runs left in " + workspace_path);
  // The journal goes last: it is what tells our database from somebody's own.
  const Status status = ResetFeatures(workspace_path);
  if (!status.ok()) return status;
  fs::remove(journal_path, ignored);
  return StepJournal::Read(journal_path);
}

}  // namespace adasfm
