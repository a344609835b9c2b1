// SPDX-License-Identifier: BSD-3-Clause
// What a command shows on a terminal, and in a log.

#include <pty.h>
#include <unistd.h>

#include <algorithm>
#include <sstream>
#include <vector>

#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/paths.h"

namespace adasfm {
namespace {

constexpr int kNumColumns = 60;

// The launcher on a terminal of its own.
class Terminal {
 public:
  explicit Terminal(const std::string& arguments) {
    std::istringstream words(arguments);
    std::vector<std::string> text = {LauncherPath()};
    for (std::string word; words >> word;) text.push_back(word);
    std::vector<char*> argv;
    for (std::string& word : text) argv.push_back(word.data());
    argv.push_back(nullptr);
    winsize size = {};
    size.ws_row = 24;
    size.ws_col = kNumColumns;
    child_ = forkpty(&terminal_, nullptr, nullptr, &size);
    if (child_ == 0) {
      execv(argv[0], argv.data());
      _exit(2);
    }
  }
  ~Terminal() { close(terminal_); }

  // Reads until `word` is there, or the command has ended.
  bool ReadUntil(const std::string& word) {
    char buffer[4096];
    while (word.empty() || text_.find(word) == std::string::npos) {
      const ssize_t size = read(terminal_, buffer, sizeof(buffer));
      if (size <= 0) return false;
      text_.append(buffer, size);
    }
    return true;
  }
  void PressCtrlC() { ASSERT_EQ(write(terminal_, "\x03", 1), 1); }
  // Reads the remaining output and returns the exit code.
  int Wait() {
    ReadUntil("");
    int status = 0;
    waitpid(child_, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  const std::string& Text() const { return text_; }
  // The bars that were drawn over each other on one line.
  std::vector<std::string> Bars() const {
    const std::string start = "\r\033[K";
    std::vector<std::string> bars;
    for (size_t at = text_.find(start); at != std::string::npos;) {
      const size_t next = text_.find(start, at + 1);
      const std::string bar = text_.substr(
          at + start.size(), next - at - std::min(next, start.size()));
      bars.push_back(bar.substr(0, bar.find_first_of("\r\n")));
      at = next;
    }
    return bars;
  }

 private:
  int terminal_ = -1;
  pid_t child_ = -1;
  std::string text_;
};

class TerminalTest : public CommandLineTest {
 protected:
  std::string Render(int num_images, const std::string& size) {
    return "adasfm_synthesizer --render 1 --num_images " +
           std::to_string(num_images) + " " + size + " --output_path " +
           folder_.File("drive");
  }
};

// More photos than any machine renders before the remaining time is known.
TEST_F(TerminalTest, BarWithTheTimeLeftUntilCtrlC) {
  Terminal terminal(Render(300, "--image_width 1600 --image_height 1000"));
  ASSERT_TRUE(terminal.ReadUntil(" left")) << terminal.Text();
  // Before the terminal itself adds ^C to a line.
  const std::vector<std::string> bars = terminal.Bars();
  terminal.PressCtrlC();
  EXPECT_EQ(terminal.Wait(), 130) << terminal.Text();
  ASSERT_GT(bars.size(), 1);
  for (const std::string& bar : bars) {
    EXPECT_EQ(bar.front(), '[') << bar;
    EXPECT_NE(bar.find(" %"), std::string::npos) << bar;
    EXPECT_LT(bar.size(), kNumColumns) << bar;
  }
  EXPECT_NE(terminal.Text().find("Stopping after the step in progress"),
            std::string::npos);
  EXPECT_NE(terminal.Text().find("ERROR: interrupted"), std::string::npos)
      << terminal.Text();
}

TEST_F(TerminalTest, PlainLinesInALog) {
  const Run run = Call(Render(3, "--image_width 64 --image_height 64"));
  ASSERT_EQ(run.ExitCode(), 0) << run.err;
  EXPECT_EQ(run.out.find_first_of("\r\033"), std::string::npos);
  EXPECT_NE(run.out.find(" %] rendered 1 of 3 photos\n"), std::string::npos)
      << run.out;
  EXPECT_EQ(run.out.back(), '\n');
}

}  // namespace
}  // namespace adasfm
