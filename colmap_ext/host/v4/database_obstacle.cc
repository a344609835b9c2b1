// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database_schema.h"

namespace adasfm {

std::string WhyLibraryMustNotOpen(SqliteConnection* database) {
  if (!IsHalfConvertible(database)) return "";
  return " was written by COLMAP 3.10, whose pose_priors COLMAP 4 cannot read; "
         "add the column position_covariance BLOB to that table";
}

}  // namespace adasfm
