// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/host/host_program.h"

namespace adasfm {

Status RunAdasfmVersion(int argc, char** argv) {
  CommandOptions command("adasfm_version",
                         "Prints the versions of this program, of the linked "
                         "COLMAP library and of the host's colmap, which runs "
                         "all commands that do not begin with adasfm_.");
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;

  const std::string host = FindHostProgram();
  const std::string version = ReadHostVersion(host);
  std::string host_text = "none: " + host + " is no program";
  if (IsThisProgram(host)) {
    host_text = "none: " + host + " is this program";
  } else if (IsProgram(host)) {
    host_text =
        (version.empty() ? "COLMAP of unknown version" : "COLMAP " + version) +
        " (" + host + ")";
  }
  std::cout << "AdaSfM:  " << ADASFM_VERSION << "\nLibrary: COLMAP "
            << LinkedColmapVersion() << "\nHost:    " << host_text << std::endl;
  return Status::Ok();
}

}  // namespace adasfm
