// SPDX-License-Identifier: BSD-3-Clause
#include <opencv2/core/hal/intrin.hpp>

#include "colmap_ext/matching/best_two_kernel.h"

namespace adasfm {
namespace {

// OpenCV's vectors: SSE2, NEON and the like, else plain C++.
struct Portable {
  using Vector = cv::v_int32x4;
  using Row = int16_t;
  using Column = int16_t;
  static constexpr int kLanes = 4;
  static constexpr int kStep = 2;
  static constexpr int kRowShift = 0;
  static constexpr int kNumRows = 4;

  static Vector Zero() { return cv::v_setzero_s32(); }
  static Vector Load(const int32_t* from) { return cv::v_load(from); }
  static void Store(Vector from, int32_t* to) { cv::v_store(to, from); }
  static Vector LoadColumns(const Column* from) {
    return cv::v_reinterpret_as_s32(cv::v_load(from));
  }
  static Vector Repeat(const Row* from) {
    int32_t two;
    __builtin_memcpy(&two, from, sizeof(two));
    return cv::v_setall_s32(two);
  }
  static Vector MultiplyAdd(Vector columns, Vector row, Vector sum) {
    return cv::v_dotprod(cv::v_reinterpret_as_s16(columns),
                         cv::v_reinterpret_as_s16(row), sum);
  }
  static Vector Min(Vector a, Vector b) { return cv::v_min(a, b); }
  static Vector Max(Vector a, Vector b) { return cv::v_max(a, b); }
};

}  // namespace

void FindBestTwoPortable(const BestTwoTask& task) {
  BestTwoKernel<Portable>::Run(task);
}

}  // namespace adasfm
