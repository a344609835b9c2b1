// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/io/step_journal.h"
#include "core/status.h"

namespace adasfm {

// The journal steps.json of a workspace of the automatic reconstruction. With
// `restart` what its steps left is removed, and the journal is empty. A
// database that no journal knows is somebody's own: an error, whatever
// `restart` says.
StatusOr<StepJournal> OpenWorkspace(const std::string& workspace_path,
                                    bool restart,
                                    const MessageCallback& message);

}  // namespace adasfm
