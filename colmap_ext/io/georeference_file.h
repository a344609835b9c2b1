// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "core/geodesy.h"
#include "core/status.h"

namespace adasfm {

// georeference.json beside a folder's models: the position of their frame on
// the Earth (docs/reference/formats.md).
inline constexpr char kGeoreferenceName[] = "georeference.json";

// The models are in the ENU frame of this origin.
Status WriteGeoreference(const GeodeticPosition& origin,
                         const std::string& folder);

// An error for a missing file, and for a file that is no georeference.
StatusOr<GeodeticPosition> ReadGeoreference(const std::string& path);

// Writes the origin of georeferenced models; for other models, removes the file
// that an earlier run wrote.
Status UpdateGeoreference(bool is_georeferenced,
                          const std::optional<GeodeticPosition>& origin,
                          const std::string& folder);

}  // namespace adasfm
