// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// Short texts that change when files do, to detect outdated results.

// Of a text.
std::string DigestText(const std::string& text);

// Of a file's bytes or, for a folder, of its files' names and sizes. "none" for
// an empty path. An error when nothing exists at the path.
StatusOr<std::string> DigestPath(const std::string& path);

// The digests of several paths, each with its name.
StatusOr<std::map<std::string, std::string>> DigestPaths(
    const std::map<std::string, std::string>& paths);

// Of the names and sizes of files below a folder.
std::string DigestFiles(const std::string& folder,
                        const std::vector<std::string>& names);

// The regular files below a folder, as sorted paths relative to it. Leaves out
// hidden files and folders, and the folder `excluded`, which may lie in
// `folder`. Follows links, except links to a folder that contains the link.
StatusOr<std::vector<std::string>> ListFilesRecursively(
    const std::string& folder, const std::string& excluded = "");

}  // namespace adasfm
