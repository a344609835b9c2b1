// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/run_program.h"

#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>

namespace adasfm {
namespace {

constexpr int kNotFound = 127;  // exit code of the shell

std::string LastLine(const std::string& path) {
  std::ifstream file(path);
  std::string last;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

}  // namespace

std::string QuoteForShell(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

Status RunProgram(const std::vector<std::string>& words,
                  const std::string& log_path,
                  const std::function<void(const std::string&)>& on_line) {
  std::string command = "exec";
  for (const std::string& word : words) command += " " + QuoteForShell(word);
  command += " 2> " + QuoteForShell(log_path);
  int status = EXIT_FAILURE;
  {
    const auto close = [&status](FILE* pipe) { status = pclose(pipe); };
    const std::unique_ptr<FILE, decltype(close)> pipe(
        popen(command.c_str(), "r"), close);
    if (pipe == nullptr) return Status::Error("cannot start " + words.front());
    std::string line;
    for (int c; (c = std::fgetc(pipe.get())) != EOF;) {
      if (c != '\n') {
        line += static_cast<char>(c);
        continue;
      }
      on_line(line);
      line.clear();
    }
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == EXIT_SUCCESS) {
    return Status::Ok();
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNotFound) {
    return Status::Error("the program " + words.front() +
                         " is not on the PATH; install it");
  }
  return Status::Error(words.front() + " failed: " + LastLine(log_path) + " (" +
                       log_path + ")");
}

}  // namespace adasfm
