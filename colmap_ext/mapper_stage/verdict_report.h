// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "colmap_ext/mapper_stage/verdict.h"

namespace adasfm {

// A verdict as text and JSON, for the screen, the report and summary.json
// (docs/reference/formats.md).

// "good", "doubtful" or "failed".
const char* VerdictName(VerdictResult result);

// One line for the screen.
std::string FormatVerdict(const Verdict& verdict);

nlohmann::json VerdictToJson(const Verdict& verdict);

// "97 %", with a digit more below 10 %.
std::string FormatShare(double share);

// "of 1 of 3 models " when not all are meant, else empty.
std::string FormatOfModels(int num_models, int num_all_models);

}  // namespace adasfm
