// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/status.h"

namespace adasfm {

// A JSON object in a file, with a fingerprint of what it was made from and a
// digest of its content.

enum class CheckpointCondition { kSound, kMissing, kOutdated, kDamaged };

struct CheckpointFile {
  CheckpointCondition condition = CheckpointCondition::kMissing;
  // What is wrong, unless the file is sound.
  std::string problem;
  nlohmann::json content;
};

Status WriteCheckpointFile(const std::string& path,
                           const std::string& fingerprint,
                           nlohmann::json content);

// Outdated is a file of another fingerprint.
CheckpointFile ReadCheckpointFile(const std::string& path,
                                  const std::string& fingerprint);

}  // namespace adasfm
