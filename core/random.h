// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>
#include <vector>

namespace adasfm {

// The only source of random numbers: seeded, passed by reference. Distributions
// are implemented here, since those of the standard library differ between
// libraries; so a seed gives the same numbers everywhere.
class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}

  // Uniform in [min, max).
  double Uniform(double min, double max);
  // Uniform in {min, ..., max}.
  int64_t UniformInt(int64_t min, int64_t max);
  // Normal with mean 0.
  double Gaussian(double sigma);
  Eigen::Vector3d GaussianVector(double sigma);
  // Uniform on the unit sphere.
  Eigen::Vector3d UnitVector();
  // num different values of {0, ..., size - 1}, in random order.
  std::vector<int> Sample(int num, int size);

  template <typename T>
  void Shuffle(std::vector<T>* values) {
    for (size_t i = values->size(); i > 1; --i) {
      std::swap((*values)[i - 1], (*values)[UniformInt(0, i - 1)]);
    }
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace adasfm
