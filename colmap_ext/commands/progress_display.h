// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <mutex>
#include <ostream>
#include <string>

#include "core/progress.h"

namespace adasfm {

// Shows the progress of a command on standard output: on a terminal a bar with
// the time left, in a log plain lines. While a display exists, Ctrl-C (or
// SIGTERM) requests an interruption, and the next Update throws; a second
// signal ends the process at once. Commands without a display have no
// unfinished work to keep and end at the first signal.
class ProgressDisplay {
 public:
  ProgressDisplay();
  ~ProgressDisplay();
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  // Throws Interruption when the user wants to stop.
  void Update(const std::string& what, double share_done);
  ProgressCallback Callback() {
    return [this](const std::string& what, double share_done) {
      Update(what, share_done);
    };
  }
  // Prints a text between the steps on lines of its own.
  void Print(const std::string& text);
  // Ends the bar's line, so that other text can follow.
  void Finish();

 private:
  using Clock = std::chrono::steady_clock;

  void DrawBar(const std::string& what, double share_done);
  void PrintLine(const std::string& what, double share_done);

  std::mutex mutex_;
  // Standard output, even while std::cout is redirected.
  std::ostream out_;
  const bool is_terminal_;
  const Clock::time_point start_ = Clock::now();
  Clock::time_point last_line_;
  std::string last_what_;
  bool bar_is_shown_ = false;
};

// "[#####-----]  50 %  1:05 left  what", cut to the columns of the terminal.
// The time left is extrapolated from the elapsed time once enough is done.
std::string FormatProgressBar(const std::string& what, double share_done,
                              double elapsed_s, int num_columns);

// The signal that was received, 0 when there was none.
int InterruptingSignal();

}  // namespace adasfm
