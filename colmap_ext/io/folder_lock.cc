// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

namespace adasfm {
namespace {

std::string ProgramName() {
  // NUL separates the arguments; the command is the launcher's second argument.
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::string program, command;
  std::getline(file, program, '\0');
  std::getline(file, command, '\0');
  return command.rfind("adasfm_", 0) == 0 ? command : program;
}

// "adasfm_mapper, process 123 on robot".
std::string DescribeThisRun() {
  char host[256] = "";
  gethostname(host, sizeof(host) - 1);
  return ProgramName() + ", process " + std::to_string(getpid()) + " on " +
         host;
}

std::string ReadHolder(const std::string& path) {
  std::ifstream file(path);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  return text.empty() ? "another run" : text;
}

}  // namespace

StatusOr<std::shared_ptr<FolderLock>> FolderLock::Acquire(
    const std::string& folder, Mode mode, const std::string& name) {
  const std::string path = folder + "/" + name;
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (file < 0) {
    return Status::Error("cannot write " + path + ": " + std::strerror(errno) +
                         "; choose a folder that is writable");
  }
  const int operation = mode == Mode::kExclusive ? LOCK_EX : LOCK_SH;
  if (flock(file, operation | LOCK_NB) != 0) {
    const bool is_held = errno == EWOULDBLOCK;
    close(file);
    if (!is_held) return std::shared_ptr<FolderLock>(new FolderLock(-1));
    return Status::Error("the folder " + folder + " is in use by " +
                         ReadHolder(path) +
                         "; wait for its end, or choose another folder");
  }
  // Only for the messages of other runs; errors do not matter.
  const std::string holder = DescribeThisRun();
  if (ftruncate(file, 0) != 0 ||
      pwrite(file, holder.data(), holder.size(), 0) < 0) {
    errno = 0;
  }
  return std::shared_ptr<FolderLock>(new FolderLock(file));
}

FolderLock::~FolderLock() {
  if (file_ >= 0) close(file_);
}

}  // namespace adasfm
