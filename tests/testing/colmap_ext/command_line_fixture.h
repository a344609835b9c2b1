// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/testing/colmap_ext/temporary_folder.h"
#include "tests/testing/paths.h"

namespace adasfm {

// Calls the launcher as a user does.
class CommandLineTest : public testing::Test {
 protected:
  struct Run {
    int status = 0;  // of waitpid
    std::string out;
    std::string err;
    int ExitCode() const {
      return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
  };

  Run Call(const std::string& arguments, const std::string& environment = "") {
    Run run;
    run.status =
        std::system((environment + " " + LauncherPath() + " " + arguments +
                     " > " + folder_.File("out") + " 2> " + folder_.File("err"))
                        .c_str());
    run.out = ReadBytes(folder_.File("out"));
    run.err = ReadBytes(folder_.File("err"));
    return run;
  }

  void ExpectSuccess(const std::string& arguments) {
    const Run run = Call(arguments);
    ASSERT_EQ(run.ExitCode(), 0) << arguments << "\n" << run.out << run.err;
  }

  // One line on standard error, exit code 1.
  void ExpectError(const std::string& arguments, const std::string& message,
                   const std::string& environment = "") {
    const Run run = Call(arguments, environment);
    EXPECT_EQ(run.ExitCode(), 1) << arguments << "\n" << run.err;
    EXPECT_EQ(run.err.rfind("ERROR: ", 0), 0) << run.err;
    EXPECT_EQ(run.err.find('\n'), run.err.size() - 1) << run.err;
    EXPECT_NE(run.err.find(message), std::string::npos)
        << "expected: " << message << "\n"
        << run.err;
  }

  std::string WriteScript(const std::string& text) {
    const std::string path = folder_.Write("host", "#!/bin/sh\n" + text);
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return path;
  }

  TemporaryFolder folder_;
};

}  // namespace adasfm
