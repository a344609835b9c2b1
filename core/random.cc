// SPDX-License-Identifier: BSD-3-Clause
#include "core/random.h"

#include <cmath>
#include <stdexcept>
#include <unordered_set>

#include "core/so3.h"

namespace adasfm {

double Random::Uniform(double min, double max) {
  // 53 random bits: every double in [0, 1) that is a multiple of 2^-53.
  const double unit = (engine_() >> 11) * 0x1.0p-53;
  return min + (max - min) * unit;
}

int64_t Random::UniformInt(int64_t min, int64_t max) {
  if (max < min) throw std::invalid_argument("UniformInt: max < min");
  const uint64_t range = static_cast<uint64_t>(max - min) + 1;
  if (range == 0) return static_cast<int64_t>(engine_());
  // Rejection keeps the draw unbiased.
  const uint64_t limit = UINT64_MAX - UINT64_MAX % range;
  uint64_t value = engine_();
  while (value >= limit) value = engine_();
  return min + static_cast<int64_t>(value % range);
}

double Random::Gaussian(double sigma) {
  // Box-Muller; 1 - u keeps the logarithm's argument above zero.
  const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform(0.0, 1.0)));
  return sigma * radius * std::cos(2.0 * kPi * Uniform(0.0, 1.0));
}

Eigen::Vector3d Random::GaussianVector(double sigma) {
  const double x = Gaussian(sigma);
  const double y = Gaussian(sigma);
  return Eigen::Vector3d(x, y, Gaussian(sigma));
}

Eigen::Vector3d Random::UnitVector() {
  Eigen::Vector3d vector = GaussianVector(1.0);
  while (vector.norm() < 1e-6) vector = GaussianVector(1.0);
  return vector.normalized();
}

std::vector<int> Random::Sample(int num, int size) {
  if (num < 0 || num > size) throw std::invalid_argument("Sample: num > size");
  // Floyd's algorithm: O(num), whatever the size.
  std::unordered_set<int> chosen;
  std::vector<int> sample;
  for (int i = size - num; i < size; ++i) {
    int candidate = static_cast<int>(UniformInt(0, i));
    if (!chosen.insert(candidate).second) {
      candidate = i;
      chosen.insert(i);
    }
    sample.push_back(candidate);
  }
  Shuffle(&sample);
  return sample;
}

}  // namespace adasfm
