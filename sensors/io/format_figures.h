// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdio>
#include <string>

namespace adasfm {

// A message with up to two numbers, at most 255 characters.
inline std::string FormatFigures(const char* format, double a, double b = 0.0) {
  char buffer[256];
  std::snprintf(buffer, sizeof(buffer), format, a, b);
  return buffer;
}

}  // namespace adasfm
