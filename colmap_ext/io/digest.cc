// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/digest.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "core/hash.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// Whether the entry is a link to a folder that contains it.
bool IsCircle(const fs::path& path) {
  std::error_code none;
  if (!fs::is_symlink(path, none)) return false;
  for (fs::path above = fs::absolute(path, none).lexically_normal();
       above != above.parent_path();) {
    above = above.parent_path();
    if (fs::equivalent(above, path, none)) return true;
  }
  return false;
}

}  // namespace

std::string DigestText(const std::string& text) {
  Fnv1aHash hash;
  hash.AddBytes(text.data(), text.size());
  return hash.Text();
}

StatusOr<std::string> DigestPath(const std::string& path) {
  if (path.empty()) return std::string("none");
  std::error_code error;
  if (fs::is_directory(path, error)) {
    const StatusOr<std::vector<std::string>> names = ListFilesRecursively(path);
    if (!names.ok()) return names.status();
    return DigestFiles(path, *names);
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    return Status::Error("cannot read " + path + "; check the path");
  }
  Fnv1aHash hash;
  std::vector<char> block(1 << 20);
  while (file.read(block.data(), block.size()) || file.gcount() > 0) {
    hash.AddBytes(block.data(), file.gcount());
  }
  return hash.Text();
}

StatusOr<std::map<std::string, std::string>> DigestPaths(
    const std::map<std::string, std::string>& paths) {
  std::map<std::string, std::string> digests;
  for (const auto& [name, path] : paths) {
    const StatusOr<std::string> digest = DigestPath(path);
    if (!digest.ok()) return digest.status();
    digests[name] = *digest;
  }
  return digests;
}

std::string DigestFiles(const std::string& folder,
                        const std::vector<std::string>& names) {
  Fnv1aHash hash;
  for (const std::string& name : names) {
    std::error_code error;
    const std::string size =
        std::to_string(fs::file_size(fs::path(folder) / name, error));
    hash.AddBytes(name.c_str(), name.size() + 1);
    hash.AddBytes(size.c_str(), size.size() + 1);
  }
  return std::to_string(names.size()) + " files, " + hash.Text();
}

StatusOr<std::vector<std::string>> ListFilesRecursively(
    const std::string& folder, const std::string& excluded) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return Status::Error("the folder " + folder +
                         " does not exist; check --image_path");
  }
  std::vector<std::string> names;
  fs::recursive_directory_iterator entry(
      folder, fs::directory_options::follow_directory_symlink, error);
  for (; !error && entry != fs::recursive_directory_iterator();
       entry.increment(error)) {
    const bool is_hidden = entry->path().filename().string()[0] == '.';
    // A link to nothing, or to itself, is no file.
    std::error_code none;
    if (entry->is_directory(none)) {
      if (is_hidden || IsCircle(entry->path()) ||
          (!excluded.empty() &&
           fs::equivalent(entry->path(), excluded, none))) {
        entry.disable_recursion_pending();
      }
      continue;
    }
    if (is_hidden || !entry->is_regular_file(none)) continue;
    names.push_back(entry->path().lexically_relative(folder).generic_string());
  }
  if (error) {
    return Status::Error("cannot read the folder " + folder + ": " +
                         error.message());
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace adasfm
