// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace adasfm {

// Levenberg-Marquardt damping as in Ceres: scales from the diagonal of the
// first linearisation, and the amounts added to a diagonal.
template <typename Vector>
Vector DampingScales(const Vector& diagonal) {
  return (1.0 + diagonal.array().sqrt()).inverse();
}

template <typename Vector>
Vector Damping(const Vector& diagonal, const Vector& scales,
               double inverse_radius) {
  constexpr double kMinDiagonal = 1e-6;
  constexpr double kMaxDiagonal = 1e32;
  return (diagonal.array() * scales.array().square())
             .max(kMinDiagonal)
             .min(kMaxDiagonal) *
         inverse_radius / scales.array().square();
}

}  // namespace adasfm
