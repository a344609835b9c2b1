// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/calibration_check/unexplained_rotation.h"

#include <Eigen/Core>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kMaxCameraShiftS = 0.3;
constexpr double kCameraStepS = 0.01;
constexpr int kNumFitRounds = 5;

using Rates = std::vector<Eigen::Vector3d>;

// Subtracts the median of each axis: the bias and a constant rotation carry no
// information.
void Center(Rates* rates) {
  std::vector<double> values(rates->size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < rates->size(); ++i) values[i] = (*rates)[i][axis];
    const double median = UpperMedian(&values);
    for (Eigen::Vector3d& rate : *rates) rate[axis] -= median;
  }
}

Rates CenterRates(const std::vector<Eigen::Vector3d>& turns,
                  const std::vector<double>& dt_s) {
  Rates rates(turns.size());
  for (size_t i = 0; i < turns.size(); ++i) rates[i] = turns[i] / dt_s[i];
  Center(&rates);
  return rates;
}

// Centered again: medians per axis are not the same point in both frames.
Rates Residuals(const Rates& visual, const Rates& gyro,
                const Eigen::Matrix3d& map) {
  Rates residuals(visual.size());
  for (size_t i = 0; i < visual.size(); ++i) {
    residuals[i] = visual[i] - map * gyro[i];
  }
  Center(&residuals);
  return residuals;
}

std::vector<double> Lengths(const Rates& rates) {
  std::vector<double> lengths;
  for (const Eigen::Vector3d& rate : rates) lengths.push_back(rate.norm());
  return lengths;
}

// Weights that bound the influence of each interval.
std::vector<double> BoundedWeights(const std::vector<double>& distances) {
  const double least = 0.1 * Median(distances) + 1e-9;
  std::vector<double> weights(distances.size());
  for (size_t i = 0; i < weights.size(); ++i) {
    weights[i] = 1.0 / std::max(distances[i], least);
  }
  return weights;
}

Eigen::Matrix3d FitMeanRotation(const Rates& visual, const Rates& gyro,
                                const std::vector<double>& weights) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < visual.size(); ++i) {
    sum += weights[i] * visual[i] * gyro[i].transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  return svd.matrixU() * sign * svd.matrixV().transpose();
}

double FitScale(const Rates& visual, const Rates& gyro,
                const Eigen::Matrix3d& map,
                const std::vector<double>& weights) {
  double both = 0.0, square = 0.0;
  for (size_t i = 0; i < visual.size(); ++i) {
    both += weights[i] * visual[i].dot(map * gyro[i]);
    square += weights[i] * gyro[i].squaredNorm();
  }
  return square > 0.0 ? both / square : 0.0;
}

// The least median distances, rad/s, after a rotation of the gyroscope's rates,
// without and with a scale.
struct MeanRotationFit {
  double residual = std::numeric_limits<double>::infinity();
  double scaled_residual = std::numeric_limits<double>::infinity();
  Rates residuals;  // without scale
};

MeanRotationFit FitMeanRotation(const Rates& visual, const Rates& gyro) {
  MeanRotationFit fit;
  std::vector<double> weights(visual.size(), 1.0);
  std::vector<double> scaled_weights = weights;
  for (int round = 0; round < kNumFitRounds; ++round) {
    const Eigen::Matrix3d map = FitMeanRotation(visual, gyro, weights);
    Rates residuals = Residuals(visual, gyro, map);
    const std::vector<double> distances = Lengths(residuals);
    const double residual = Median(distances);
    weights = BoundedWeights(distances);
    if (residual < fit.residual) {
      fit.residual = residual;
      fit.residuals = std::move(residuals);
    }
    const Eigen::Matrix3d scaled_map =
        FitScale(visual, gyro, map, scaled_weights) * map;
    const std::vector<double> scaled =
        Lengths(Residuals(visual, gyro, scaled_map));
    fit.scaled_residual = std::min(fit.scaled_residual, Median(scaled));
    scaled_weights = BoundedWeights(scaled);
  }
  return fit;
}

// The error of one two-view rotation, rad.
struct VisualError {
  double length = 0.0;  // median of the error vector's length
  double along = 0.0;   // median about the rotation axis
};

// Closure errors of triangles of images; none without enough triangles.
std::optional<VisualError> MeasureVisualError(
    const std::vector<TimedRotation>& rotations) {
  std::map<timestamp_t, std::map<timestamp_t, Eigen::Quaterniond>> by_time;
  for (const TimedRotation& rotation : rotations) {
    by_time[rotation.start_ns][rotation.end_ns] = rotation.cam2_from_cam1;
  }
  std::vector<double> lengths, along;
  for (const auto& [start, from_start] : by_time) {
    for (const auto& [middle, middle_from_start] : from_start) {
      const auto from_middle = by_time.find(middle);
      if (from_middle == by_time.end()) continue;
      for (const auto& [end, end_from_middle] : from_middle->second) {
        const auto direct = from_start.find(end);
        if (direct == from_start.end()) continue;
        const Eigen::Vector3d error = LogSo3(
            direct->second.conjugate() * (end_from_middle * middle_from_start));
        const Eigen::Vector3d axis = LogSo3(direct->second).normalized();
        lengths.push_back(error.norm() / std::sqrt(3.0));
        along.push_back(std::abs(error.dot(axis)) / std::sqrt(3.0));
      }
    }
  }
  if (lengths.size() < kMinNumRotations) return std::nullopt;
  return VisualError{Median(std::move(lengths)), Median(std::move(along))};
}

// For each interval: the residual rotation about the rotation axis, the angular
// rate, and the joint sigma of vision and gyroscope.
struct RotationRest {
  std::vector<double> angles;
  std::vector<double> rates;
  std::vector<double> sigmas;
};

// The sigma at which the median of angle^2 / (sigma^2 + (time sigma * rate)^2)
// is that of a chi-square with one degree of freedom.
double FindIntervalTimeSigma(const RotationRest& rest) {
  // Readout and exposure last no longer: a larger sigma has another cause.
  constexpr double kMaxSigmaS = 0.03;
  constexpr double kChiSquareMedian = 0.455;
  // Noise figures and errors of the extrinsics leave less than this.
  constexpr double kMinExcess = 2.0;
  std::vector<double> ratios(rest.angles.size());
  const auto median_ratio = [&](double sigma_s) {
    for (size_t i = 0; i < ratios.size(); ++i) {
      ratios[i] = std::pow(rest.angles[i], 2) /
                  (std::pow(rest.sigmas[i], 2) +
                   std::pow(sigma_s * rest.rates[i], 2) + 1e-18);
    }
    return Median(ratios);
  };
  if (median_ratio(0.0) < kMinExcess * kChiSquareMedian) return 0.0;
  if (median_ratio(kMaxSigmaS) > kChiSquareMedian) return 0.0;
  double low = 0.0, high = kMaxSigmaS;
  for (int i = 0; i < 30; ++i) {
    const double middle = 0.5 * (low + high);
    (median_ratio(middle) > kChiSquareMedian ? low : high) = middle;
  }
  return high;
}

}  // namespace

UnexplainedRotation FindUnexplainedRotation(
    const std::vector<TimedRotation>& rotations, const ShiftSearch& search,
    double shift_s, double gyroscope_noise_density) {
  UnexplainedRotation result;
  const std::optional<VisualError> visual_error = MeasureVisualError(rotations);
  if (!visual_error) return result;
  result.visual_error_deg = RadToDeg(visual_error->length);
  double least = std::numeric_limits<double>::infinity();
  const int num_steps =
      static_cast<int>(std::round(kMaxCameraShiftS / kCameraStepS));
  constexpr double kNormalMedian = 0.6745;
  const double visual_sigma = visual_error->along / kNormalMedian;
  RotationRest rest;
  const auto compare_at = [&](double shift) {
    const RotationComparison data = search.CompareShortest(shift);
    if (data.visual.size() < kMinNumRotations) return;
    const Rates gyro = CenterRates(data.gyro, data.dt_s);
    const Rates visual = CenterRates(data.visual, data.dt_s);
    const MeanRotationFit fit = FitMeanRotation(visual, gyro);
    if (fit.residual >= least) return;
    least = fit.residual;
    rest = RotationRest();
    for (size_t i = 0; i < data.dt_s.size(); ++i) {
      rest.angles.push_back(data.dt_s[i] *
                            data.visual[i].normalized().dot(fit.residuals[i]));
      rest.rates.push_back(data.visual[i].norm() / data.dt_s[i]);
      rest.sigmas.push_back(std::hypot(
          visual_sigma, gyroscope_noise_density * std::sqrt(data.dt_s[i])));
    }
    const double interval_s = Median(data.dt_s);
    result.is_conclusive = true;
    result.residual_deg = RadToDeg(fit.residual * interval_s);
    result.turning_deg = RadToDeg(Median(Lengths(gyro)) * interval_s);
    result.scaled_residual_deg = RadToDeg(fit.scaled_residual * interval_s);
    result.visual_turning_deg = RadToDeg(Median(Lengths(visual)) * interval_s);
  };
  compare_at(shift_s);
  for (int step = -num_steps; step <= num_steps; ++step) {
    compare_at(step * kCameraStepS);
  }
  if (result.is_conclusive) {
    result.interval_time_sigma_s = FindIntervalTimeSigma(rest);
  }
  return result;
}

}  // namespace adasfm
