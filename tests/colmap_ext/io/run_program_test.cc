// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/run_program.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

class RunProgramTest : public testing::Test {
 protected:
  Status Run(const std::vector<std::string>& words) {
    lines_.clear();
    return RunProgram(
        words, folder_.File("log"),
        [this](const std::string& line) { lines_.push_back(line); });
  }

  TemporaryFolder folder_;
  std::vector<std::string> lines_;
};

TEST_F(RunProgramTest, LinesComeAsTheyArePrinted) {
  const std::string odd = "it's $HOME; `x` \"y\"  z";
  ASSERT_TRUE(Run({"printf", "%s\\n", "one", odd}).ok());
  EXPECT_EQ(lines_, (std::vector<std::string>{"one", odd}));
}

TEST_F(RunProgramTest, FailuresSayWhatTheProgramSaid) {
  EXPECT_NE(Run({"sh", "-c", "echo first >&2; echo last >&2; exit 3"})
                .message()
                .find("sh failed: last"),
            std::string::npos);
  EXPECT_NE(Run({"adasfm-no-such-program"}).message().find("not on the PATH"),
            std::string::npos);
}

// RunProgram throws only after the program has ended.
TEST_F(RunProgramTest, AThrowEndsTheProgram) {
  EXPECT_THROW(
      RunProgram({"yes"}, folder_.File("log"),
                 [](const std::string&) { throw std::runtime_error("stop"); }),
      std::runtime_error);
}

}  // namespace
}  // namespace adasfm
