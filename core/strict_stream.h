// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ios>

namespace adasfm {

// Makes a stream throw std::bad_alloc or std::ios_base::failure when memory or
// the disk fails. By default a stream treats such a failure as the end of the
// text, and the part read so far passes for the whole.
template <typename Stream>
void ThrowOnFailure(Stream* stream) {
  stream->exceptions(std::ios_base::badbit);
}

}  // namespace adasfm
