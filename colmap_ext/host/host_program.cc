// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/host_program.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <thread>

#include "colmap_ext/host/database_schema.h"
#include "colmap_ext/io/run_program.h"

namespace adasfm {
namespace {

// Volatile, so that the path stays in the program's binary in one piece, where
// a packager can find and replace it.
const char* volatile kBuiltInHost = ADASFM_HOST_COLMAP;

namespace fs = std::filesystem;

using Version = std::pair<int, int>;

constexpr std::chrono::milliseconds kPollInterval(100);

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

// The first version that opens a file of this form. A file with newer tables
// may also have the columns that COLMAP 3.8 needs.
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
  const std::string built_in = kBuiltInHost;
  if (IsProgram(built_in)) return built_in;
  const std::string found = FindOnPath();
  return found.empty() ? built_in : found;
}

std::string ReadHostHelp(const std::string& path,
                         const std::string& arguments) {
  if (!IsProgram(path) || IsThisProgram(path)) return "";
  FILE* pipe =
      popen((QuoteForShell(path) + " " + arguments + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return "";
  std::string text;
  char block[4096];
  for (size_t size; (size = std::fread(block, 1, sizeof(block), pipe)) > 0;) {
    text.append(block, size);
  }
  pclose(pipe);
  return text;
}

std::string ReadHostVersion(const std::string& path) {
  std::istringstream lines(ReadHostHelp(path, "help"));
  std::string name, version;
  lines >> name >> version;
  return name == "COLMAP" && ParseColmapVersion(version).has_value() ? version
                                                                     : "";
}

Status RunHost(const std::string& path,
               const std::vector<std::string>& arguments,
               const std::string& log_path,
               const std::function<void()>& report) {
  if (!IsProgram(path) || IsThisProgram(path)) {
    return Status::Error("the host's colmap, " + path +
                         ", is not another program; set the environment "
                         "variable ADASFM_HOST_COLMAP to COLMAP's own colmap");
  }
  const int log =
      open(log_path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (log < 0) return Status::Error("cannot write " + log_path);
  std::vector<char*> words = {const_cast<char*>(path.c_str())};
  for (const std::string& argument : arguments) {
    words.push_back(const_cast<char*>(argument.c_str()));
  }
  words.push_back(nullptr);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child == 0) {
    // A second Ctrl-C ends this program at once, but not one that handles it.
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent) _exit(EXIT_FAILURE);
    dup2(log, STDOUT_FILENO);
    dup2(log, STDERR_FILENO);
    execv(path.c_str(), words.data());
    _exit(EXIT_FAILURE);
  }
  close(log);
  if (child < 0) return Status::Error("cannot start " + path);
  int status = 0;
  try {
    while (waitpid(child, &status, WNOHANG) == 0) {
      std::this_thread::sleep_for(kPollInterval);
      report();
    }
  } catch (...) {
    kill(child, SIGTERM);
    waitpid(child, &status, 0);
    throw;
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == EXIT_SUCCESS) {
    return Status::Ok();
  }
  // Ctrl-C on a terminal ends the program, too; report() then throws.
  report();
  return Status::Error("the host's colmap, " + path + ", failed in " +
                       arguments.front() + "; see " + log_path);
}

std::optional<Version> ParseColmapVersion(const std::string& version) {
  Version numbers;
  if (std::sscanf(version.c_str(), "%d.%d", &numbers.first, &numbers.second) !=
      2) {
    return std::nullopt;
  }
  return numbers;
}

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
    if (*version >= Version(4, 0) && IsHalfConvertible(&database)) {
      return database_path + " is of COLMAP 3.10, which COLMAP " + host +
             " fails to convert; this helps: sqlite3 " + database_path +
             " 'ALTER TABLE pose_priors ADD COLUMN position_covariance BLOB'";
    }
  } catch (const SqliteError&) {
    // Other code reports an unreadable database.
  }
  return "";
}

}  // namespace adasfm
