// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "core/status.h"

namespace adasfm {

// An option struct's IsValid as a Status.
template <typename Options>
Status CheckOptions(const Options& options) {
  std::string error;
  return options.IsValid(&error) ? Status::Ok() : Status::Error(error);
}

}  // namespace adasfm
