// SPDX-License-Identifier: BSD-3-Clause
#include "core/strict_stream.h"

#include <gtest/gtest.h>

#include <fstream>
#include <istream>
#include <new>
#include <streambuf>
#include <string>

namespace adasfm {
namespace {

// A stream buffer that throws std::bad_alloc after two lines.
class ShortOfMemory : public std::streambuf {
 public:
  ShortOfMemory() { setg(text_, text_, text_ + sizeof(text_) - 1); }

 private:
  int_type underflow() override { throw std::bad_alloc(); }
  char text_[11] = "one\ntwo\nth";
};

int CountLines(std::istream* stream) {
  int num_lines = 0;
  for (std::string line; std::getline(*stream, line);) ++num_lines;
  return num_lines;
}

TEST(ThrowOnFailure, ShortMemoryIsNotTheEndOfTheText) {
  ShortOfMemory buffer;
  std::istream stream(&buffer);
  EXPECT_EQ(CountLines(&stream), 2);  // default of streams
  ShortOfMemory same;
  std::istream strict(&same);
  ThrowOnFailure(&strict);
  EXPECT_THROW(CountLines(&strict), std::bad_alloc);
}

TEST(ThrowOnFailure, WhatCannotBeReadIsNotEmpty) {
  std::ifstream folder(".");
  ThrowOnFailure(&folder);
  EXPECT_THROW(CountLines(&folder), std::ios_base::failure);
}

TEST(ThrowOnFailure, TheEndIsTheEnd) {
  std::ifstream file("/proc/self/stat");
  ThrowOnFailure(&file);
  EXPECT_EQ(CountLines(&file), 1);
}

}  // namespace
}  // namespace adasfm
