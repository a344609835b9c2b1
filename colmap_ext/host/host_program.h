// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/status.h"

namespace adasfm {

// The user's own colmap, which gets all commands but ours.

// The one that the environment variable ADASFM_HOST_COLMAP names, else the one
// that we were built with, else the first other colmap on the PATH: a package
// does not know where it will be. May be no program.
std::string FindHostProgram();

// An executable file.
bool IsProgram(const std::string& path);

// The running program: handing over to ourselves would never end.
bool IsThisProgram(const std::string& path);

// What `path arguments` prints on both streams; empty for what is no program.
std::string ReadHostHelp(const std::string& path, const std::string& arguments);

// Runs the program to its end; what it prints goes to the end of log_path.
// `report` is called ten times a second; when it throws, the program is stopped
// first. An error, which names the log, when the program cannot be started or
// fails.
Status RunHost(const std::string& path,
               const std::vector<std::string>& arguments,
               const std::string& log_path,
               const std::function<void()>& report);

// The version that the first line of its help says; empty when it says none.
std::string ReadHostVersion(const std::string& path);

// Major and minor number of a version such as "4.2.1" or "3.10-dev".
std::optional<std::pair<int, int>> ParseColmapVersion(
    const std::string& version);

// The version of the library that we are linked with.
std::string LinkedColmapVersion();

// One line why the host must not open this database, as its COLMAP is too old
// for the file, or cannot convert it; empty when it may, and for what is no
// database. The host is asked for its version only when the answer depends on
// it.
std::string FindHostConflict(const std::string& host_path,
                             const std::string& database_path);

}  // namespace adasfm
