// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/status.h"

namespace adasfm {

// The user's own colmap program, which runs all commands except ours.

// The program that the environment variable ADASFM_HOST_COLMAP names, else the
// one given at build time, else the first other colmap on the PATH: a package
// cannot know its install location. The result may be no program.
std::string FindHostProgram();

// Whether the path is an executable file.
bool IsProgram(const std::string& path);

// Whether the path is the running program, which would otherwise call itself
// forever.
bool IsThisProgram(const std::string& path);

// What `path arguments` prints on both streams; empty when path is no program.
std::string ReadHostHelp(const std::string& path, const std::string& arguments);

// Runs the program to its end and appends its output to log_path. Calls
// `report` ten times a second; when it throws, the program is stopped before
// the exception continues. An error, which names the log, when the program
// cannot be started or fails.
Status RunHost(const std::string& path,
               const std::vector<std::string>& arguments,
               const std::string& log_path,
               const std::function<void()>& report);

// The version in the first line of the program's help; empty when there is
// none.
std::string ReadHostVersion(const std::string& path);

// Major and minor number of a version such as "4.2.1" or "3.10-dev".
std::optional<std::pair<int, int>> ParseColmapVersion(
    const std::string& version);

// The version of the linked library.
std::string LinkedColmapVersion();

// One line that explains why the host must not open this database, because its
// COLMAP is too old for the file or cannot convert it; empty when it may, and
// when the file is no database. The host is asked for its version only when the
// answer depends on it.
std::string FindHostConflict(const std::string& host_path,
                             const std::string& database_path);

}  // namespace adasfm
