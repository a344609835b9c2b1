// SPDX-License-Identifier: BSD-3-Clause
#include "core/interruption.h"

#include <atomic>

namespace adasfm {
namespace {

std::atomic<bool> requested{false};
static_assert(std::atomic<bool>::is_always_lock_free,
              "a signal handler sets it");

}  // namespace

void RequestInterruption() { requested = true; }
void WithdrawInterruption() { requested = false; }
bool InterruptionRequested() { return requested; }

void ThrowIfInterrupted() {
  if (requested) throw Interruption();
}

}  // namespace adasfm
