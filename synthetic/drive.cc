// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/drive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/random.h"
#include "core/so3.h"
#include "synthetic/routes.h"
#include "synthetic/street_grid.h"
#include "synthetic/taylor.h"

namespace adasfm {
namespace {

// The car is slower from this far before a bend to 4 / 9 behind it, in units of
// the bend's length.
constexpr double kSlowBefore = 2.0 / 3.0;
constexpr double kSlowWidth = kSlowBefore + 1.0 + 4.0 / 9.0;
constexpr double kCarSpeed = 8.0;    // m/s
constexpr double kMowerSpeed = 1.0;  // m/s
constexpr double kSlowdown = 0.6;    // 1 / speed grows by this share
constexpr double kSpeedVariation = 0.08;
constexpr double kSpeedWaveLength = 130.0;
constexpr double kStartDuration = 2.5;  // s, from rest to full speed
constexpr double kBrakeDuration =
    1.5;  // s, before a stop, and to set off again
// The first image is taken when the car has just got going.
constexpr double kFirstImageDelay = 1.0;
constexpr double kAxleHeight = 0.3;

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

// With an interval of their own.
int CountImagesAtRest(const SyntheticWorldOptions& options) {
  if (options.stop_image_interval_s == 0.0) return 0;
  const double num_images =
      options.num_stops *
      std::floor(options.stop_duration_s / options.stop_image_interval_s);
  const int max_num_images = options.num_images / 2;
  if (num_images > max_num_images) {
    throw std::invalid_argument(
        "SyntheticWorldOptions: " + std::to_string(std::llround(num_images)) +
        " images would be taken at rest, but at most " +
        std::to_string(max_num_images) + ", half of the images, may be");
  }
  return static_cast<int>(num_images);
}

}  // namespace

Drive::Drive(const SyntheticWorldOptions& options, const Path& path,
             const Rigid3d& imu_from_wheel)
    : imu_from_wheel_(imu_from_wheel),
      // Between 2.5 and 20 images a second.
      cruise_speed_(
          options.image_interval_s > 0.0
              ? options.spacing_m / options.image_interval_s
              : std::clamp(IsOnLawn(options) ? kMowerSpeed : kCarSpeed,
                           options.spacing_m / 0.4, options.spacing_m / 0.05)),
      standstill_s_(options.standstill_s),
      path_(path),
      slope_(RoadSlope(options)) {
  DrawWaves(options);
  const int num_at_rest = CountImagesAtRest(options);
  SetImageTimes(options, options.num_images - num_at_rest);
  if (options.stop_image_interval_s == 0.0) {
    AddStops(options);
    return;
  }
  // The images under way keep their places.
  std::vector<double> arc_lengths_m;
  for (const double time_s : image_times_s_) {
    arc_lengths_m.push_back(ArcLengthAt(time_s));
  }
  AddStops(options);
  for (size_t i = 0; i < image_times_s_.size(); ++i) {
    image_times_s_[i] = TimeAt(arc_lengths_m[i]);
  }
  AddImagesAtRest(options);
}

void Drive::SetImageTimes(const SyntheticWorldOptions& options,
                          int num_images) {
  const double first_s = FirstImageTime();
  const double last_s =
      TimeAt(ArcLengthAt(first_s) + options.spacing_m * (num_images - 1));
  image_period_s_ = (last_s - first_s) / (num_images - 1);
  for (int i = 0; i < num_images; ++i) {
    image_times_s_.push_back(first_s + i * image_period_s_);
  }
}

void Drive::AddImagesAtRest(const SyntheticWorldOptions& options) {
  const int num_images = CountImagesAtRest(options) / options.num_stops;
  for (const Stop& stop : stops_) {
    for (int i = 0; i < num_images; ++i) {
      image_times_s_.push_back(stop.begin_s +
                               (i + 0.5) * options.stop_image_interval_s);
    }
  }
  std::sort(image_times_s_.begin(), image_times_s_.end());
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
  const bool is_on_lawn = IsOnLawn(options);
  const double tilt = DegToRad(is_straight ? 0.08 : is_on_lawn ? 0.8 : 0.4);
  const double weave = is_straight ? 0.001 : is_on_lawn ? 0.03 : 0.25;
  const double heave = is_straight ? 0.001 : 0.005;
  // A mower is a quarter of a car's size.
  const double size = is_on_lawn ? 0.25 : 1.0;
  weave_ = {draw(weave, size * 57.0), draw(0.3 * weave, size * 23.0)};
  roll_ = {draw(tilt, size * 9.1), draw(0.5 * tilt, size * 4.3)};
  pitch_ = {draw(0.9 * tilt, size * 7.3), draw(0.4 * tilt, size * 3.7)};
  heave_ = {draw(heave, size * 6.1), draw(0.4 * heave, size * 3.1)};
}

void Drive::AddStops(const SyntheticWorldOptions& options) {
  const int num_stops = options.num_stops + options.num_spins;
  if (num_stops == 0) return;
  const double first_s = FirstImageTime();
  const double span_s = image_times_s_.back() - first_s;
  const bool has_own_time = options.stop_image_interval_s > 0.0;
  Random random = MakeRandom(options.seed, 14);
  std::vector<Stop> stops;
  double lost_s = 0.0;
  for (int k = 0; k < num_stops; ++k) {
    // Turns on the spot lie evenly among the stops.
    const bool is_spin = (k + 1) * options.num_spins / num_stops >
                         k * options.num_spins / num_stops;
    const double duration_s =
        is_spin ? options.spin_duration_s : options.stop_duration_s;
    const double sign = random.Uniform(0.0, 1.0) < 0.5 ? -1.0 : 1.0;
    const double begin_s = first_s + span_s * (k + 1) / (num_stops + 1) +
                           (has_own_time ? lost_s : -0.5 * duration_s);
    stops.push_back(
        {begin_s, begin_s + duration_s, is_spin ? sign * 2.0 * kPi : 0.0});
    lost_s += duration_s + kBrakeDuration;
  }
  if (!has_own_time && lost_s > 0.5 * span_s) {
    throw std::invalid_argument(
        "SyntheticWorldOptions: the stops and turns on the spot take " +
        std::to_string(lost_s) + " s, but at most " +
        std::to_string(0.5 * span_s) +
        " s, half of the drive's time, may be spent with them");
  }
  stops_ = std::move(stops);
}

template <typename T>
T Drive::SpeedFactor(const T& time_s) const {
  T factor(1.0);
  if (standstill_s_ > 0.0) {
    factor = SmoothStep((time_s - T(standstill_s_)) * T(1.0 / kStartDuration));
  }
  for (const Stop& stop : stops_) {
    const double scale = 1.0 / kBrakeDuration;
    factor =
        factor -
        SmoothStep((time_s - T(stop.begin_s - kBrakeDuration)) * T(scale)) +
        SmoothStep((time_s - T(stop.end_s)) * T(scale));
  }
  return factor;
}

template <typename T>
T Drive::TurnOnTheSpot(const T& time_s) const {
  T turn(0.0);
  for (const Stop& stop : stops_) {
    if (stop.turn_rad == 0.0) continue;
    turn = turn +
           T(stop.turn_rad) * SmoothStep((time_s - T(stop.begin_s)) *
                                         T(1.0 / (stop.end_s - stop.begin_s)));
  }
  return turn;
}

// The last bend that the car has begun to slow down for at s, if any.
int Drive::LastBendIndex(double s) const {
  const std::vector<Path::Segment>& bends = path_.bends();
  const auto after =
      std::upper_bound(bends.begin(), bends.end(), s,
                       [](double value, const Path::Segment& bend) {
                         return value < bend.begin - kSlowBefore * bend.length;
                       });
  return static_cast<int>(after - bends.begin()) - 1;
}

// d(nominal time) / ds, 1 / speed of the car when it is under way.
template <typename T>
T Drive::Slowness(const T& s) const {
  using std::cos;
  const double wave_number = 2.0 * kPi / kSpeedWaveLength;
  T factor = T(1.0) + T(kSpeedVariation) * cos(T(wave_number) * s);
  const int index = LastBendIndex(Value(s));
  if (index >= 0) {
    const Path::Segment& bend = path_.bends()[index];
    const T u = (s - T(bend.begin - kSlowBefore * bend.length)) *
                T(1.0 / (kSlowWidth * bend.length));
    // 64 u^3 (1 - u)^3 peaks at 1.
    factor = factor + T(kSlowdown * 64.0 / 140.0) * SmoothStepDerivative(u);
  }
  return factor * T(1.0 / cruise_speed_);
}

// The integral of Slowness from 0.
double Drive::NominalTime(double s) const {
  const double wave_number = 2.0 * kPi / kSpeedWaveLength;
  double sum = s + kSpeedVariation * std::sin(wave_number * s) / wave_number;
  for (int k = LastBendIndex(s); k >= 0; --k) {
    const Path::Segment& bend = path_.bends()[k];
    const double width = kSlowWidth * bend.length;
    const double u = (s - bend.begin + kSlowBefore * bend.length) / width;
    sum += kSlowdown * 64.0 / 140.0 * width * SmoothStep(u);
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
  double tau = time_s;
  if (standstill_s_ > 0.0) {
    tau = kStartDuration *
          SmoothStepIntegral((time_s - standstill_s_) / kStartDuration);
  }
  for (const Stop& stop : stops_) {
    const double begin_s = stop.begin_s - kBrakeDuration;
    tau -= kBrakeDuration *
           (SmoothStepIntegral((time_s - begin_s) / kBrakeDuration) -
            SmoothStepIntegral((time_s - stop.end_s) / kBrakeDuration));
  }
  return tau;
}

double Drive::ArcLengthAt(double time_s) const {
  return ArcLengthAtNominalTime(NominalTimeAt(time_s));
}

double Drive::TimeAt(double arc_length_m) const {
  const double tau = NominalTime(arc_length_m);
  double low = 0.0;
  double high = tau + standstill_s_ + kStartDuration;
  for (const Stop& stop : stops_) {
    high += stop.end_s - stop.begin_s + kBrakeDuration;
  }
  for (int i = 0; i < 100 && low < high; ++i) {
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
  const Taylor heading = path_.Heading(s);
  const Taylor speed = Differentiate(s);
  const Eigen::Vector2d axis = path_.Position(s0);
  const Taylor weave = SumWaves(weave_, s);
  const Taylor x =
      Integrate(cos(heading) * speed, axis.x()) - sin(heading) * weave;
  const Taylor y =
      Integrate(sin(heading) * speed, axis.y()) + cos(heading) * weave;
  const Taylor z =
      Taylor(kAxleHeight) + Taylor(slope_) * s + SumWaves(heave_, s);
  // The car heads where the wheel frame moves: wheels do not slip sideways.
  const Taylor yaw = heading +
                     atan(SumWaveSlopes(weave_, s) /
                          (Taylor(1.0) - path_.Curvature(s) * weave)) +
                     TurnOnTheSpot(time);
  // 3. The body.
  const Taylor pitch = SumWaves(pitch_, s) - Taylor(std::atan(slope_));
  const RotationSeries rotation = AxisRotation(2, yaw) *
                                  AxisRotation(1, pitch) *
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
