// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/output_files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// More than the largest buffer of a file system or a library.
constexpr size_t kProbeBytes = 1 << 20;

std::string AdviceFor(int error) {
  switch (error) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return "make room, or choose another folder, and run again";
    case EIO:
      return "check the disk";
    default:
      return "choose a path in a folder that is writable";
  }
}

std::string ReasonAndAdvice(int error) {
  return std::string(std::strerror(error)) + "; " + AdviceFor(error);
}

// Returns 0, or the error of the system.
int WriteAll(int file, const char* data, size_t num_bytes) {
  while (num_bytes > 0) {
    const ssize_t written = write(file, data, num_bytes);
    if (written < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    data += written;
    num_bytes -= written;
  }
  return 0;
}

// Whether the path still refers to the open file.
bool HasName(int file, const std::string& path) {
  struct stat opened, named;
  return fstat(file, &opened) == 0 && stat(path.c_str(), &named) == 0 &&
         opened.st_dev == named.st_dev && opened.st_ino == named.st_ino;
}

// Opens or creates a file exclusively for this writer until it is closed; on
// failure -1, with the reason in errno. File systems without locks, or whose
// files change their identity, are assumed to have one writer.
int OpenAlone(const std::string& path) {
  constexpr int kMaxNumWritersBefore = 1000;
  for (int num_before = 0;; ++num_before) {
    const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
    if (file < 0) return file;
    while (flock(file, LOCK_EX) != 0 && errno == EINTR) {
    }
    if (HasName(file, path) || num_before == kMaxNumWritersBefore) return file;
    close(file);  // The writer before has renamed it.
  }
}

// Replaces the file's content, syncs the file and renames it.
int WriteAndRename(int file, const std::string& text,
                   const std::string& temporary, const std::string& path) {
  if (ftruncate(file, 0) != 0) return errno;
  const int error = WriteAll(file, text.data(), text.size());
  if (error != 0) return error;
  if (fsync(file) != 0) return errno;
  return rename(temporary.c_str(), path.c_str()) == 0 ? 0 : errno;
}

// Some file systems cannot sync folders, or cannot sync at all.
bool IsUnsupported(int error) { return error == EINVAL || error == ENOTSUP; }

}  // namespace

Status PrepareOutputFolder(const std::string& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (!fs::is_directory(path)) {
    return Status::Error(
        "cannot create the output folder " + path + ": " +
        (error ? error.message() : std::string("a file is in the way")) +
        "; choose another folder");
  }
  if (access(path.c_str(), W_OK | X_OK) != 0) {
    return Status::Error("the output folder " + path +
                         " is not writable; choose another folder");
  }
  return Status::Ok();
}

Status WriteTextFile(const std::string& path, const std::string& text) {
  const std::string temporary = path + ".tmp";
  const int file = OpenAlone(temporary);
  int error = file < 0 ? errno : WriteAndRename(file, text, temporary, path);
  if (file >= 0) {
    // Before others may open the file.
    if (error != 0) unlink(temporary.c_str());
    close(file);
  }
  if (error != 0) {
    return Status::Error("cannot write " + path + ": " +
                         ReasonAndAdvice(error));
  }
  const std::string folder = fs::path(path).parent_path().string();
  return SyncToDisk(folder.empty() ? "." : folder);
}

Status CheckOutputFile(const std::string& path) {
  const fs::path folder = fs::path(path).parent_path();
  std::error_code none;
  if (fs::is_directory(path, none)) {
    return Status::Error("cannot write " + path +
                         ": it is a folder; choose a file in it");
  }
  if (access(folder.empty() ? "." : folder.c_str(), W_OK | X_OK) == 0) {
    return Status::Ok();
  }
  return Status::Error("cannot write " + path + ": " + ReasonAndAdvice(errno));
}

Status CheckOutputIsNoInput(
    const std::string& output_path,
    const std::vector<std::pair<std::string, std::string>>& inputs) {
  for (const auto& [option, path] : inputs) {
    std::error_code none;
    if (path.empty() || !fs::equivalent(output_path, path, none)) continue;
    return Status::Error("the output " + output_path + " is the input --" +
                         option + "; choose another path for it");
  }
  return Status::Ok();
}

Status SyncToDisk(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  int error = file < 0 ? errno : 0;
  if (error == 0 && fsync(file) != 0) error = errno;
  if (file >= 0) close(file);
  if (error == 0 || IsUnsupported(error)) return Status::Ok();
  return Status::Error("cannot write " + path +
                       " to the disk: " + ReasonAndAdvice(error));
}

std::string DescribeWriteFailure(const std::string& path) {
  const int file = open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (file < 0) return ReasonAndAdvice(errno);
  int error =
      WriteAll(file, std::string(kProbeBytes, '\0').data(), kProbeBytes);
  if (error == 0 && fsync(file) != 0) error = errno;
  close(file);
  return error != 0 ? ReasonAndAdvice(error)
                    : "a part of it was not written; check the free space and "
                      "run again";
}

}  // namespace adasfm
