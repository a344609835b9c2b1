// SPDX-License-Identifier: BSD-3-Clause
// The `colmap` that users call: runs the adasfm_* commands itself and hands
// every other command line, unchanged, to the host's colmap.

#include <alloca.h>
#include <limits.h>
#include <sys/resource.h>
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

// OpenBLAS built with OpenMP allocates a buffer for each thread before main
// begins, and waits forever when an address space limit denies a buffer. Our
// commands need the buffer of one thread only. Under a limit, the program
// therefore restarts itself with a single OpenMP thread, and main restores the
// user's variable.
constexpr char kThreadsVariable[] = "OMP_NUM_THREADS";
constexpr char kOneThread[] = "OMP_NUM_THREADS=1";
constexpr char kUsersThreadsVariable[] = "ADASFM_USERS_OMP_NUM_THREADS";

// Measured on Debian 12: with 380000 kB there is no room for even one buffer,
// with 390000 kB other libraries abort, with 400000 kB our commands start.
constexpr rlim_t kMinAddressSpaceToBegin = 400 << 20;
constexpr char kNoRoomToBegin[] =
    "ERROR: the limit of address space (ulimit -v) is below 409600 kB, in "
    "which this program cannot begin; raise the limit\n";

// Runs before the sanitizers' libraries are initialised.
#define ADASFM_NOT_SANITIZED \
  __attribute__((no_sanitize("address", "thread", "undefined")))

// The value of an environment entry `name=value`; null for entries of other
// variables.
ADASFM_NOT_SANITIZED
const char* FindValue(const char* entry, const char* name) {
  const size_t length = std::strlen(name);
  const bool is_it =
      std::strncmp(entry, name, length) == 0 && entry[length] == '=';
  return is_it ? entry + length + 1 : nullptr;
}

// Called after libraries are loaded but before any of their code has run, so it
// cannot use most of them. On failure the program just continues.
ADASFM_NOT_SANITIZED
void BeginWithOneOpenMpThread(int, char** argv, char** environment) {
  rlimit limit;
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return;
  }
  if (limit.rlim_cur < kMinAddressSpaceToBegin) {
    [[maybe_unused]] const ssize_t written =
        write(STDERR_FILENO, kNoRoomToBegin, sizeof(kNoRoomToBegin) - 1);
    _exit(EXIT_FAILURE);
  }
  const char* users_value = "";
  size_t size = 0;
  for (; environment[size] != nullptr; ++size) {
    if (FindValue(environment[size], kUsersThreadsVariable)) return;
    const char* value = FindValue(environment[size], kThreadsVariable);
    if (value != nullptr) users_value = value;
  }
  char program[PATH_MAX];
  const ssize_t length = readlink("/proc/self/exe", program, PATH_MAX);
  if (length <= 0 || length == PATH_MAX) return;
  program[length] = '\0';

  const auto users_entry = static_cast<char*>(
      alloca(sizeof(kUsersThreadsVariable) + 1 + std::strlen(users_value)));
  stpcpy(stpcpy(stpcpy(users_entry, kUsersThreadsVariable), "="), users_value);

  const auto entries =
      static_cast<const char**>(alloca((size + 3) * sizeof(char*)));
  size_t num_entries = 0;
  for (size_t i = 0; i < size; ++i) {
    if (FindValue(environment[i], kThreadsVariable)) continue;
    entries[num_entries++] = environment[i];
  }
  entries[num_entries++] = kOneThread;
  entries[num_entries++] = users_entry;
  entries[num_entries] = nullptr;
  execve(program, argv, const_cast<char**>(entries));
}

using Start = void(int, char**, char**);
__attribute__((section(".preinit_array"), used)) Start* const kBeforeLibraries =
    &BeginWithOneOpenMpThread;

// Restores the user's value for the programs that this one calls.
void RestoreUsersThreads() {
  const char* value = std::getenv(kUsersThreadsVariable);
  if (value == nullptr) return;
  if (*value == '\0') {
    unsetenv(kThreadsVariable);
  } else {
    setenv(kThreadsVariable, value, /*overwrite=*/1);
  }
  unsetenv(kUsersThreadsVariable);
}

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
  // If the host is a launcher like this one, it must not call this one again.
  setenv(kHostVariable, path.c_str(), /*overwrite=*/1);
  return true;
}

// Replaces this process, so that the host determines exit code and signals.
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
  RestoreUsersThreads();
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
