// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "colmap_ext/scene/scene_data.h"
#include "core/status.h"

namespace adasfm {

// What stages 2 and 3 say about a database before they work on it.

inline constexpr char kNoPriorsWarning[] =
    "the database has no sensor priors; the model will have no metric scale "
    "(adasfm_prior_importer adds them)";

// An error for a scene without verified matches: who forgot a matcher would get
// a model of the sensors alone.
Status CheckHasMatches(const std::string& database_path,
                       const SceneData& scene);

}  // namespace adasfm
