// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace adasfm {

inline constexpr int64_t kSecondNs = 1'000'000'000;

// Days since 1970-01-01 in the Gregorian calendar. Years are counted from
// March, so that a leap day ends its year.
inline int64_t DaysSinceEpoch(int64_t year, int64_t month, int64_t day) {
  const int64_t march_year = month <= 2 ? year - 1 : year;
  const int64_t march_month = (month + 9) % 12;
  const int64_t days = 365 * march_year + march_year / 4 - march_year / 100 +
                       march_year / 400 + (153 * march_month + 2) / 5 + day - 1;
  constexpr int64_t kDaysToEpoch = 719468;
  return days - kDaysToEpoch;
}

}  // namespace adasfm
