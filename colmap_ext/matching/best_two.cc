// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/matching/best_two.h"

#include <stdexcept>

#include "colmap_ext/matching/best_two_kernel.h"

namespace adasfm {
namespace {

// ADASFM_X86_KERNELS: CMake compiled these kernels.
#ifdef ADASFM_X86_KERNELS
bool HasAvx2() { return __builtin_cpu_supports("avx2"); }
bool HasAvx512Vnni() {
  return __builtin_cpu_supports("avx512f") &&
         __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512vnni");
}
#else
bool HasAvx2() { return false; }
bool HasAvx512Vnni() { return false; }
#endif

ProductKernel Choose(ProductKernel kernel) {
  if (kernel != ProductKernel::kAutomatic) return kernel;
  if (HasAvx512Vnni()) return ProductKernel::kAvx512Vnni;
  return HasAvx2() ? ProductKernel::kAvx2 : ProductKernel::kPortable;
}

void RunKernel(ProductKernel kernel, const BestTwoTask& task) {
  switch (Choose(kernel)) {
#ifdef ADASFM_X86_KERNELS
    case ProductKernel::kAvx512Vnni:
      return FindBestTwoAvx512Vnni(task);
    case ProductKernel::kAvx2:
      return FindBestTwoAvx2(task);
#endif
    default:
      return FindBestTwoPortable(task);
  }
}

}  // namespace

bool HasKernel(ProductKernel kernel) {
  if (kernel == ProductKernel::kAvx2) return HasAvx2();
  if (kernel == ProductKernel::kAvx512Vnni) return HasAvx512Vnni();
  return true;
}

void FindBestTwo(const uint8_t* descriptors1, int count1,
                 const uint8_t* descriptors2, int count2, ProductKernel kernel,
                 BestTwo* of1, BestTwo* of2) {
  if (!HasKernel(kernel)) {
    throw std::invalid_argument(
        "FindBestTwo: this processor has no such "
        "instructions");
  }
  const size_t room1 = count1 + kMaxNumTogether;
  const size_t room2 = count2 + kMaxNumTogether;
  of1->best.assign(room1, 0);
  of1->second.assign(room1, 0);
  of2->best.assign(room2, 0);
  of2->second.assign(room2, 0);
  std::vector<int16_t> packed1(room1 * kSiftDimensions);
  std::vector<int16_t> packed2(room2 * kSiftDimensions);
  std::vector<int32_t> offsets2(room2);
  BestTwoTask task;
  task.descriptors1 = descriptors1;
  task.count1 = count1;
  task.descriptors2 = descriptors2;
  task.count2 = count2;
  task.packed1 = packed1.data();
  task.packed2 = packed2.data();
  task.offsets2 = offsets2.data();
  task.best1 = of1->best.data();
  task.second1 = of1->second.data();
  task.best2 = of2->best.data();
  task.second2 = of2->second.data();
  RunKernel(kernel, task);
  of1->best.resize(count1);
  of1->second.resize(count1);
  of2->best.resize(count2);
  of2->second.resize(count2);
}

}  // namespace adasfm
