// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/io/step_journal.h"
#include "core/status.h"

namespace adasfm {

// The step that takes photos and logs out of a bag, before there is a database,
// and the folder of what it leaves.
constexpr char kBagStep[] = "bag";
std::string BagFolder(const std::string& workspace_path);

// The journal steps.json of a workspace of the automatic reconstruction. With
// `restart` what its steps left is removed, and the journal is empty. A
// database that no journal knows is somebody's own: an error, whatever
// `restart` says.
StatusOr<StepJournal> OpenWorkspace(const std::string& workspace_path,
                                    bool restart,
                                    const MessageCallback& message);

}  // namespace adasfm
