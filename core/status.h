// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace adasfm {

// The outcome of work on data that may be bad. The message is one line for the
// user: what is wrong, in which file, what to do.
class Status {
 public:
  Status() = default;
  static Status Ok() { return Status(); }
  static Status Error(std::string message) {
    Status status;
    status.message_ = std::move(message);
    return status;
  }

  bool ok() const { return !message_.has_value(); }
  // Empty when ok().
  std::string message() const { return message_.value_or(""); }

 private:
  std::optional<std::string> message_;
};

// A value, or the reason why there is none.
template <typename T>
class StatusOr {
 public:
  StatusOr(T value) : value_(std::move(value)) {}         // NOLINT: implicit
  StatusOr(Status status) : status_(std::move(status)) {  // NOLINT: implicit
    if (status_.ok()) throw std::invalid_argument("StatusOr: ok, but no value");
  }

  bool ok() const { return status_.ok(); }
  const Status& status() const { return status_; }

  // Throws std::logic_error when not ok().
  const T& value() const& {
    RequireValue();
    return *value_;
  }
  T& value() & {
    RequireValue();
    return *value_;
  }
  T&& value() && {
    RequireValue();
    return std::move(*value_);
  }
  const T& operator*() const& { return value(); }
  T& operator*() & { return value(); }
  const T* operator->() const { return &value(); }
  T* operator->() { return &value(); }

 private:
  void RequireValue() const {
    if (!ok()) throw std::logic_error("StatusOr: " + status_.message());
  }

  Status status_;
  std::optional<T> value_;
};

}  // namespace adasfm
