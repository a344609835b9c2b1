// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/matching/best_two_kernel.h"

#ifdef __AVX2__
#include <immintrin.h>

namespace adasfm {
namespace {

struct Avx2 {
  using Vector = __m256i;
  using Row = int16_t;
  using Column = int16_t;
  static constexpr int kLanes = 8;
  static constexpr int kStep = 2;
  static constexpr int kRowShift = 0;
  static constexpr int kNumRows = 4;

  static const __m256i* Pointer(const void* from) {
    return static_cast<const __m256i*>(from);
  }
  static Vector Zero() { return _mm256_setzero_si256(); }
  static Vector Load(const int32_t* from) {
    return _mm256_loadu_si256(Pointer(from));
  }
  static void Store(Vector from, int32_t* to) {
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), from);
  }
  static Vector LoadColumns(const Column* from) {
    return _mm256_loadu_si256(Pointer(from));
  }
  static Vector Repeat(const Row* from) {
    int32_t two;
    __builtin_memcpy(&two, from, sizeof(two));
    return _mm256_set1_epi32(two);
  }
  static Vector MultiplyAdd(Vector columns, Vector row, Vector sum) {
    return _mm256_add_epi32(sum, _mm256_madd_epi16(columns, row));
  }
  static Vector Min(Vector a, Vector b) { return _mm256_min_epi32(a, b); }
  static Vector Max(Vector a, Vector b) { return _mm256_max_epi32(a, b); }
};

}  // namespace

void FindBestTwoAvx2(const BestTwoTask& task) {
  BestTwoKernel<Avx2>::Run(task);
}

}  // namespace adasfm
#endif
