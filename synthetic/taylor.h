// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>

namespace adasfm {

// A function of time near one instant: f(t + h) = c0 + c1 h + c2 h^2 + c3 h^3.
// Arithmetic on these gives exact derivatives of the drive, so the synthetic
// inertial samples carry no differentiation error.
struct Taylor {
  std::array<double, 4> c = {0.0, 0.0, 0.0, 0.0};

  Taylor() = default;
  Taylor(double value) : c{value, 0.0, 0.0, 0.0} {}  // NOLINT: implicit
  static Taylor Variable(double value) {
    Taylor t(value);
    t.c[1] = 1.0;
    return t;
  }
};

inline Taylor operator+(Taylor a, const Taylor& b) {
  for (int i = 0; i < 4; ++i) a.c[i] += b.c[i];
  return a;
}

inline Taylor operator-(Taylor a, const Taylor& b) {
  for (int i = 0; i < 4; ++i) a.c[i] -= b.c[i];
  return a;
}

inline Taylor operator*(const Taylor& a, const Taylor& b) {
  Taylor product;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; i + j < 4; ++j) product.c[i + j] += a.c[i] * b.c[j];
  }
  return product;
}

// g(x) from g and its first three derivatives at x.c[0].
inline Taylor Compose(const Taylor& x, const std::array<double, 4>& g) {
  Taylor step = x;
  step.c[0] = 0.0;
  return Taylor(g[0]) +
         step * (Taylor(g[1]) +
                 step * (Taylor(g[2] / 2.0) + step * Taylor(g[3] / 6.0)));
}

inline Taylor sin(const Taylor& x) {
  const double s = std::sin(x.c[0]);
  const double c = std::cos(x.c[0]);
  return Compose(x, {s, c, -s, -c});
}

inline Taylor cos(const Taylor& x) {
  const double s = std::sin(x.c[0]);
  const double c = std::cos(x.c[0]);
  return Compose(x, {c, -s, -c, s});
}

inline Taylor atan(const Taylor& x) {
  const double z = x.c[0];
  const double d = 1.0 / (1.0 + z * z);
  return Compose(
      x, {std::atan(z), d, -2.0 * z * d * d, (6.0 * z * z - 2.0) * d * d * d});
}

inline Taylor operator/(const Taylor& a, const Taylor& b) {
  const double r = 1.0 / b.c[0];
  return a * Compose(b, {r, -r * r, 2.0 * r * r * r, -6.0 * r * r * r * r});
}

// The derivative; its highest coefficient is lost.
inline Taylor Differentiate(const Taylor& x) {
  Taylor d;
  for (int i = 1; i < 4; ++i) d.c[i - 1] = i * x.c[i];
  return d;
}

// The integral with the value start; the highest coefficient of x is not
// needed.
inline Taylor Integrate(const Taylor& x, double start) {
  Taylor integral(start);
  for (int i = 1; i < 4; ++i) integral.c[i] = x.c[i - 1] / i;
  return integral;
}

inline double Value(double x) { return x; }
inline double Value(const Taylor& x) { return x.c[0]; }

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

// The integral of SmoothStep from 0.
inline double SmoothStepIntegral(double u) {
  if (u <= 0.0) return 0.0;
  if (u >= 1.0) return 0.5 + (u - 1.0);
  return std::pow(u, 5) * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u)));
}

}  // namespace adasfm
