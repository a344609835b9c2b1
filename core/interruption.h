// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace adasfm {

// Thrown where the user's wish to stop is followed. Not a std::exception: code
// that answers an exception with another attempt must let it pass.
struct Interruption {};

// The wish to stop. Safe in a signal handler; stays until it is withdrawn.
void RequestInterruption();
void WithdrawInterruption();
bool InterruptionRequested();

// To be called between steps of work that may take long, where everything worth
// keeping is kept: throws Interruption when one is requested.
void ThrowIfInterrupted();

}  // namespace adasfm
