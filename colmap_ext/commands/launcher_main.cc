// SPDX-License-Identifier: BSD-3-Clause
// The `colmap` that users call: runs the adasfm_* commands itself and hands
// every other command line, unchanged, to the host's colmap.

#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <string>

#include "colmap_ext/commands/registry.h"

namespace {

namespace fs = std::filesystem;

constexpr char kHostVariable[] = "ADASFM_HOST_COLMAP";

bool IsProgram(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

// Handing over to ourselves would never end.
bool IsThisProgram(const std::string& path) {
  std::error_code error;
  return fs::equivalent(path, "/proc/self/exe", error);
}

// The first colmap on the PATH that is another program; empty without one.
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

// The host that the environment names, else the one that we were built with,
// else the one on the PATH: a package does not know where it will be.
std::string HostPath() {
  const char* chosen = std::getenv(kHostVariable);
  if (chosen != nullptr && *chosen != '\0') return chosen;
  if (IsProgram(ADASFM_HOST_COLMAP)) return ADASFM_HOST_COLMAP;
  const std::string found = FindOnPath();
  return found.empty() ? ADASFM_HOST_COLMAP : found;
}

// Whether the host can be run; otherwise prints why not.
bool CheckHost(const std::string& path) {
  const char* advice =
      "; set the environment variable ADASFM_HOST_COLMAP to COLMAP's own "
      "colmap";
  if (!IsProgram(path)) {
    std::cerr << "ERROR: the host's colmap, " << path
              << ", is not an executable file" << advice << std::endl;
    return false;
  }
  if (IsThisProgram(path)) {
    std::cerr << "ERROR: the host's colmap, " << path << ", is this program"
              << advice << std::endl;
    return false;
  }
  // If the host is another of our kind, it must not hand back to us.
  setenv(kHostVariable, path.c_str(), /*overwrite=*/1);
  return true;
}

// Replaces this process, so that exit code and signals are the host's.
int HandOver(char** argv) {
  const std::string path = HostPath();
  if (!CheckHost(path)) return EXIT_FAILURE;
  std::cout.flush();
  execv(path.c_str(), argv);
  std::cerr << "ERROR: cannot run the host's colmap, " << path << ": "
            << std::strerror(errno) << std::endl;
  return EXIT_FAILURE;
}

// Runs the host's help in a child; false when that was not possible.
bool ShowHostHelp(char** argv) {
  const std::string path = HostPath();
  if (!CheckHost(path)) return false;
  std::cout.flush();
  const pid_t child = fork();
  if (child < 0) return false;
  if (child == 0) {
    execv(path.c_str(), argv);
    _exit(EXIT_FAILURE);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == EXIT_SUCCESS;
}

int ShowHelp(char** argv) {
  const bool host_shown = ShowHostHelp(argv);
  std::printf("AdaSfM commands (`colmap COMMAND -h` explains the options):\n");
  for (const adasfm::Command& command : adasfm::Commands()) {
    std::printf("  %-26s %s\n", command.name, command.description);
  }
  std::printf("\n");
  return host_shown ? EXIT_SUCCESS : EXIT_FAILURE;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string name = argc > 1 ? argv[1] : "help";
  if (name == "help" || name == "-h" || name == "--help") {
    return ShowHelp(argv);
  }
  if (name.rfind("adasfm_", 0) != 0) return HandOver(argv);
  const adasfm::Command* command = adasfm::FindCommand(name);
  if (command == nullptr) {
    std::cerr << "ERROR: unknown command `" << name
              << "`; `colmap help` lists the commands" << std::endl;
    return EXIT_FAILURE;
  }
  return adasfm::RunCommand(*command, argc - 1, argv + 1);
}
