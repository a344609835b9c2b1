// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <string>

namespace adasfm {

// What the mapper stage's steps share.

class StepTimer {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() -
                                         start_)
        .count();
  }

 private:
  const std::chrono::steady_clock::time_point start_ =
      std::chrono::steady_clock::now();
};

std::string PartCheckpointPath(const std::string& checkpoint_path,
                               int part_index);

}  // namespace adasfm
