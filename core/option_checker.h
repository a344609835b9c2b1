// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <initializer_list>
#include <sstream>
#include <string>
#include <utility>

namespace adasfm {

// Checks the options of one group. The first violated rule gives the message
// "GROUP.NAME = VALUE RULE": the option as the user types it, its value and
// what it should be. The group is omitted where the commands use another name
// for the option and print it before the message. NaN violates every rule; an
// infinite value violates all but Require's.
class OptionChecker {
 public:
  using NamedValues = std::initializer_list<std::pair<const char*, double>>;

  explicit OptionChecker(std::string* error) : error_(*error) {}
  OptionChecker(const std::string& group, std::string* error)
      : prefix_(group + "."), error_(*error) {}

  OptionChecker& Require(bool holds, const std::string& name, double value,
                         const std::string& rule) {
    if (!all_hold_ || holds) return *this;
    all_hold_ = false;
    std::ostringstream message;
    message << prefix_ << name << " = " << value << " " << rule;
    error_ = message.str();
    return *this;
  }
  OptionChecker& Positive(const std::string& name, double value) {
    return RequireFinite(value > 0.0, name, value, "must be positive");
  }
  OptionChecker& Positive(const NamedValues& values) {
    for (const auto& [name, value] : values) Positive(name, value);
    return *this;
  }
  OptionChecker& NotNegative(const NamedValues& values) {
    for (const auto& [name, value] : values) {
      RequireFinite(value >= 0.0, name, value, "must not be negative");
    }
    return *this;
  }
  // -1 stands for "as the machine allows".
  OptionChecker& PositiveOrMinusOne(const std::string& name, double value) {
    return RequireFinite(value > 0.0 || value == -1.0, name, value,
                         "must be positive, or -1");
  }
  OptionChecker& AtLeast(double min, const std::string& name, double value) {
    return RequireFinite(value >= min, name, value, "must be at least ", min);
  }
  OptionChecker& Within(double min, double max, const std::string& name,
                        double value) {
    return RequireFinite(value >= min && value <= max, name, value,
                         "must be from ", min, " to ", max);
  }

  bool AllHold() const { return all_hold_; }

 private:
  template <typename... Text>
  OptionChecker& RequireFinite(bool holds, const std::string& name,
                               double value, const Text&... rule) {
    if (std::isinf(value)) return Require(false, name, value, "must be finite");
    std::ostringstream text;
    (text << ... << rule);
    return Require(holds, name, value, text.str());
  }

  const std::string prefix_;
  std::string& error_;
  bool all_hold_ = true;
};

}  // namespace adasfm
