// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace adasfm {

// Length of a SIFT descriptor: one byte per number.
constexpr int kSiftDimensions = 128;

// For each descriptor the greatest product with a descriptor of the other
// image, and the second greatest, which is the same number when two are equal.
// 0 where there is none.
struct BestTwo {
  std::vector<int32_t> best;
  std::vector<int32_t> second;
};

// The instructions that multiply the bytes.
enum class ProductKernel {
  kAutomatic,   // the fastest one of this processor
  kPortable,    // 128 bits wide, on every processor
  kAvx2,        // x86-64 processors since 2013
  kAvx512Vnni,  // x86-64 processors with 8-bit dot products
};

// Whether this processor and this build have the kernel.
bool HasKernel(ProductKernel kernel);

// Finds the two greatest scalar products of each of the count1 descriptors with
// those of the other image, and of each of the count2. Inputs: rows of
// kSiftDimensions bytes. Products are integers below 2^23, so that all kernels
// give the same result. Cost: count1 * count2 products; memory: a few copies of
// the descriptors. Throws std::invalid_argument for a kernel that HasKernel
// denies.
void FindBestTwo(const uint8_t* descriptors1, int count1,
                 const uint8_t* descriptors2, int count2, ProductKernel kernel,
                 BestTwo* of1, BestTwo* of2);

}  // namespace adasfm
