// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "memory_file.h"
#include "sensors/io/read_imu.h"

namespace {

// A folder of this process that is used again and again; removed at the end.
class OxtsFolder {
 public:
  OxtsFolder()
      : path_(std::filesystem::temp_directory_path().string() + "/fuzz_oxts_" +
              std::to_string(getpid())) {
    std::filesystem::create_directories(path_ + "/data");
  }
  ~OxtsFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  const std::string& path() const { return path_; }

  // The text up to the first zero byte is timestamps.txt, each one after it a
  // packet of data/; packets of the last input are removed.
  void Write(const std::string& text) {
    constexpr int kMaxNumPackets = 4;
    size_t end = text.find('\0');
    std::ofstream(path_ + "/timestamps.txt") << text.substr(0, end);
    for (int i = 0; i < kMaxNumPackets; ++i) {
      char name[32];
      std::snprintf(name, sizeof(name), "/data/%010d.txt", i);
      if (end == std::string::npos) {
        std::filesystem::remove(path_ + name);
        continue;
      }
      const size_t begin = end + 1;
      end = text.find('\0', begin);
      std::ofstream(path_ + name) << text.substr(begin, end - begin);
    }
  }

 private:
  std::string path_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace adasfm;
  static OxtsFolder folder;
  folder.Write(std::string(reinterpret_cast<const char*>(data), size));
  RequireSoundImuLog(ReadImu(folder.path()));
  return 0;
}
