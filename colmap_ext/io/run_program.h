// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// A word of a shell's command line that stands for the text itself.
std::string QuoteForShell(const std::string& text);

// Runs a program of the PATH and gives each line of its standard output to
// on_line as it comes; standard error goes to the file log_path. When on_line
// throws, the program loses its output, which ends it. An error for a program
// that is not there, or that fails, with the last line of the log.
Status RunProgram(const std::vector<std::string>& words,
                  const std::string& log_path,
                  const std::function<void(const std::string&)>& on_line);

}  // namespace adasfm
