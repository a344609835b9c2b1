// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sstream>
#include <string>
#include <utility>

namespace adasfm {

// Checks the options of one group. The first rule that does not hold gives the
// message "GROUP.NAME = VALUE RULE": the option as the user types it, what it
// is and what it should be. A rule is false of a value that is no number.
class OptionChecker {
 public:
  OptionChecker(std::string group, std::string* error)
      : group_(std::move(group)), error_(*error) {}

  OptionChecker& Require(bool holds, const std::string& name, double value,
                         const std::string& rule) {
    if (!all_hold_ || holds) return *this;
    all_hold_ = false;
    std::ostringstream message;
    message << group_ << "." << name << " = " << value << " " << rule;
    error_ = message.str();
    return *this;
  }
  OptionChecker& Positive(const std::string& name, double value) {
    return Require(value > 0.0, name, value, "must be positive");
  }
  OptionChecker& AtLeast(double min, const std::string& name, double value) {
    std::ostringstream rule;
    rule << "must be at least " << min;
    return Require(value >= min, name, value, rule.str());
  }

  bool AllHold() const { return all_hold_; }

 private:
  const std::string group_;
  std::string& error_;
  bool all_hold_ = true;
};

}  // namespace adasfm
