// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/estimate_priors.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

#include "core/option_checker.h"
#include "core/so3.h"
#include "sensors/build_fusion_problem.h"
#include "sensors/calibration_check/wheel_clock.h"
#include "sensors/check_logs.h"
#include "sensors/io/format_figures.h"
#include "sensors/noise_figures.h"
#include "sensors/select_images.h"
#include "sensors/smoother/chain_state.h"
#include "sensors/smoother/compose_inertial_motion.h"
#include "sensors/smoother/compose_prior.h"
#include "sensors/smoother/compose_wheel_translation.h"
#include "sensors/smoother/standstill.h"
#include "sensors/time_shift_effects.h"
#include "sensors/timed_rotations.h"
#include "sensors/use_vision.h"
#include "sensors/wheel_skids.h"

namespace adasfm {
namespace {

// Noise figures are corrected this often at most, and only while they change by
// more than estimates from some hundred residuals err.
constexpr int kMaxNumCorrections = 6;
// Clock errors below this many sigmas of the smoother's wheel delay are left to
// it.
constexpr double kMaxDelaySigmas = 2.0;
// The smoother has the wheels' delay to first order. Longer ones are taken out
// of the times: 50 ms made models of two worlds 1.4 and 2.4 times as wrong.
constexpr double kMaxFirstOrderDelayS = 0.005;
constexpr double kMinDelaySigmas = 3.0;

// Adds the rotation error from errors of the time between the images. It is the
// same on all axes: rows that are exposed one after another also tilt and skew
// the picture (a phone's rotations erred half as much across the rotation axis
// as about it).
void AddIntervalTimeError(const UnexplainedRotation& unexplained,
                          RelativePosePrior* prior) {
  const double error = unexplained.interval_time_sigma_s /
                       SecondsFromNs(prior->dt_ns) *
                       LogSo3(prior->cam2_from_cam1.rotation).norm();
  prior->covariance.topLeftCorner<3, 3>().diagonal().array() += error * error;
}

// The stages of EstimatePriors and their common data.
class PriorEstimator {
 public:
  PriorEstimator(const SensorCalibration& calibration,
                 const PriorEstimationOptions& options)
      : stated_(calibration), calibration_(calibration), options_(options) {}

  StatusOr<PriorEstimate> Run(const std::vector<ImageStamp>& images,
                              const SensorLogs& logs,
                              const std::vector<VisualRotation>& rotations);

 private:
  void SelectLogs(const SensorLogs& logs);
  Status FindImagesInLogs();
  void CorrectWheelClock();
  // For wheels without an IMU.
  void LeaveOutWheelSkids();
  // The images' times on the IMU's clock.
  std::vector<timestamp_t> ImageTimesOfImu() const;
  Status CheckMotion();
  // Whether the times of wheels and odometry were moved.
  bool TakeOutWheelDelay();
  void Fuse();
  void BuildPriors();
  void BuildInertialMotions();
  void DifferentiateByTimeShift();
  void FillSummary();
  Status CheckWheelScale();

  const SensorCalibration& stated_;
  // With the noise figures in use.
  SensorCalibration calibration_;
  const PriorEstimationOptions& options_;
  MotionLogs logs_;
  std::vector<ImageStamp> all_images_;
  std::vector<ImageStamp> images_;  // inside the logs
  VisionUse vision_;
  OdometryTimeline timeline_;
  OdometryFusionProblem problem_;
  OdometryFusionResult fused_;
  // What was taken out of the times.
  double wheel_delay_s_ = 0.0;
  PriorEstimate estimate_;
};

void PriorEstimator::SelectLogs(const SensorLogs& logs) {
  SensorSummary& summary = estimate_.summary;
  if (calibration_.has_imu) logs_.imu = logs.imu;
  if (calibration_.has_wheel) {
    logs_.wheel = ComputeWheelSpeeds(logs.wheel, calibration_);
    logs_.odometry = logs.odometry;
  }
  RaiseNoiseFigures(logs_, &calibration_, &summary.warnings);
  if (!calibration_.has_imu && !logs.imu.empty()) {
    summary.warnings.push_back(
        "the calibration has no imu0: the IMU log is not used");
  }
  if (!calibration_.has_wheel &&
      !(logs.wheel.empty() && logs.odometry.empty())) {
    summary.warnings.push_back(
        "the calibration has no wheel0: the wheel log is not used");
  }
  SummarizeRates(logs_, &summary);
  if (summary.imu_rate_hz > 0.0 &&
      std::abs(summary.imu_rate_hz / calibration_.imu_rate_hz - 1.0) > 0.2) {
    summary.warnings.push_back(FormatFigures(
        "the IMU log runs at %.1f Hz where imu0/update_rate says %.1f",
        summary.imu_rate_hz, calibration_.imu_rate_hz));
  }
}

Status PriorEstimator::FindImagesInLogs() {
  StatusOr<std::vector<ImageStamp>> images = SelectImages(
      all_images_, vision_.timeshift_ns, logs_.StartNs(), logs_.EndNs());
  if (!images.ok()) return images.status();
  images_ = std::move(images).value();
  return Status::Ok();
}

void PriorEstimator::CorrectWheelClock() {
  if (options_.estimate_time_shift == 0) return;
  const std::optional<double> shift_s =
      FindWheelClockShift(logs_.imu, logs_.wheel, calibration_);
  // Small delays are an unknown of the smoother, which estimates them better.
  if (!shift_s || std::abs(*shift_s) < kMaxDelaySigmas * kWheelDelaySigmaS) {
    return;
  }
  for (WheelSpeed& speed : logs_.wheel) {
    speed.timestamp_ns += NsFromSeconds(*shift_s);
  }
  SensorSummary& summary = estimate_.summary;
  summary.wheel_clock_shift_s = *shift_s;
  summary.warnings.push_back(FormatFigures(
      "wheels and gyroscope turn at times that differ by %+.3f s: this was "
      "added to the times of the wheels",
      *shift_s, 0.0));
}

void PriorEstimator::LeaveOutWheelSkids() {
  if (!logs_.imu.empty()) return;
  const int num_skids = LeaveOutSkids(&logs_.wheel);
  if (num_skids == 0) return;
  estimate_.summary.warnings.push_back(
      "the wheels move as no tyre holds (more than 12 m/s^2) in " +
      std::to_string(num_skids) + " places: they skid there, and are left out");
}

std::vector<timestamp_t> PriorEstimator::ImageTimesOfImu() const {
  std::vector<timestamp_t> times_ns;
  for (const ImageStamp& image : images_) {
    times_ns.push_back(image.timestamp_ns + vision_.timeshift_ns);
  }
  return times_ns;
}

Status PriorEstimator::CheckMotion() {
  SensorSummary& summary = estimate_.summary;
  const Status status =
      CheckCoverage(ImageTimesOfImu(), logs_, &summary.warnings);
  if (!status.ok()) return status;
  const std::string contradiction =
      FindContradiction(logs_, calibration_, &summary.warnings);
  if (!contradiction.empty()) {
    if (options_.check_against_vision) return Status::Error(contradiction);
    summary.warnings.push_back(contradiction);
  }
  return Status::Ok();
}

bool PriorEstimator::TakeOutWheelDelay() {
  const double delay_s = fused_.wheel_delay_s;
  if (std::abs(delay_s) <
      std::max(kMaxFirstOrderDelayS,
               kMinDelaySigmas * fused_.wheel_delay_sigma_s)) {
    return false;
  }
  for (WheelSpeed& speed : logs_.wheel) {
    speed.timestamp_ns -= NsFromSeconds(delay_s);
  }
  for (OdometryPose& pose : logs_.odometry) {
    pose.timestamp_ns -= NsFromSeconds(delay_s);
  }
  wheel_delay_s_ += delay_s;
  return true;
}

void PriorEstimator::Fuse() {
  const std::vector<timestamp_t> times_ns = ImageTimesOfImu();
  logs_.seen_moving_ns = vision_.seen_moving_ns;
  for (auto& [start_ns, end_ns] : logs_.seen_moving_ns) {
    start_ns += vision_.timeshift_ns;
    end_ns += vision_.timeshift_ns;
  }
  logs_.parked_ns = FindParkedIntervals(logs_, calibration_.imu_noise);
  SensorSummary& summary = estimate_.summary;
  double wheel_persistence = 1.0;
  int num_seen_slips = 0;
  for (int i = 0; i <= kMaxNumCorrections; ++i) {
    FusionInput input =
        BuildFusionProblem(options_, calibration_, times_ns, logs_, vision_);
    timeline_ = std::move(input.timeline);
    problem_ = std::move(input.problem);
    problem_.wheel_persistence = wheel_persistence;
    num_seen_slips = input.num_seen_slips;
    fused_ = FuseOdometry(problem_, options_.fusion);
    // The delay has no honest sigma before the noise has its figures.
    if (i == kMaxNumCorrections ||
        (!CorrectNoiseFigures(stated_, fused_, &calibration_,
                              &wheel_persistence, &summary) &&
         !TakeOutWheelDelay())) {
      break;
    }
  }
  if (num_seen_slips > 0) {
    summary.warnings.push_back(
        "the wheels turn otherwise than the cameras between " +
        std::to_string(num_seen_slips) +
        " pairs of images in a row: they slip there, and are left out");
  }
  summary.gyroscope_noise_factor =
      calibration_.imu_noise.gyroscope_noise_density /
      stated_.imu_noise.gyroscope_noise_density;
  summary.accelerometer_noise_factor =
      calibration_.imu_noise.accelerometer_noise_density /
      stated_.imu_noise.accelerometer_noise_density;
}

void PriorEstimator::BuildPriors() {
  const Eigen::Vector3d down(0.0, 0.0, -1.0);
  for (size_t i = 0; i < images_.size(); ++i) {
    const size_t index = timeline_.indices[i];
    const auto has_attitude = [this](size_t k) {
      return problem_.links[k].has_imu || problem_.links[k].is_parked;
    };
    if ((index > 0 && has_attitude(index - 1)) ||
        (index < problem_.links.size() && has_attitude(index))) {
      estimate_.gravity_in_cam[images_[i].image_id] =
          calibration_.cam_from_imu.rotation *
          (fused_.states[index].world_from_imu.conjugate() * down);
    }
    if (i + 1 == images_.size()) break;
    RelativePosePrior prior =
        ComposePrior(problem_, fused_, index, timeline_.indices[i + 1],
                     calibration_.cam_from_imu);
    prior.image_id1 = images_[i].image_id;
    prior.image_id2 = images_[i + 1].image_id;
    prior.dt_ns = images_[i + 1].timestamp_ns - images_[i].timestamp_ns;
    AddIntervalTimeError(estimate_.summary.unexplained_rotation, &prior);
    if (const std::optional<double> moving_s =
            SecondsBesideParking(problem_, index, timeline_.indices[i + 1])) {
      prior.dt_ns = std::max<timestamp_t>(1, NsFromSeconds(*moving_s));
    }
    if (prior.flags != 0) estimate_.priors.push_back(prior);
  }
}

void PriorEstimator::BuildInertialMotions() {
  for (size_t i = 0; i + 1 < images_.size(); ++i) {
    std::optional<InertialMotion> motion = ComposeInertialMotion(
        problem_, fused_, timeline_.indices[i], timeline_.indices[i + 1],
        calibration_.cam_from_imu);
    if (!motion) continue;
    motion->image_id1 = images_[i].image_id;
    motion->image_id2 = images_[i + 1].image_id;
    motion->by_wheels = ComposeWheelTranslation(
        problem_, fused_, timeline_.indices[i], timeline_.indices[i + 1],
        calibration_.cam_from_imu);
    estimate_.inertial_motions.push_back(*motion);
  }
}

void PriorEstimator::DifferentiateByTimeShift() {
  std::map<image_t, ImuMotion> felt;
  for (size_t i = 0; i < images_.size(); ++i) {
    const std::optional<ImuMotion> motion = MeasureImuMotion(
        logs_.imu, images_[i].timestamp_ns + vision_.timeshift_ns,
        fused_.states[timeline_.indices[i]]);
    if (motion) felt[images_[i].image_id] = *motion;
  }
  std::map<std::pair<image_t, image_t>, RelativePosePrior*> priors;
  for (RelativePosePrior& prior : estimate_.priors) {
    priors[{prior.image_id1, prior.image_id2}] = &prior;
  }
  // Motions exist where the IMU has no gap.
  for (InertialMotion& motion : estimate_.inertial_motions) {
    const auto first = felt.find(motion.image_id1);
    const auto second = felt.find(motion.image_id2);
    const auto prior = priors.find({motion.image_id1, motion.image_id2});
    if (first == felt.end() || second == felt.end() || prior == priors.end()) {
      continue;
    }
    SetTimeShiftEffects(first->second, second->second,
                        calibration_.cam_from_imu, prior->second);
    SetTimeShiftEffects(first->second, second->second,
                        calibration_.cam_from_imu, *prior->second, &motion);
  }
}

void PriorEstimator::FillSummary() {
  SensorSummary& summary = estimate_.summary;
  summary.num_images = static_cast<int>(all_images_.size());
  summary.num_images_in_logs = static_cast<int>(images_.size());
  summary.num_priors = static_cast<int>(estimate_.priors.size());
  summary.prior_ratio = static_cast<double>(summary.num_priors) /
                        std::max<size_t>(1, all_images_.size() - 1);
  summary.timeshift_cam_imu_s = SecondsFromNs(vision_.timeshift_ns);
  const auto first = estimate_.gravity_in_cam.find(images_[0].image_id);
  if (first != estimate_.gravity_in_cam.end()) {
    summary.first_gravity_in_cam = first->second;
  }
  SummarizeFusion(problem_, fused_, logs_, &summary);
  summary.wheel_delay_s += wheel_delay_s_;
  PredictDrift(problem_, !logs_.imu.empty(), &summary);
  summary.wheel_slips = ListWheelSlips(fused_, timeline_, vision_.timeshift_ns);
}

Status PriorEstimator::CheckWheelScale() {
  bool is_error = false;
  const std::string text =
      DescribeWheelScale(estimate_.summary.wheel_scale, &is_error);
  if (text.empty()) return Status::Ok();
  if (is_error && options_.check_against_vision) return Status::Error(text);
  estimate_.summary.warnings.push_back(text);
  return Status::Ok();
}

StatusOr<PriorEstimate> PriorEstimator::Run(
    const std::vector<ImageStamp>& images, const SensorLogs& logs,
    const std::vector<VisualRotation>& rotations) {
  if (images.empty()) return Status::Error("no image has a time");
  SelectLogs(logs);
  if (logs_.IsEmpty()) {
    return Status::Error(
        "no sensor log: give an IMU or a wheel log, and its section in the "
        "calibration");
  }
  vision_.timeshift_ns = NsFromSeconds(calibration_.timeshift_cam_imu_s);
  // 1. Images inside the logs.
  StatusOr<std::vector<ImageStamp>> ordered = OrderImages(images);
  if (!ordered.ok()) return ordered.status();
  all_images_ = std::move(ordered).value();
  Status status = FindImagesInLogs();
  if (!status.ok()) return status;
  // 2. Vision against the gyroscope; this may correct the time shift.
  std::map<image_t, timestamp_t> times_ns;
  for (const ImageStamp& image : all_images_) {
    times_ns[image.image_id] = image.timestamp_ns;
  }
  vision_.rotations = ComputeTimedRotations(rotations, times_ns);
  vision_.seen_moving_ns = FindSeenMotion(rotations, times_ns);
  status =
      UseVision(calibration_, options_, &logs_, &vision_, &estimate_.summary);
  if (!status.ok()) return status;
  if (logs_.IsEmpty()) {
    estimate_.summary.num_images = static_cast<int>(all_images_.size());
    return std::move(estimate_);
  }
  status = FindImagesInLogs();
  if (!status.ok()) return status;
  // The other sensors against each other.
  CorrectWheelClock();
  LeaveOutWheelSkids();
  status = CheckMotion();
  if (!status.ok()) return status;
  // 3. and 4. Preintegration and smoother.
  Fuse();
  // 5. Camera frames and figures.
  BuildPriors();
  BuildInertialMotions();
  DifferentiateByTimeShift();
  FillSummary();
  status = CheckWheelScale();
  if (!status.ok()) return status;
  return std::move(estimate_);
}

}  // namespace

bool PriorEstimationOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmPriors", error)
             .Require(estimate_time_shift >= -1 && estimate_time_shift <= 1,
                      "estimate_time_shift", estimate_time_shift,
                      "must be -1, 0 or 1")
             .AllHold() &&
         links.IsValid(error) && fusion.IsValid(error);
}

StatusOr<PriorEstimate> EstimatePriors(
    const std::vector<ImageStamp>& images, const SensorLogs& logs,
    const SensorCalibration& calibration,
    const std::vector<VisualRotation>& visual_rotations,
    const PriorEstimationOptions& options) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  return PriorEstimator(calibration, options)
      .Run(images, logs, visual_rotations);
}

}  // namespace adasfm
