// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <fstream>
#include <iostream>
#include <mutex>
#include <streambuf>
#include <string>

namespace adasfm {

// During its lifetime, appends what any thread prints on std::cout and
// std::cerr to a file instead, for example the messages of the host's classes.
// Counts lines that begin with `counted`. Streams made from std::cout.rdbuf()
// before are not affected. While one object captures, others, of concurrent
// work, capture nothing.
class CaptureOutput : private std::streambuf {
 public:
  CaptureOutput(const std::string& path, const std::string& counted)
      : captures_(!is_captured_.exchange(true)), counted_(counted) {
    if (!captures_) return;
    file_.open(path, std::ios::app);
    cout_ = std::cout.rdbuf(this);
    cerr_ = std::cerr.rdbuf(this);
  }
  ~CaptureOutput() override {
    if (!captures_) return;
    std::cout.rdbuf(cout_);
    std::cerr.rdbuf(cerr_);
    is_captured_ = false;
  }
  CaptureOutput(const CaptureOutput&) = delete;
  CaptureOutput& operator=(const CaptureOutput&) = delete;

  int NumCountedLines() const { return num_counted_; }

 private:
  int_type overflow(int_type c) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!traits_type::eq_int_type(c, traits_type::eof())) {
      Put(traits_type::to_char_type(c));
    }
    return traits_type::not_eof(c);
  }
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::streamsize i = 0; i < size; ++i) Put(text[i]);
    return size;
  }
  int sync() override {
    const std::lock_guard<std::mutex> lock(mutex_);
    file_.flush();
    return 0;
  }

  void Put(char c) {
    file_.put(c);
    line_ += c;
    if (c != '\n') return;
    if (!counted_.empty() && line_.rfind(counted_, 0) == 0) ++num_counted_;
    line_.clear();
  }

  static inline std::atomic<bool> is_captured_{false};

  std::mutex mutex_;
  const bool captures_;
  const std::string counted_;
  std::string line_;
  std::atomic<int> num_counted_{0};
  std::ofstream file_;
  std::streambuf* cout_ = nullptr;
  std::streambuf* cerr_ = nullptr;
};

}  // namespace adasfm
