// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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

// Removes the file of an earlier run, if there is one.
void RemoveGeoreference(const std::string& folder);

}  // namespace adasfm
