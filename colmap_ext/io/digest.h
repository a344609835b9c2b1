// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// Short texts that change when files do, to tell whether a result is outdated.

// Of a text.
std::string DigestText(const std::string& text);

// Of a file's bytes or, for a folder, of its files' names and sizes. "none" for
// an empty path. An error when there is no such file.
StatusOr<std::string> DigestPath(const std::string& path);

// The digests of several paths, each with its name.
StatusOr<std::map<std::string, std::string>> DigestPaths(
    const std::map<std::string, std::string>& paths);

// Of the names and sizes of files below a folder.
std::string DigestFiles(const std::string& folder,
                        const std::vector<std::string>& names);

// The regular files below a folder, hidden ones left out, as paths relative to
// it, sorted; without those in `excluded`, a folder that may lie in it. Links
// are followed, but none to a folder that holds the link.
StatusOr<std::vector<std::string>> ListFilesRecursively(
    const std::string& folder, const std::string& excluded = "");

}  // namespace adasfm
