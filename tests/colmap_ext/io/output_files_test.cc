// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/output_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "colmap_ext/io/digest.h"
#include "colmap_ext/io/folder_lock.h"
#include "tests/testing/colmap_ext/file_size_limit.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

using testing::HasSubstr;

TEST(WriteTextFile, NamesTheCauseAndKeepsTheOldFile) {
  const TemporaryFolder folder;
  const std::string path = folder.Write("text", "old");
  {
    const FileSizeLimit limit(100);
    const Status status = WriteTextFile(path, std::string(1000, 'x'));
    ASSERT_FALSE(status.ok());
    EXPECT_THAT(status.message(), HasSubstr("File too large; make room"));
  }
  EXPECT_EQ(ReadBytes(path), "old");
  EXPECT_FALSE(std::filesystem::exists(path + ".tmp"));
  ASSERT_TRUE(WriteTextFile(path, "new").ok());
  EXPECT_EQ(ReadBytes(path), "new");
  EXPECT_THAT(WriteTextFile(folder.File("none/text"), "x").message(),
              HasSubstr("No such file"));
}

TEST(WriteTextFile, WritersAtTheSameTimeLeaveOneWholeText) {
  constexpr size_t kNumBytes = 200000;
  const TemporaryFolder folder;
  const std::string path = folder.Write("text", std::string(kNumBytes, 'z'));
  std::vector<std::thread> writers;
  for (const char letter : {'a', 'b', 'c', 'd'}) {
    writers.emplace_back([&path, letter] {
      const std::string text(kNumBytes, letter);
      for (int k = 0; k < 25; ++k) {
        const Status status = WriteTextFile(path, text);
        EXPECT_TRUE(status.ok()) << status.message();
        const std::string found = ReadBytes(path);
        EXPECT_EQ(found, std::string(kNumBytes, found[0]));
      }
    });
  }
  for (std::thread& writer : writers) writer.join();
  EXPECT_FALSE(std::filesystem::exists(path + ".tmp"));
}

TEST(CheckOutputIsNoInput, SeesThroughOtherNames) {
  const TemporaryFolder folder;
  const std::string input = folder.Write("input", "x");
  std::filesystem::create_symlink(input, folder.File("link"));
  const auto check = [&](const std::string& output) {
    return CheckOutputIsNoInput(output, {{"none", ""}, {"imu_path", input}});
  };
  EXPECT_THAT(check(input).message(), HasSubstr("--imu_path"));
  EXPECT_FALSE(check(folder.File("link")).ok());
  EXPECT_FALSE(check(folder.Path() + "/../" +
                     std::filesystem::path(folder.Path()).filename().string() +
                     "/input")
                   .ok());
  EXPECT_TRUE(check(folder.File("output")).ok());
}

TEST(FolderLock, KeepsTheSecondOut) {
  using Mode = FolderLock::Mode;
  const TemporaryFolder folder;
  {
    const auto first = FolderLock::Acquire(folder.Path(), Mode::kExclusive);
    ASSERT_TRUE(first.ok());
    for (const Mode mode : {Mode::kExclusive, Mode::kShared}) {
      const auto second = FolderLock::Acquire(folder.Path(), mode);
      ASSERT_FALSE(second.ok());
      EXPECT_THAT(second.status().message(),
                  HasSubstr("process " + std::to_string(getpid())));
    }
    EXPECT_TRUE(
        FolderLock::Acquire(folder.Path(), Mode::kExclusive, "other").ok());
  }
  const auto first = FolderLock::Acquire(folder.Path(), Mode::kShared);
  EXPECT_TRUE(FolderLock::Acquire(folder.Path(), Mode::kShared).ok());
  EXPECT_FALSE(FolderLock::Acquire(folder.Path(), Mode::kExclusive).ok());
}

TEST(ListFilesRecursively, PassesOverLinksThatLeadNowhere) {
  const TemporaryFolder folder;
  folder.Write("photo.jpg", "x");
  std::filesystem::create_symlink("loop", folder.File("loop"));
  std::filesystem::create_symlink("nowhere", folder.File("broken"));
  const auto names = ListFilesRecursively(folder.Path());
  ASSERT_TRUE(names.ok()) << names.status().message();
  EXPECT_THAT(*names, testing::ElementsAre("photo.jpg"));
}

TEST(ListFilesRecursively, FollowsNoLinkInCircles) {
  const TemporaryFolder folder;
  namespace fs = std::filesystem;
  fs::create_directories(folder.File("images/left"));
  fs::create_directories(folder.File("elsewhere"));
  folder.Write("images/left/photo.jpg", "x");
  folder.Write("elsewhere/other.jpg", "x");
  fs::create_directory_symlink(".", folder.File("images/self"));
  fs::create_directory_symlink("..", folder.File("images/left/up"));
  fs::create_directory_symlink("../..", folder.File("images/left/above"));
  fs::create_directory_symlink("../elsewhere", folder.File("images/linked"));
  fs::create_directory_symlink("../images", folder.File("elsewhere/back"));
  const auto names = ListFilesRecursively(folder.File("images"));
  ASSERT_TRUE(names.ok()) << names.status().message();
  EXPECT_THAT(*names,
              testing::ElementsAre("left/photo.jpg", "linked/other.jpg"));
}

}  // namespace
}  // namespace adasfm
