// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "core/status.h"

namespace adasfm {

inline constexpr char kFolderLockName[] = ".adasfm.lock";

// Keeps a second run out of a folder while this one writes to it.
//
// Method: flock on a hidden file in the folder. The system releases the lock
// when the process ends, however it ends; the file, which names the holder,
// stays. On a file system without locks nothing is locked.
class FolderLock {
 public:
  enum class Mode {
    kExclusive,
    kShared,  // beside others of this mode
  };

  // The folder must exist. `name` distinguishes locks of one folder. Does not
  // wait: an error that names the holder when another run has the lock.
  static StatusOr<std::shared_ptr<FolderLock>> Acquire(
      const std::string& folder, Mode mode,
      const std::string& name = kFolderLockName);

  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  explicit FolderLock(int file) : file_(file) {}

  int file_;  // -1: nothing is locked
};

}  // namespace adasfm
