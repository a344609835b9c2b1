// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/host_program.h"

#include <unistd.h>
#include <util/version.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "colmap_ext/host/database_schema.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

using Version = std::pair<int, int>;

std::string FindOnPath() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  std::string folder;
  while (std::getline(folders, folder, ':')) {
    const std::string candidate = folder + "/colmap";
    if (IsProgram(candidate) && !IsThisProgram(candidate)) return candidate;
  }
  return "";
}

std::string Quote(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

// The first version that opens a file of this form. The columns that COLMAP 3.8
// needs may be there beside newer tables.
Version NeededVersion(SqliteConnection* database) {
  if (HasColumn(database, "images", "prior_qw")) return {3, 6};
  if (HasColumn(database, "pose_priors", "corr_data_id")) return {4, 0};
  if (database->HasTable("frames")) return {3, 12};
  return {3, 10};
}

}  // namespace

bool IsProgram(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

bool IsThisProgram(const std::string& path) {
  std::error_code error;
  return fs::equivalent(path, "/proc/self/exe", error);
}

std::string FindHostProgram() {
  const char* chosen = std::getenv("ADASFM_HOST_COLMAP");
  if (chosen != nullptr && *chosen != '\0') return chosen;
  if (IsProgram(ADASFM_HOST_COLMAP)) return ADASFM_HOST_COLMAP;
  const std::string found = FindOnPath();
  return found.empty() ? ADASFM_HOST_COLMAP : found;
}

std::string ReadHostVersion(const std::string& path) {
  if (!IsProgram(path) || IsThisProgram(path)) return "";
  FILE* pipe = popen((Quote(path) + " help 2> /dev/null").c_str(), "r");
  if (pipe == nullptr) return "";
  char line[256] = "";
  const bool has_line = std::fgets(line, sizeof(line), pipe) != nullptr;
  // The rest is read, as the host would end with an error otherwise.
  char rest[4096];
  while (std::fread(rest, 1, sizeof(rest), pipe) > 0) {
  }
  pclose(pipe);
  std::string name, version;
  std::istringstream words(has_line ? line : "");
  words >> name >> version;
  return name == "COLMAP" && ParseColmapVersion(version).has_value() ? version
                                                                     : "";
}

std::optional<Version> ParseColmapVersion(const std::string& version) {
  Version numbers;
  if (std::sscanf(version.c_str(), "%d.%d", &numbers.first, &numbers.second) !=
      2) {
    return std::nullopt;
  }
  return numbers;
}

std::string LinkedColmapVersion() { return colmap::COLMAP_VERSION; }

std::string FindHostConflict(const std::string& host_path,
                             const std::string& database_path) {
  std::error_code error;
  if (!fs::is_regular_file(database_path, error) ||
      fs::file_size(database_path, error) == 0) {
    return "";
  }
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    if (FindNewerTables(&database).empty()) return "";
    const std::string host = ReadHostVersion(host_path);
    const std::optional<Version> version = ParseColmapVersion(host);
    if (!version.has_value()) return "";
    const Version needed = NeededVersion(&database);
    if (*version < needed) {
      return database_path + " is of COLMAP " + std::to_string(needed.first) +
             "." + std::to_string(needed.second) + " or later, and " +
             host_path + " is COLMAP " + host +
             ", which stamps its own version on the file and cannot read it; "
             "set ADASFM_HOST_COLMAP to the COLMAP that made it";
    }
    if (*version >= Version(4, 0) &&
        HasColumn(&database, "pose_priors", "image_id") &&
        !HasColumn(&database, "pose_priors", "position_covariance")) {
      return database_path + " is of COLMAP 3.10, which COLMAP " + host +
             " fails to convert; this helps: sqlite3 " + database_path +
             " 'ALTER TABLE pose_priors ADD COLUMN position_covariance BLOB'";
    }
  } catch (const SqliteError&) {
    // Not ours to judge.
  }
  return "";
}

}  // namespace adasfm
