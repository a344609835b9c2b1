// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database_schema.h"

namespace adasfm {

// COLMAP 4 turns all other files into its own form; these it leaves half
// converted.
std::string WhyLibraryMustNotOpen(SqliteConnection* database) {
  if (!database->HasTable("pose_priors") ||
      HasColumn(database, "pose_priors", "position_covariance")) {
    return "";
  }
  return " was written by COLMAP 3.10, whose pose_priors COLMAP 4 cannot read; "
         "add the column position_covariance BLOB to that table";
}

}  // namespace adasfm
