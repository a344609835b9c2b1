// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/output_files.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace adasfm {

namespace fs = std::filesystem;

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
  {
    std::ofstream file(temporary, std::ios::binary);
    file << text;
    file.close();
    if (file) {
      std::error_code error;
      fs::rename(temporary, path, error);
      if (!error) return Status::Ok();
    }
  }
  std::error_code ignored;
  fs::remove(temporary, ignored);
  return Status::Error("cannot write " + path +
                       "; choose a path in a folder that is writable");
}

}  // namespace adasfm
