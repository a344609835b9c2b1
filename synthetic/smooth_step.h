// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "synthetic/taylor.h"

namespace adasfm {

// Step from 0 to 1 over u in [0, 1] with three continuous derivatives; for
// numbers and Taylor series.
template <typename T>
T SmoothStep(const T& u) {
  if (Value(u) <= 0.0) return T(0.0);
  if (Value(u) >= 1.0) return T(1.0);
  return u * u * u * u *
         (T(35.0) + u * (T(-84.0) + u * (T(70.0) + u * T(-20.0))));
}

template <typename T>
T SmoothStepDerivative(const T& u) {
  if (Value(u) <= 0.0 || Value(u) >= 1.0) return T(0.0);
  const T v = T(1.0) - u;
  return T(140.0) * u * u * u * v * v * v;
}

// The integral from 0.
inline double SmoothStepIntegral(double u) {
  if (u <= 0.0) return 0.0;
  if (u >= 1.0) return 0.5 + (u - 1.0);
  return std::pow(u, 5) * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u)));
}

}  // namespace adasfm
