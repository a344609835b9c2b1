// SPDX-License-Identifier: BSD-3-Clause
// The `colmap` that users call: runs the adasfm_* commands itself and hands
// every other command line, unchanged, to the host's colmap.

#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <string>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/host/host_program.h"

namespace {

using adasfm::FindHostProgram;
using adasfm::IsProgram;
using adasfm::IsThisProgram;

constexpr char kHostVariable[] = "ADASFM_HOST_COLMAP";

// The database that a command line names; empty without one.
std::string FindDatabasePath(char** argv) {
  const std::string name = "--database_path";
  for (; *argv != nullptr; ++argv) {
    const std::string argument = *argv;
    if (argument == name) return argv[1] == nullptr ? "" : argv[1];
    if (argument.rfind(name + "=", 0) == 0) {
      return argument.substr(name.size() + 1);
    }
  }
  return "";
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
  const std::string path = FindHostProgram();
  if (!CheckHost(path)) return EXIT_FAILURE;
  const std::string conflict =
      adasfm::FindHostConflict(path, FindDatabasePath(argv));
  if (!conflict.empty()) std::cerr << "WARNING: " << conflict << std::endl;
  std::cout.flush();
  execv(path.c_str(), argv);
  std::cerr << "ERROR: cannot run the host's colmap, " << path << ": "
            << std::strerror(errno) << std::endl;
  return EXIT_FAILURE;
}

// Runs the host's help in a child; false when that was not possible.
bool ShowHostHelp(char** argv) {
  const std::string path = FindHostProgram();
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
