// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// The implementation of FindBestTwo (best_two.h) for all instruction sets. A
// source file that is compiled for one of them includes none of our other
// headers: inline functions of the standard library, compiled there, could be
// called on a processor without these instructions.

#include <cstdint>

namespace adasfm {

// Buffers of the caller. The counts are those of the descriptors; the buffers
// have room for kMaxNumTogether more.
struct BestTwoTask {
  const uint8_t* descriptors1 = nullptr;
  int count1 = 0;
  const uint8_t* descriptors2 = nullptr;
  int count2 = 0;
  // Two bytes for each number of the descriptors.
  void* packed1 = nullptr;
  void* packed2 = nullptr;
  int32_t* offsets2 = nullptr;
  // Initially zeros.
  int32_t* best1 = nullptr;
  int32_t* second1 = nullptr;
  int32_t* best2 = nullptr;
  int32_t* second2 = nullptr;
};

// Largest number of descriptors that are processed together.
constexpr int kMaxNumTogether = 32;

void FindBestTwoPortable(const BestTwoTask& task);
void FindBestTwoAvx2(const BestTwoTask& task);
void FindBestTwoAvx512Vnni(const BestTwoTask& task);

namespace {

// Rows are the descriptors of image 1, columns those of image 2.
// Simd: a vector of kLanes products, one per column.
//   Row, Column    types of the packed numbers
//   kStep          numbers of a descriptor that one instruction multiplies
//   kRowShift      subtracted from the numbers of the rows to fit into Row
//   kNumRows       rows that are multiplied together
template <typename Simd>
class BestTwoKernel {
 public:
  static void Run(const BestTwoTask& task) {
    PackRows(task);
    PackColumns(task);
    for (int row = 0; row < task.count1; row += Simd::kNumRows) {
      MultiplyRows(task, row);
    }
  }

 private:
  using Vector = typename Simd::Vector;
  using Row = typename Simd::Row;
  using Column = typename Simd::Column;
  static constexpr int kLanes = Simd::kLanes;
  static constexpr int kStep = Simd::kStep;
  static constexpr int kNumRows = Simd::kNumRows;
  static constexpr int kNumNumbers = 128;
  // Vectors of columns that are multiplied together.
  static constexpr int kNumVectors = 2;
  static_assert(kLanes * kNumVectors <= kMaxNumTogether);
  static_assert(kNumRows <= kMaxNumTogether);

  static int RoundUp(int count, int unit) {
    return (count + unit - 1) / unit * unit;
  }

  // Padding rows are descriptors of zeros, whose products are all 0.
  static void PackRows(const BestTwoTask& task) {
    Row* packed = static_cast<Row*>(task.packed1);
    const int num_numbers = task.count1 * kNumNumbers;
    for (int i = 0; i < num_numbers; ++i) {
      packed[i] = static_cast<Row>(task.descriptors1[i] - Simd::kRowShift);
    }
    const int end = RoundUp(task.count1, kNumRows) * kNumNumbers;
    for (int i = num_numbers; i < end; ++i) packed[i] = -Simd::kRowShift;
  }

  // Packs by vectors of columns; a vector has kStep numbers of each column in
  // turn. offsets2 restores what the shift of the rows subtracts from the
  // products.
  static void PackColumns(const BestTwoTask& task) {
    Column* packed = static_cast<Column*>(task.packed2);
    const int end = RoundUp(task.count2, kLanes * kNumVectors);
    for (int column = 0; column < end; ++column) {
      const bool is_there = column < task.count2;
      const uint8_t* numbers = task.descriptors2 + column * kNumNumbers;
      Column* first = packed + (column / kLanes) * kLanes * kNumNumbers +
                      (column % kLanes) * kStep;
      int32_t sum = 0;
      for (int k = 0; k < kNumNumbers; ++k) {
        const uint8_t number = is_there ? numbers[k] : 0;
        first[k / kStep * kStep * kLanes + k % kStep] = number;
        sum += number;
      }
      task.offsets2[column] = Simd::kRowShift * sum;
    }
  }

  static void Insert(Vector product, Vector* best, Vector* second) {
    *second = Simd::Max(*second, Simd::Min(*best, product));
    *best = Simd::Max(*best, product);
  }

  static void MultiplyRows(const BestTwoTask& task, int row) {
    const Row* rows = static_cast<const Row*>(task.packed1) + row * kNumNumbers;
    const Column* columns = static_cast<const Column*>(task.packed2);
    Vector best[kNumRows];
    Vector second[kNumRows];
    for (int r = 0; r < kNumRows; ++r) best[r] = second[r] = Simd::Zero();
    for (int column = 0; column < task.count2; column += kLanes * kNumVectors) {
      Vector products[kNumRows][kNumVectors];
      Multiply(rows, columns + column * kNumNumbers, task.offsets2 + column,
               products);
      for (int v = 0; v < kNumVectors; ++v) {
        const int offset = column + v * kLanes;
        Vector best2 = Simd::Load(task.best2 + offset);
        Vector second2 = Simd::Load(task.second2 + offset);
        for (int r = 0; r < kNumRows; ++r) {
          Insert(products[r][v], &best[r], &second[r]);
          Insert(products[r][v], &best2, &second2);
        }
        Simd::Store(best2, task.best2 + offset);
        Simd::Store(second2, task.second2 + offset);
      }
    }
    for (int r = 0; r < kNumRows && row + r < task.count1; ++r) {
      JoinLanes(best[r], second[r], task.best1 + row + r,
                task.second1 + row + r);
    }
  }

  static void Multiply(const Row* rows, const Column* columns,
                       const int32_t* offsets,
                       Vector (&products)[kNumRows][kNumVectors]) {
    for (int v = 0; v < kNumVectors; ++v) {
      const Vector offset = Simd::Load(offsets + v * kLanes);
      for (int r = 0; r < kNumRows; ++r) products[r][v] = offset;
    }
    for (int k = 0; k < kNumNumbers; k += kStep) {
      Vector numbers[kNumVectors];
      for (int v = 0; v < kNumVectors; ++v) {
        numbers[v] =
            Simd::LoadColumns(columns + (v * kNumNumbers + k) * kLanes);
      }
      for (int r = 0; r < kNumRows; ++r) {
        const Vector row = Simd::Repeat(rows + r * kNumNumbers + k);
        for (int v = 0; v < kNumVectors; ++v) {
          products[r][v] = Simd::MultiplyAdd(numbers[v], row, products[r][v]);
        }
      }
    }
  }

  static void JoinLanes(Vector best, Vector second, int32_t* best_of_all,
                        int32_t* second_of_all) {
    alignas(64) int32_t bests[kLanes];
    alignas(64) int32_t seconds[kLanes];
    Simd::Store(best, bests);
    Simd::Store(second, seconds);
    int32_t first = 0;
    int32_t next = 0;
    for (int lane = 0; lane < kLanes; ++lane) {
      if (bests[lane] > first) {
        next = first > seconds[lane] ? first : seconds[lane];
        first = bests[lane];
      } else if (bests[lane] > next) {
        next = bests[lane];
      }
    }
    *best_of_all = first;
    *second_of_all = next;
  }
};

}  // namespace
}  // namespace adasfm
