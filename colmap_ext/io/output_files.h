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
// renames it. Of writers at the same time, threads or processes, the last one's
// text stays, whole. The error names the cause, such as a full disk.
Status WriteTextFile(const std::string& path, const std::string& text);

// An error when no file can be written there: the folder is missing or not
// writable, or the path is a folder.
Status CheckOutputFile(const std::string& path);

// An error when the output is one of the inputs, under whatever name. An input
// is the option that names it and its path; empty paths are passed over.
Status CheckOutputIsNoInput(
    const std::string& output_path,
    const std::vector<std::pair<std::string, std::string>>& inputs);

// Waits until the content of a file, or the names in a folder, are on the disk.
Status SyncToDisk(const std::string& path);

// For a file that another library's class wrote without success and without
// saying why: what the system says when more is written to it, and what helps.
// The file is to be thrown away afterwards.
std::string DescribeWriteFailure(const std::string& path);

}  // namespace adasfm
