// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ios>

namespace adasfm {

// By itself a stream takes memory that it cannot get, or a disk that it cannot
// read, for the end of the text, and what was read so far for the whole. Then
// std::bad_alloc and std::ios_base::failure are thrown in place of that.
template <typename Stream>
void ThrowOnFailure(Stream* stream) {
  stream->exceptions(std::ios_base::badbit);
}

}  // namespace adasfm
