// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"

namespace adasfm {

// Checks and warnings of stages 2 and 3 about a database, before any work.

inline constexpr char kNoPriorsWarning[] =
    "the database has no sensor priors; the model will have no metric scale "
    "(adasfm_prior_importer adds them)";

// An error for a scene without verified matches: without a matcher's run the
// model would rest on the sensors alone.
Status CheckHasMatches(const std::string& database_path,
                       const SceneData& scene);

}  // namespace adasfm
