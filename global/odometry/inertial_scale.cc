// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/inertial_scale.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/median.h"

namespace adasfm {
namespace {

// Unknowns of a window: position and velocity at its start, error of its
// gravity.
constexpr int kNumLocal = 9;
// Unknowns of all windows, in the centres' unit: gravity, bias, units per
// metre.
constexpr int kNumShared = 7;
constexpr int kBias = 3;
constexpr int kUnit = 6;
constexpr double kGravitySigma = 0.1;            // m/s^2, of a window
constexpr double kAccelerometerBiasSigma = 0.3;  // m/s^2
constexpr double kGravity = 9.81;
// Largest relative difference of the scales by gravity and by the other data.
constexpr double kMaxGravityError = 0.1;
constexpr double kMaxSigmaRatio = 0.2;
// 1 sigma of the scales of an accelerometer's axes, which the data do not
// observe.
constexpr double kScaleFactorSigma = 0.002;
// p0 and v0 alone take two images, the scale and redundancy some more.
constexpr int kMinNumImages = 5;
constexpr double kMinShareOfWindow = 0.6;
// Fewer windows do not determine their errors.
constexpr size_t kMinNumWindows = 8;
constexpr int kNumIterations = 20;

// Normal equations, in columns: shared unknowns, right-hand side, and the
// window's own unknowns, which are eliminated.
struct Window {
  int num_residuals = 0;
  Eigen::Matrix<double, kNumShared + 1 + kNumLocal, kNumShared + 1 + kNumLocal>
      squares = Eigen::Matrix<double, kNumShared + 1 + kNumLocal,
                              kNumShared + 1 + kNumLocal>::Zero();
  // With the own unknowns eliminated, for the present noise.
  Eigen::Matrix<double, kNumShared + 1, kNumShared + 1> reduced;
  double chi = 0.0;  // root mean square of the residuals
  double weight = 1.0;
};

// A run of motions from image to image.
struct Run {
  size_t first = 0;
  size_t last = 0;  // one behind
};

std::vector<Run> FindRuns(const std::vector<InertialMotion>& motions,
                          const std::map<image_t, Rigid3d>& cams_from_world) {
  std::vector<Run> runs;
  for (size_t k = 0; k < motions.size(); ++k) {
    if (cams_from_world.count(motions[k].image_id1) == 0 ||
        cams_from_world.count(motions[k].image_id2) == 0) {
      continue;
    }
    if (!runs.empty() && runs.back().last == k &&
        motions[k - 1].image_id2 == motions[k].image_id1) {
      runs.back().last = k + 1;
    } else {
      runs.push_back({k, k + 1});
    }
  }
  return runs;
}

Window BuildWindow(const std::vector<InertialMotion>& motions,
                   const std::map<image_t, Rigid3d>& cams_from_world,
                   const Run& run) {
  Window window;
  const Rigid3d& start = cams_from_world.at(motions[run.first].image_id1);
  const Eigen::Vector3d start_center = start.TargetOriginInSource();
  const Eigen::Vector3d& lever = motions[run.first].camera_from_imu_origin;
  const Eigen::Vector3d start_lever = start.rotation.conjugate() * lever;
  double t = 0.0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  Eigen::Matrix3d position_by_bias = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d velocity_by_bias = Eigen::Matrix3d::Zero();
  const auto add = [&](image_t image_id) {
    const Rigid3d& pose = cams_from_world.at(image_id);
    Eigen::Matrix<double, 3, kNumShared + 1 + kNumLocal> rows;
    // c = u (position + lever) + p0 + v0 t + (g + d) t^2 / 2 + by_bias b
    rows << 0.5 * t * t * Eigen::Matrix3d::Identity(), position_by_bias,
        position + pose.rotation.conjugate() * lever - start_lever,
        pose.TargetOriginInSource() - start_center, Eigen::Matrix3d::Identity(),
        t * Eigen::Matrix3d::Identity(),
        0.5 * t * t * Eigen::Matrix3d::Identity();
    window.squares += rows.transpose() * rows;
    window.num_residuals += 3;
  };
  add(motions[run.first].image_id1);
  for (size_t k = run.first; k < run.last; ++k) {
    const InertialMotion& motion = motions[k];
    const Eigen::Matrix3d world_from_cam = cams_from_world.at(motion.image_id1)
                                               .rotation.conjugate()
                                               .toRotationMatrix();
    position += velocity * motion.dt_s + world_from_cam * motion.delta_position;
    velocity += world_from_cam * motion.delta_velocity;
    position_by_bias += velocity_by_bias * motion.dt_s +
                        world_from_cam * motion.position_by_bias;
    velocity_by_bias += world_from_cam * motion.velocity_by_bias;
    t += motion.dt_s;
    add(motion.image_id2);
  }
  return window;
}

std::vector<Window> BuildWindows(
    const std::vector<InertialMotion>& motions,
    const std::map<image_t, Rigid3d>& cams_from_world,
    const std::vector<Run>& runs, double window_s) {
  std::vector<Window> windows;
  for (const Run& run : runs) {
    Run piece = run;
    while (piece.first < run.last) {
      double duration_s = 0.0;
      piece.last = piece.first;
      while (piece.last < run.last && duration_s < window_s) {
        duration_s += motions[piece.last++].dt_s;
      }
      if (duration_s >= kMinShareOfWindow * window_s &&
          piece.last - piece.first + 1 >= kMinNumImages) {
        windows.push_back(BuildWindow(motions, cams_from_world, piece));
      }
      piece.first = piece.last;
    }
  }
  return windows;
}

// The scale by windows of one length.
class ScaleSolver {
 public:
  explicit ScaleSolver(std::vector<Window> windows)
      : windows_(std::move(windows)) {}

  // False when the equations have no sensible solution.
  bool Solve() {
    for (int i = 0; i < kNumIterations; ++i) {
      equations_ = Equations();
      for (Window& window : windows_) {
        Eliminate(&window);
        Add(window, 1.0, &equations_);
      }
      HoldBack(kAccelerometerBiasSigma, 1.0,
               equations_.hessian.diagonal().segment<3>(kBias));
      const Eigen::LLT<Matrix> factor(equations_.hessian);
      if (factor.info() != Eigen::Success) return false;
      variance_ = factor.solve(Vector::Unit(kUnit))[kUnit];
      solution_ = factor.solve(equations_.right);
      if (!solution_.allFinite()) return false;
      units_per_metre_ = solution_.head<3>().norm() / kGravity;
      Reweight();
    }
    return std::abs(solution_[kUnit] / units_per_metre_ - 1.0) <=
           kMaxGravityError;
  }

  InertialScale Scale() const {
    const double unit = solution_[kUnit];
    double signal = 0.0, residuals = 0.0;
    for (const Window& window : windows_) {
      const double information = Information(window);
      signal += information * unit * unit * window.reduced(kUnit, kUnit);
      residuals += information * window.chi * window.chi *
                   (window.num_residuals - kNumOwnDof);
    }
    // How much the unit would be too small if all noise were the IMU's.
    const double bias = unit * residuals / signal;
    InertialScale scale;
    scale.metres_per_unit = 1.0 / unit;
    scale.sigma_ratio =
        std::sqrt(std::max(variance_, JackknifeVariance()) + bias * bias) /
        unit;
    return scale;
  }

 private:
  static constexpr double kHeld = 1e6;
  // Position and velocity, which have no prior.
  static constexpr int kNumOwnDof = 6;

  using Matrix = Eigen::Matrix<double, kNumShared, kNumShared>;
  using Vector = Eigen::Matrix<double, kNumShared, 1>;
  struct Equations {
    Matrix hessian = Matrix::Zero();
    Vector right = Vector::Zero();
  };

  double Information(const Window& window) const {
    return window.weight / (noise_ * noise_);
  }

  // Adds the prior of an acceleration, zero with this sigma (m/s^2), to its
  // information in equations of this noise. The acceleration is held at zero
  // until the unit is known.
  template <typename Diagonal>
  void HoldBack(double sigma, double noise, Diagonal information) const {
    if (units_per_metre_ == 0.0) {
      information *= kHeld;
    } else {
      const double ratio = noise / (sigma * units_per_metre_);
      information.array() += ratio * ratio;
    }
  }

  void Eliminate(Window* window) const {
    Eigen::Matrix<double, kNumLocal, kNumLocal> own =
        window->squares.bottomRightCorner<kNumLocal, kNumLocal>();
    HoldBack(kGravitySigma, 1.0 / std::sqrt(Information(*window)),
             own.diagonal().tail<3>());
    const auto across =
        window->squares.topRightCorner<kNumShared + 1, kNumLocal>();
    window->reduced =
        window->squares.topLeftCorner<kNumShared + 1, kNumShared + 1>() -
        across * own.ldlt().solve(across.transpose());
  }

  // sign: 1 adds the window, -1 takes it out.
  void Add(const Window& window, double sign, Equations* equations) const {
    const double information = sign * Information(window);
    equations->hessian +=
        information * window.reduced.topLeftCorner<kNumShared, kNumShared>();
    equations->right +=
        information * window.reduced.col(kNumShared).head<kNumShared>();
  }

  void Reweight() {
    Eigen::Matrix<double, kNumShared + 1, 1> coefficients;
    coefficients << -solution_, 1.0;
    std::vector<double> chis;
    for (Window& window : windows_) {
      const double square = coefficients.dot(window.reduced * coefficients);
      window.chi = std::sqrt(std::max(0.0, square) /
                             (window.num_residuals - kNumOwnDof));
      chis.push_back(window.chi);
    }
    noise_ = std::max(std::numeric_limits<double>::min(), UpperMedian(&chis));
    for (Window& window : windows_) {
      const double ratio = window.chi / (2.0 * noise_);
      window.weight = 1.0 / (1.0 + ratio * ratio);
    }
  }

  // Spread of the solutions that leave out one window each. The residuals
  // within a window are alike, so that their number is not meaningful.
  double JackknifeVariance() const {
    double sum = 0.0;
    for (const Window& window : windows_) {
      Equations without = equations_;
      Add(window, -1.0, &without);
      const Eigen::LLT<Matrix> factor(without.hessian);
      if (factor.info() != Eigen::Success) {
        return std::numeric_limits<double>::infinity();
      }
      const double change =
          factor.solve(without.right)[kUnit] - solution_[kUnit];
      sum += change * change;
    }
    const double n = static_cast<double>(windows_.size());
    return sum * (n - 1.0) / n;
  }

  std::vector<Window> windows_;
  double noise_ = 1.0;            // in the unit of the centres
  double units_per_metre_ = 0.0;  // by gravity; 0: not known yet
  Equations equations_;
  Vector solution_;
  double variance_ = 0.0;  // of the units a metre
};

// All scales are of the same data: the mean has the least of their sigmas, and
// in addition their spread.
InertialScale CombineScales(const std::vector<InertialScale>& scales) {
  double sum = 0.0, mean = 0.0, square = 0.0;
  for (const InertialScale& scale : scales) {
    const double weight = 1.0 / (scale.sigma_ratio * scale.sigma_ratio);
    const double log_size = std::log(scale.metres_per_unit);
    sum += weight;
    mean += weight * log_size;
    square += weight * log_size * log_size;
  }
  mean /= sum;
  InertialScale combined =
      *std::min_element(scales.begin(), scales.end(),
                        [](const InertialScale& a, const InertialScale& b) {
                          return a.sigma_ratio < b.sigma_ratio;
                        });
  combined.metres_per_unit = std::exp(mean);
  combined.sigma_ratio = std::sqrt(combined.sigma_ratio * combined.sigma_ratio +
                                   std::max(0.0, square / sum - mean * mean));
  return combined;
}

}  // namespace

std::optional<InertialScale> EstimateInertialScale(
    const std::vector<InertialMotion>& motions,
    const std::map<image_t, Rigid3d>& cams_from_world) {
  const std::vector<Run> runs = FindRuns(motions, cams_from_world);
  std::vector<InertialScale> scales;
  for (const double window_s : {1.0, 2.0, 4.0, 8.0, 16.0}) {
    std::vector<Window> windows =
        BuildWindows(motions, cams_from_world, runs, window_s);
    if (windows.size() < kMinNumWindows) continue;
    ScaleSolver solver(std::move(windows));
    if (solver.Solve()) scales.push_back(solver.Scale());
  }
  if (scales.empty()) return std::nullopt;
  InertialScale scale = CombineScales(scales);
  scale.sigma_ratio = std::hypot(scale.sigma_ratio, kScaleFactorSigma);
  if (!(scale.sigma_ratio <= kMaxSigmaRatio)) return std::nullopt;
  return scale;
}

}  // namespace adasfm
