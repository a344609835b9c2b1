// SPDX-License-Identifier: BSD-3-Clause
#include <util/version.h>

#include "colmap_ext/host/host_program.h"

namespace adasfm {

std::string LinkedColmapVersion() { return colmap::COLMAP_VERSION; }

}  // namespace adasfm
