// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// Quotes a text as one word of a shell's command line.
std::string QuoteForShell(const std::string& text);

// Runs a program of the PATH, passes each line of its standard output to
// on_line as it arrives, and writes standard error to the file log_path. When
// on_line throws, the program's output is closed, which ends the program. An
// error for a program that is missing or fails, with the last line of the log.
Status RunProgram(const std::vector<std::string>& words,
                  const std::string& log_path,
                  const std::function<void(const std::string&)>& on_line);

}  // namespace adasfm
