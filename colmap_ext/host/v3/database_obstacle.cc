// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/database_schema.h"

namespace adasfm {

std::string WhyLibraryMustNotOpen(SqliteConnection* database) {
  const std::vector<std::string> tables = FindNewerTables(database);
  if (tables.empty()) return "";
  return " was written by a newer COLMAP (it has the table " + tables.front() +
         "), and this program extracts and matches with COLMAP 3.8's library, "
         "which would damage it; set ADASFM_HOST_COLMAP to the COLMAP that "
         "made it";
}

}  // namespace adasfm
