// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/matching/best_two_kernel.h"

#ifdef __AVX512VNNI__
#include <immintrin.h>

namespace adasfm {
namespace {

struct Avx512Vnni {
  using Vector = __m512i;
  using Row = int8_t;
  using Column = uint8_t;
  static constexpr int kLanes = 16;
  static constexpr int kStep = 4;
  static constexpr int kRowShift = 128;
  static constexpr int kNumRows = 6;

  static Vector Zero() { return _mm512_setzero_si512(); }
  static Vector Load(const int32_t* from) { return _mm512_loadu_si512(from); }
  static void Store(Vector from, int32_t* to) { _mm512_storeu_si512(to, from); }
  static Vector LoadColumns(const Column* from) {
    return _mm512_loadu_si512(from);
  }
  static Vector Repeat(const Row* from) {
    int32_t four;
    __builtin_memcpy(&four, from, sizeof(four));
    return _mm512_set1_epi32(four);
  }
  static Vector MultiplyAdd(Vector columns, Vector row, Vector sum) {
    return _mm512_dpbusd_epi32(sum, columns, row);
  }
  static Vector Min(Vector a, Vector b) { return _mm512_min_epi32(a, b); }
  static Vector Max(Vector a, Vector b) { return _mm512_max_epi32(a, b); }
};

}  // namespace

void FindBestTwoAvx512Vnni(const BestTwoTask& task) {
  BestTwoKernel<Avx512Vnni>::Run(task);
}

}  // namespace adasfm
#endif
