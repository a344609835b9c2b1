// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "core/geodesy.h"
#include "core/status.h"

namespace adasfm {

// georeference.json beside a folder's models: where on the Earth their frame
// is (docs/reference/formats.md).
inline constexpr char kGeoreferenceName[] = "georeference.json";

// The models are in the ENU frame of this origin.
Status WriteGeoreference(const GeodeticPosition& origin,
                         const std::string& folder);

// An error for a missing file and one that is not such a file.
StatusOr<GeodeticPosition> ReadGeoreference(const std::string& path);

// Writes the origin of models that are somewhere on the Earth; of others, it
// removes the file of an earlier run.
Status UpdateGeoreference(bool is_georeferenced,
                          const std::optional<GeodeticPosition>& origin,
                          const std::string& folder);

}  // namespace adasfm
