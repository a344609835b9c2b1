// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/database/two_view_geometry_backup.h"

namespace adasfm {

Status RunAdasfmRestorer(int argc, char** argv) {
  std::string database_path;
  CommandOptions command(
      "adasfm_restorer",
      "Restores, byte for byte, the two-view geometries that adasfm_global "
      "rewrote and the prior rotations that adasfm_global corrected.");
  command.AddRequired("database_path", &database_path,
                      "COLMAP database that adasfm_global rewrote");
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;

  const StatusOr<RestoreSummary> summary =
      RestoreTwoViewGeometries(database_path);
  if (!summary.ok()) return summary.status();
  std::cout << "Two-view geometries restored: " << summary->num_restored
            << std::endl;
  if (summary->priors_restored) {
    std::cout << "The priors are as they were imported" << std::endl;
  }
  if (summary->num_outdated > 0) {
    std::cout << "Left as they are, because COLMAP wrote them anew since: "
              << summary->num_outdated << " (the table "
              << kTwoViewGeometryBackupTable << " still has their older rows)"
              << std::endl;
  }
  return Status::Ok();
}

}  // namespace adasfm
