// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace adasfm {

// Numbers of a SIFT descriptor, one byte each.
constexpr int kSiftDimensions = 128;

// Of each descriptor the greatest product with one of the other image, and the
// second greatest, which is the same number when two are equal. 0 where there
// is none.
struct BestTwo {
  std::vector<int32_t> best;
  std::vector<int32_t> second;
};

// Which instructions multiply the bytes.
enum class ProductKernel {
  kAutomatic,   // the fastest one of this processor
  kPortable,    // 128 bits wide, on every processor
  kAvx2,        // x86-64 processors since 2013
  kAvx512Vnni,  // x86-64 processors with 8-bit dot products
};

// Whether this processor, and the compiler of this program, have it.
bool HasKernel(ProductKernel kernel);

// The two greatest scalar products of each of count1 descriptors with those of
// the other image, and of each of count2. Inputs: rows of kSiftDimensions
// bytes. Products are whole numbers below 2^23, so that they are the same by
// every kernel. Cost: count1 * count2 products; memory: a few copies of the
// descriptors. Throws std::invalid_argument for a kernel that is not there.
void FindBestTwo(const uint8_t* descriptors1, int count1,
                 const uint8_t* descriptors2, int count2, ProductKernel kernel,
                 BestTwo* of1, BestTwo* of2);

}  // namespace adasfm
