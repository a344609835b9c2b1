// SPDX-License-Identifier: BSD-3-Clause
#include "core/sparse/huge_pages.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>
#include <sstream>
#include <string>

namespace adasfm {
namespace {

// Whether the kernel has been asked for huge pages at this address.
bool IsAdvised(const void* address) {
  std::ifstream file("/proc/self/smaps");
  std::string line;
  bool is_here = false;
  while (std::getline(file, line)) {
    uintptr_t begin = 0, end = 0;
    char dash = 0;
    if (std::istringstream(line) >> std::hex >> begin >> dash >> end &&
        dash == '-') {
      const uintptr_t wanted = reinterpret_cast<uintptr_t>(address);
      is_here = begin <= wanted && wanted < end;
    } else if (is_here && line.rfind("VmFlags:", 0) == 0) {
      return (line + " ").find(" hg ") != std::string::npos;
    }
  }
  return false;
}

class Mapping {
 public:
  explicit Mapping(size_t size)
      : size_(size),
        begin_(mmap(nullptr, size, PROT_READ | PROT_WRITE,
                    MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)) {}
  ~Mapping() { munmap(begin_, size_); }
  char* At(size_t offset) const { return static_cast<char*>(begin_) + offset; }

 private:
  size_t size_;
  void* begin_;
};

TEST(AdviseHugePages, OfTheArrayAlone) {
  if (!std::ifstream("/sys/kernel/mm/transparent_hugepage/enabled")) {
    GTEST_SKIP() << "The kernel has no huge pages.";
  }
  constexpr size_t kMiB = 1 << 20;
  const Mapping mapping(100 * kMiB);
  const size_t page = sysconf(_SC_PAGESIZE);
  // The array begins and ends within pages that others may use.
  AdviseHugePages(mapping.At(10 * kMiB + 16), 40 * kMiB);
  EXPECT_FALSE(IsAdvised(mapping.At(10 * kMiB)));
  EXPECT_TRUE(IsAdvised(mapping.At(10 * kMiB + page)));
  EXPECT_TRUE(IsAdvised(mapping.At(50 * kMiB - 1)));
  EXPECT_FALSE(IsAdvised(mapping.At(50 * kMiB)));
}

TEST(AdviseHugePages, NotOfSmallArrays) {
  constexpr size_t kMiB = 1 << 20;
  const Mapping mapping(100 * kMiB);
  AdviseHugePages(mapping.At(0), 20 * kMiB);
  EXPECT_FALSE(IsAdvised(mapping.At(10 * kMiB)));
  AdviseHugePages(nullptr, 100 * kMiB);
}

}  // namespace
}  // namespace adasfm
