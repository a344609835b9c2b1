// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace adasfm {

// Thrown to stop the work at the user's request. Not a std::exception: code
// that retries after an exception must let it pass.
struct Interruption {};

// The user's request to stop. Safe in a signal handler; stays until it is
// withdrawn.
void RequestInterruption();
void WithdrawInterruption();
bool InterruptionRequested();

// Throws Interruption when one is requested. To be called between long steps of
// work, where all results worth keeping are saved.
void ThrowIfInterrupted();

}  // namespace adasfm
