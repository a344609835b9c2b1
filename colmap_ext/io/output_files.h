// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/status.h"

namespace adasfm {

// Creates the folder, and its parents, unless it exists; an error when it
// cannot be written to.
Status PrepareOutputFolder(const std::string& path);

// Writes a file under a temporary name, waits until it is on the disk and
// renames it. Of concurrent writers (threads or processes), the last one's text
// remains complete. The error names the cause, such as a full disk.
Status WriteTextFile(const std::string& path, const std::string& text);

// An error when no file can be written at the path: the folder is missing or
// not writable, or the path is a folder.
Status CheckOutputFile(const std::string& path);

// An error when the output is one of the inputs, even under another name. An
// input is a pair of its option's name and its path; empty paths are skipped.
Status CheckOutputIsNoInput(
    const std::string& output_path,
    const std::vector<std::pair<std::string, std::string>>& inputs);

// Waits until the content of a file, or the names in a folder, are on the disk.
Status SyncToDisk(const std::string& path);

// For a file that another library failed to write without giving a reason.
// Returns the system's error when more is written to the file, and advice. The
// file must be removed afterwards.
std::string DescribeWriteFailure(const std::string& path);

}  // namespace adasfm
