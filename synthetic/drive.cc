// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/drive.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/so3.h"
#include "synthetic/taylor.h"

namespace adasfm {
namespace {

constexpr double kBendLength = 18.0;  // m, along the path
// The car is slower from this far before a bend to that far behind it.
constexpr double kSlowBefore = 12.0;
constexpr double kSlowBehind = 8.0;
constexpr double kSlowdown = 0.6;  // 1 / speed grows by this share
constexpr double kSpeedVariation = 0.08;
constexpr double kSpeedWaveLength = 130.0;
constexpr double kStartDuration = 2.5;  // s, from rest to full speed
// The first image is taken when the car has just got going.
constexpr double kFirstImageDelay = 1.0;
constexpr double kAxleHeight = 0.3;

// Step from 0 to 1 with three continuous derivatives.
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

double SmoothStepIntegral(double u) {
  if (u <= 0.0) return 0.0;
  if (u >= 1.0) return 0.5 + (u - 1.0);
  return std::pow(u, 5) * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u)));
}

// Gauss-Legendre over [0, u] of the direction in a left bend.
Eigen::Vector2d BendDisplacement(double u) {
  constexpr std::array<double, 5> kNodes = {
      0.0, 0.5384693101056831, -0.5384693101056831, 0.9061798459386640,
      -0.9061798459386640};
  constexpr std::array<double, 5> kWeights = {
      0.5688888888888889, 0.4786286704993665, 0.4786286704993665,
      0.2369268850561891, 0.2369268850561891};
  constexpr int kNumPanels = 16;
  Eigen::Vector2d sum(0.0, 0.0);
  const double half = 0.5 * u / kNumPanels;
  for (int panel = 0; panel < kNumPanels; ++panel) {
    for (size_t k = 0; k < kNodes.size(); ++k) {
      const double x = half * (2 * panel + 1 + kNodes[k]);
      const double angle = 0.5 * kPi * SmoothStep(x);
      sum += half * kWeights[k] *
             Eigen::Vector2d(std::cos(angle), std::sin(angle));
    }
  }
  return kBendLength * sum;
}

template <typename T, typename Waves>
T SumWaves(const Waves& waves, const T& s) {
  using std::sin;
  T sum(0.0);
  for (const auto& wave : waves) {
    sum =
        sum + T(wave.amplitude) * sin(T(wave.wave_number) * s + T(wave.phase));
  }
  return sum;
}

template <typename T, typename Waves>
T SumWaveSlopes(const Waves& waves, const T& s) {
  using std::cos;
  T sum(0.0);
  for (const auto& wave : waves) {
    sum = sum + T(wave.amplitude * wave.wave_number) *
                    cos(T(wave.wave_number) * s + T(wave.phase));
  }
  return sum;
}

// A rotation about an axis, as a Taylor series of matrices up to order two.
using RotationSeries = std::array<Eigen::Matrix3d, 3>;

RotationSeries AxisRotation(int axis, const Taylor& angle) {
  const Taylor c = cos(angle);
  const Taylor s = sin(angle);
  const int a = (axis + 1) % 3;
  const int b = (axis + 2) % 3;
  RotationSeries series;
  for (int k = 0; k < 3; ++k) {
    series[k].setZero();
    series[k](a, a) = series[k](b, b) = c.c[k];
    series[k](b, a) = s.c[k];
    series[k](a, b) = -s.c[k];
  }
  series[0](axis, axis) = 1.0;
  return series;
}

RotationSeries operator*(const RotationSeries& a, const RotationSeries& b) {
  return {a[0] * b[0], a[0] * b[1] + a[1] * b[0],
          a[0] * b[2] + a[1] * b[1] + a[2] * b[0]};
}

}  // namespace

Drive::Drive(const SyntheticWorldOptions& options, const Route& route,
             const Rigid3d& imu_from_wheel)
    : imu_from_wheel_(imu_from_wheel),
      // 8 m/s, but between 2.5 and 20 images a second.
      cruise_speed_(options.image_interval_s > 0.0
                        ? options.spacing_m / options.image_interval_s
                        : std::clamp(8.0, options.spacing_m / 0.4,
                                     options.spacing_m / 0.05)),
      standstill_s_(options.standstill_s) {
  BuildSegments(route);
  DrawWaves(options);
}

void Drive::BuildSegments(const Route& route) {
  // How far before and behind a crossing the bend reaches.
  const double reach = BendDisplacement(1.0).x();
  const auto node = [&route](size_t i) {
    return Eigen::Vector2d(kBlockSize * route.nodes[i][0],
                           kBlockSize * route.nodes[i][1]);
  };
  double s = 0.0;
  Eigen::Vector2d position = node(0);
  for (size_t i = 1; i + 1 < route.nodes.size(); ++i) {
    const Eigen::Vector2d in = (node(i) - node(i - 1)) / kBlockSize;
    const Eigen::Vector2d out = (node(i + 1) - node(i)) / kBlockSize;
    const double heading = std::atan2(in.y(), in.x());
    const int turn =
        static_cast<int>(std::lround(in.x() * out.y() - in.y() * out.x()));
    const Eigen::Vector2d end =
        turn == 0 ? node(i) : Eigen::Vector2d(node(i) - reach * in);
    const double length = (end - position).norm();
    segments_.push_back({s, length, position, heading, 0});
    s += length;
    position = end;
    if (turn != 0) {
      segments_.push_back({s, kBendLength, position, heading, turn});
      bends_.push_back(s);
      s += kBendLength;
      position = node(i) + reach * out;
    }
  }
}

void Drive::DrawWaves(const SyntheticWorldOptions& options) {
  Random random = MakeRandom(options.seed, 3);
  const auto draw = [&random](double amplitude, double wave_length) {
    return Wave{amplitude, 2.0 * kPi / wave_length,
                random.Uniform(0.0, 2.0 * kPi)};
  };
  // On the straight street the centres have to stay on a line up to
  // millimetres.
  const bool is_straight = options.trajectory == SyntheticTrajectory::kStraight;
  const double tilt = DegToRad(is_straight ? 0.08 : 0.4);
  const double weave = is_straight ? 0.001 : 0.25;
  const double heave = is_straight ? 0.001 : 0.005;
  weave_ = {draw(weave, 57.0), draw(0.3 * weave, 23.0)};
  roll_ = {draw(tilt, 9.1), draw(0.5 * tilt, 4.3)};
  pitch_ = {draw(0.9 * tilt, 7.3), draw(0.4 * tilt, 3.7)};
  heave_ = {draw(heave, 6.1), draw(0.4 * heave, 3.1)};
}

const Drive::Segment& Drive::SegmentAt(double s) const {
  const auto after = std::upper_bound(segments_.begin(), segments_.end(), s,
                                      [](double value, const Segment& segment) {
                                        return value < segment.begin;
                                      });
  return after == segments_.begin() ? segments_.front() : *std::prev(after);
}

Eigen::Vector2d Drive::AxisPosition(double s) const {
  const Segment& segment = SegmentAt(s);
  Eigen::Vector2d local(s - segment.begin, 0.0);
  if (segment.turn != 0) {
    local = BendDisplacement(local.x() / kBendLength);
    local.y() *= segment.turn;
  }
  return segment.start + Eigen::Rotation2Dd(segment.heading) * local;
}

template <typename T>
T Drive::Heading(const T& s) const {
  const Segment& segment = SegmentAt(Value(s));
  if (segment.turn == 0) return T(segment.heading);
  return T(segment.heading) +
         T(0.5 * kPi * segment.turn) *
             SmoothStep((s - T(segment.begin)) * T(1.0 / kBendLength));
}

template <typename T>
T Drive::Curvature(const T& s) const {
  const Segment& segment = SegmentAt(Value(s));
  if (segment.turn == 0) return T(0.0);
  return T(0.5 * kPi * segment.turn / kBendLength) *
         SmoothStepDerivative((s - T(segment.begin)) * T(1.0 / kBendLength));
}

template <typename T>
T Drive::SpeedFactor(const T& time_s) const {
  if (standstill_s_ <= 0.0) return T(1.0);
  return SmoothStep((time_s - T(standstill_s_)) * T(1.0 / kStartDuration));
}

// d(nominal time) / ds, 1 / speed of the car when it is under way.
template <typename T>
T Drive::Slowness(const T& s) const {
  using std::cos;
  const double wave_number = 2.0 * kPi / kSpeedWaveLength;
  T factor = T(1.0) + T(kSpeedVariation) * cos(T(wave_number) * s);
  const auto after =
      std::upper_bound(bends_.begin(), bends_.end(), Value(s) + kSlowBefore);
  if (after != bends_.begin()) {
    const double width = kSlowBefore + kBendLength + kSlowBehind;
    const T u = (s - T(*std::prev(after) - kSlowBefore)) * T(1.0 / width);
    // 64 u^3 (1 - u)^3 peaks at 1.
    factor = factor + T(kSlowdown * 64.0 / 140.0) * SmoothStepDerivative(u);
  }
  return factor * T(1.0 / cruise_speed_);
}

// The integral of Slowness from 0.
double Drive::NominalTime(double s) const {
  const double wave_number = 2.0 * kPi / kSpeedWaveLength;
  double sum = s + kSpeedVariation * std::sin(wave_number * s) / wave_number;
  const auto after =
      std::upper_bound(bends_.begin(), bends_.end(), s + kSlowBefore);
  if (after != bends_.begin()) {
    const double width = kSlowBefore + kBendLength + kSlowBehind;
    const double u = (s - *std::prev(after) + kSlowBefore) / width;
    const double num_before = after - bends_.begin() - 1;
    sum += kSlowdown * 64.0 / 140.0 * width * (num_before + SmoothStep(u));
  }
  return sum / cruise_speed_;
}

double Drive::ArcLengthAtNominalTime(double tau) const {
  if (tau <= 0.0) return 0.0;
  double low = 0.0;
  double high = 2.0 * cruise_speed_ * tau;
  double s = cruise_speed_ * tau;
  for (int i = 0; i < 100; ++i) {
    const double error = NominalTime(s) - tau;
    (error > 0.0 ? high : low) = s;
    double next = s - error / Slowness(s);
    if (next <= low || next >= high) next = 0.5 * (low + high);
    if (std::abs(next - s) < 1e-14 * (1.0 + s)) return next;
    s = next;
  }
  return s;
}

double Drive::NominalTimeAt(double time_s) const {
  if (standstill_s_ <= 0.0) return time_s;
  return kStartDuration *
         SmoothStepIntegral((time_s - standstill_s_) / kStartDuration);
}

double Drive::ArcLengthAt(double time_s) const {
  return ArcLengthAtNominalTime(NominalTimeAt(time_s));
}

double Drive::TimeAt(double arc_length_m) const {
  const double tau = NominalTime(arc_length_m);
  if (standstill_s_ <= 0.0) return tau;
  if (tau >= 0.5 * kStartDuration) {
    return tau + standstill_s_ + 0.5 * kStartDuration;
  }
  double low = standstill_s_;
  double high = standstill_s_ + kStartDuration;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (NominalTimeAt(middle) > tau ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

double Drive::FirstImageTime() const {
  return standstill_s_ + kFirstImageDelay;
}

DriveState Drive::StateAt(double time_s) const {
  // 1. Arc length: ds/dt = speed factor / slowness; each round adds an order.
  const double s0 = ArcLengthAt(time_s);
  const Taylor time = Taylor::Variable(time_s);
  Taylor s(s0);
  for (int i = 0; i < 3; ++i) {
    s = Integrate(SpeedFactor(time) / Slowness(s), s0);
  }
  // 2. The axis of the street, and the weave about it.
  const Taylor heading = Heading(s);
  const Taylor speed = Differentiate(s);
  const Eigen::Vector2d axis = AxisPosition(s0);
  const Taylor weave = SumWaves(weave_, s);
  const Taylor x =
      Integrate(cos(heading) * speed, axis.x()) - sin(heading) * weave;
  const Taylor y =
      Integrate(sin(heading) * speed, axis.y()) + cos(heading) * weave;
  const Taylor z = Taylor(kAxleHeight) + SumWaves(heave_, s);
  // The car points where the wheel frame moves: wheels do not skid sideways.
  const Taylor yaw = heading + atan(SumWaveSlopes(weave_, s) /
                                    (Taylor(1.0) - Curvature(s) * weave));
  // 3. The body.
  const RotationSeries rotation = AxisRotation(2, yaw) *
                                  AxisRotation(1, SumWaves(pitch_, s)) *
                                  AxisRotation(0, SumWaves(roll_, s));
  const Rigid3d wheel_from_imu = imu_from_wheel_.Inverse();
  const Eigen::Vector3d& lever = wheel_from_imu.translation;
  const auto order = [&](int k) {
    return Eigen::Vector3d(x.c[k], y.c[k], z.c[k]);
  };
  const Eigen::Matrix3d rate = rotation[0].transpose() * rotation[1];
  const Eigen::Vector3d angular_velocity(rate(2, 1), rate(0, 2), rate(1, 0));
  DriveState state;
  state.world_from_imu =
      Rigid3d(Eigen::Quaterniond(rotation[0]) * wheel_from_imu.rotation,
              order(0) + rotation[0] * lever);
  state.velocity_in_world = order(1) + rotation[1] * lever;
  state.acceleration_in_world = 2.0 * (order(2) + rotation[2] * lever);
  state.angular_velocity_in_imu = imu_from_wheel_.rotation * angular_velocity;
  state.wheel_speed = rotation[0].col(0).dot(order(1));
  state.wheel_yaw_rate = angular_velocity.z();
  return state;
}

}  // namespace adasfm
