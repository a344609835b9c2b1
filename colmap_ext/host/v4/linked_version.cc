// SPDX-License-Identifier: BSD-3-Clause
#include <colmap/util/version.h>

#include "colmap_ext/host/host_program.h"

namespace adasfm {

std::string LinkedColmapVersion() {
  const std::string info = colmap::GetVersionInfo();  // "COLMAP 4.2.0"
  return info.substr(info.rfind(' ') + 1);
}

}  // namespace adasfm
