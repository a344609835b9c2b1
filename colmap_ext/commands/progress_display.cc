// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/progress_display.h"

#include <signal.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <iostream>

#include "core/interruption.h"

namespace adasfm {
namespace {

constexpr int kBarWidth = 24;
// With less progress or time, extrapolation is unreliable.
constexpr double kMinShareForEta = 0.02;
constexpr double kMinSecondsForEta = 2.0;
// Interval between lines in a log for a step that counts.
constexpr double kSecondsBetweenLines = 10.0;

std::atomic<int> received_signal{0};

// Async-signal-safe. SA_RESETHAND makes a second signal end the process.
void HandleSignal(int signal_number) {
  received_signal = signal_number;
  RequestInterruption();
  constexpr char kMessage[] =
      "\nStopping after the step in progress (again: at once)\n";
  if (write(STDERR_FILENO, kMessage, sizeof(kMessage) - 1) < 0) return;
}

void SetHandler(void (*handler)(int)) {
  struct sigaction action = {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART | SA_RESETHAND;
  sigemptyset(&action.sa_mask);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

int NumColumns() {
  winsize size = {};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) {
    return 80;
  }
  return size.ws_col;
}

std::string FormatDuration(double seconds) {
  const int64_t total = std::llround(seconds);
  char text[32];
  if (total >= 3600) {
    std::snprintf(
        text, sizeof(text), "%d:%02d:%02d", static_cast<int>(total / 3600),
        static_cast<int>(total / 60 % 60), static_cast<int>(total % 60));
  } else {
    std::snprintf(text, sizeof(text), "%d:%02d", static_cast<int>(total / 60),
                  static_cast<int>(total % 60));
  }
  return text;
}

// Digits are ignored: "Matching pairs 3 of 9" and "4 of 9" are the same step.
std::string WithoutDigits(std::string text) {
  text.erase(std::remove_if(text.begin(), text.end(),
                            [](char c) { return c >= '0' && c <= '9'; }),
             text.end());
  return text;
}

}  // namespace

ProgressDisplay::ProgressDisplay()
    : out_(std::cout.rdbuf()), is_terminal_(isatty(STDOUT_FILENO)) {
  SetHandler(&HandleSignal);
}

ProgressDisplay::~ProgressDisplay() {
  Finish();
  SetHandler(SIG_DFL);
}

void ProgressDisplay::Update(const std::string& what, double share_done) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const double share = std::clamp(share_done, 0.0, 1.0);
    is_terminal_ ? DrawBar(what, share) : PrintLine(what, share);
  }
  ThrowIfInterrupted();
}

void ProgressDisplay::Print(const std::string& text) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (bar_is_shown_) out_ << "\r\033[K";
  bar_is_shown_ = false;
  out_ << text << (text.empty() || text.back() != '\n' ? "\n" : "")
       << std::flush;
}

void ProgressDisplay::Finish() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (bar_is_shown_) out_ << std::endl;
  bar_is_shown_ = false;
}

void ProgressDisplay::DrawBar(const std::string& what, double share_done) {
  const std::chrono::duration<double> elapsed = Clock::now() - start_;
  out_ << "\r\033[K"
       << FormatProgressBar(what, share_done, elapsed.count(), NumColumns())
       << std::flush;
  bar_is_shown_ = true;
}

void ProgressDisplay::PrintLine(const std::string& what, double share_done) {
  const std::chrono::duration<double> since_last = Clock::now() - last_line_;
  const std::string step = WithoutDigits(what);
  if (step == last_what_ && since_last.count() < kSecondsBetweenLines) return;
  last_what_ = step;
  last_line_ = Clock::now();
  out_ << "[" << static_cast<int>(100.0 * share_done) << " %] " << what
       << std::endl;
}

std::string FormatProgressBar(const std::string& what, double share_done,
                              double elapsed_s, int num_columns) {
  const int num_done = std::lround(share_done * kBarWidth);
  char percent[16];
  std::snprintf(percent, sizeof(percent), "%3d %%",
                static_cast<int>(100.0 * share_done));
  std::string text = "[" + std::string(num_done, '#') +
                     std::string(kBarWidth - num_done, '-') + "] " + percent;
  if (share_done >= kMinShareForEta && share_done < 1.0 &&
      elapsed_s >= kMinSecondsForEta) {
    text +=
        "  " + FormatDuration(elapsed_s * (1.0 / share_done - 1.0)) + " left";
  }
  text += "  " + what;
  // A wrapped line could not be overwritten.
  return text.substr(0, std::max(1, num_columns - 1));
}

int InterruptingSignal() { return received_signal; }

}  // namespace adasfm
