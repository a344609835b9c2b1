// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/estimate_priors.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "core/so3.h"
#include "sensors/bridged_holes.h"
#include "sensors/calibration_check/check_against_vision.h"
#include "sensors/calibration_check/clock_jump.h"
#include "sensors/calibration_check/wheel_clock.h"
#include "sensors/check_logs.h"
#include "sensors/io/format_figures.h"
#include "sensors/noise_figures.h"
#include "sensors/select_images.h"
#include "sensors/smoother/build_odometry_links.h"
#include "sensors/smoother/compose_prior.h"
#include "sensors/smoother/initial_odometry.h"
#include "sensors/visual_links.h"

namespace adasfm {
namespace {

// Noise figures are corrected this often at most, within this factor of the
// stated ones, and for as long as they change by more than estimates of some
// hundred residuals err.
constexpr int kMaxNumCorrections = 6;
constexpr double kMaxNoiseFactor = 5.0;
// Slip is a share of the speed, which no figure of the log's noise states: on
// gravel wheels err by 40 times theirs. Sums over seconds vary by as much more.
constexpr double kMaxWheelNoiseFactor = 100.0;
constexpr double kMaxWheelPersistence = 100.0;
constexpr double kMinNoiseChange = 1.2;
// The smoother finds a delay of the wheels that is within its prior.
constexpr double kMaxDelaySigmas = 2.0;
// Below it gyroscope and pictures have nothing in common, as logs of another
// drive; a stabilised video keeps the slow turns.
constexpr double kMinSameMotionCorrelation = 0.4;

// Moves a factor by another, within limits; whether it moved enough to matter.
bool Correct(double by, double min_factor, double max_factor, double* factor) {
  const double corrected = std::clamp(*factor * by, min_factor, max_factor);
  const double change = corrected / *factor;
  if (std::max(change, 1.0 / change) < kMinNoiseChange) return false;
  *factor = corrected;
  return true;
}

// The time between the images errs, and with it the turn. About all axes alike:
// rows that are exposed one after another also tilt and skew the picture (a
// phone's rotations erred half as much across the axis of the turn as about
// it).
void AddIntervalTimeError(const UnexplainedRotation& unexplained,
                          RelativePosePrior* prior) {
  const double error = unexplained.interval_time_sigma_s /
                       SecondsFromNs(prior->dt_ns) *
                       LogSo3(prior->cam2_from_cam1.rotation).norm();
  prior->covariance.topLeftCorner<3, 3>().diagonal().array() += error * error;
}

// The stages of EstimatePriors with what they share.
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
  Status CheckVision();
  void CorrectTimeShift(const VisionCheck& check);
  // What the IMU says is of no use; the other logs stay.
  Status LeaveOutImu(const VisionCheck& check);
  void CorrectWheelClock();
  Status CheckMotion();
  void UndoFilter(const VisionCheck& check);
  void Fuse();
  void BuildProblem();
  // The smoother's residuals against the noise figures; whether these changed.
  bool CorrectNoise();
  void BuildPriors();
  void FillSummary();
  Status CheckWheelScale();
  ImuBias FirstBias() const;

  const SensorCalibration& stated_;
  // With the noise figures in use.
  SensorCalibration calibration_;
  const PriorEstimationOptions& options_;
  MotionLogs logs_;
  timestamp_t timeshift_ns_ = 0;
  std::vector<ImageStamp> all_images_;
  std::vector<ImageStamp> images_;  // inside the logs
  // What vision saw; empty when it contradicts the gyroscope.
  std::vector<TimedRotation> rotations_;
  bool has_visual_bias_ = false;
  Eigen::Vector3d visual_bias_ = Eigen::Vector3d::Zero();
  double visual_bias_sigma_ = 0.0;
  double wheel_persistence_ = 1.0;  // OdometryFusionProblem's
  OdometryTimeline timeline_;
  OdometryFusionProblem problem_;
  OdometryFusionResult fused_;
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
  StatusOr<std::vector<ImageStamp>> images =
      SelectImages(all_images_, timeshift_ns_, logs_.StartNs(), logs_.EndNs());
  if (!images.ok()) return images.status();
  images_ = std::move(images).value();
  return Status::Ok();
}

Status PriorEstimator::CheckVision() {
  if (logs_.imu.empty() || rotations_.empty()) return Status::Ok();
  VisionCheck check = CheckAgainstVision(rotations_, logs_.imu, calibration_,
                                         VisionCheckOptions());
  if (check.contradiction_is_time_shift) {
    const std::string jump = FindClockJump(rotations_, logs_.imu, calibration_,
                                           VisionCheckOptions());
    check.contradiction_is_time_shift = jump.empty();
    if (!jump.empty()) check.contradiction = jump;
  }
  SensorSummary& summary = estimate_.summary;
  if (!check.is_conclusive) {
    summary.warnings.push_back(
        "the gyroscope cannot be checked against vision: too little turning, "
        "or two-view rotations too few or too poor");
    return Status::Ok();
  }
  summary.visual_timeshift_correction_s = check.time_shift_correction_s;
  summary.unexplained_rotation = check.unexplained;
  if (check.contradiction_is_motion && options_.check_against_vision) {
    return LeaveOutImu(check);
  }
  const bool may_correct =
      check.contradiction.empty() || check.contradiction_is_time_shift;
  if (may_correct &&
      (options_.estimate_time_shift == 1 ||
       (options_.estimate_time_shift == -1 && check.is_clock_shift))) {
    CorrectTimeShift(check);
  } else if (!check.contradiction.empty()) {
    if (options_.check_against_vision) {
      return Status::Error(check.contradiction);
    }
    summary.warnings.push_back(check.contradiction);
    rotations_.clear();
    return Status::Ok();
  }
  has_visual_bias_ = options_.use_visual_rotations;
  // Before any data the bias is zero, with a sigma of its own.
  const double visual_variance = std::pow(options_.visual_bias_sigma, 2) +
                                 std::pow(check.gyroscope_bias_sigma, 2);
  const double prior_variance =
      std::pow(options_.fusion.gyroscope_bias_sigma, 2);
  const double share = prior_variance / (prior_variance + visual_variance);
  visual_bias_ = share * check.gyroscope_bias;
  visual_bias_sigma_ = std::sqrt((1.0 - share) * prior_variance);
  if (options_.undo_gyroscope_filter) UndoFilter(check);
  return Status::Ok();
}

void PriorEstimator::CorrectTimeShift(const VisionCheck& check) {
  SensorSummary& summary = estimate_.summary;
  timeshift_ns_ += NsFromSeconds(check.time_shift_correction_s);
  summary.timeshift_was_corrected = true;
  if (options_.estimate_time_shift == 1) return;
  summary.warnings.push_back(FormatFigures(
      "vision shows that images and IMU differ by %+.4f s more than "
      "timeshift_cam_imu says, and the priors were made with that: write "
      "timeshift_cam_imu: %.4f into the calibration",
      check.time_shift_correction_s, SecondsFromNs(timeshift_ns_)));
}

Status PriorEstimator::LeaveOutImu(const VisionCheck& check) {
  if (!(logs_.wheel.empty() && logs_.odometry.empty()) &&
      check.shifted_correlation < kMinSameMotionCorrelation) {
    return Status::Error(
        "vision and gyroscope contradict each other: check T_cam_imu, the "
        "clocks and whether logs and images belong together (" +
        check.contradiction + ")");
  }
  SensorSummary& summary = estimate_.summary;
  summary.imu_was_left_out = true;
  summary.warnings.push_back(
      check.contradiction +
      ". The IMU is left out: a video that the camera stabilised turns "
      "otherwise than the camera; switch the stabilisation off "
      "(--force 1 uses the IMU all the same)");
  logs_.imu.clear();
  rotations_.clear();
  return logs_.IsEmpty() ? Status::Ok() : FindImagesInLogs();
}

void PriorEstimator::CorrectWheelClock() {
  if (options_.estimate_time_shift == 0) return;
  const std::optional<double> shift_s =
      FindWheelClockShift(logs_.imu, logs_.wheel, calibration_);
  // What is near is an unknown of the smoother, which knows it better.
  if (!shift_s || std::abs(*shift_s) <
                      kMaxDelaySigmas * options_.fusion.wheel_delay_sigma_s) {
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

Status PriorEstimator::CheckMotion() {
  SensorSummary& summary = estimate_.summary;
  std::vector<timestamp_t> times_ns;
  for (const ImageStamp& image : images_) {
    times_ns.push_back(image.timestamp_ns + timeshift_ns_);
  }
  const Status status = CheckCoverage(times_ns, logs_, &summary.warnings);
  if (!status.ok()) return status;
  const std::string contradiction =
      FindContradiction(logs_, calibration_, &summary.warnings);
  if (!contradiction.empty()) {
    if (options_.check_against_vision) return Status::Error(contradiction);
    summary.warnings.push_back(contradiction);
  }
  return Status::Ok();
}

void PriorEstimator::UndoFilter(const VisionCheck& check) {
  if (check.filter.lag_s == 0.0) return;
  // Of the clock in use.
  GyroscopeFilter filter = check.filter;
  filter.delay_s += calibration_.timeshift_cam_imu_s +
                    check.time_shift_correction_s -
                    SecondsFromNs(timeshift_ns_);
  UndoGyroscopeFilter(filter, &logs_.imu);
  estimate_.summary.gyroscope_lag_s = filter.lag_s;
  estimate_.summary.gyroscope_delay_s = filter.delay_s;
}

ImuBias PriorEstimator::FirstBias() const {
  ImuBias bias;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double time = 0.0;
  for (const OdometryLink& link : problem_.links) {
    if (link.standstill == StandstillKind::kNone) continue;
    sum += LogSo3(link.imu.delta_rotation);
    time += link.dt_s;
  }
  if (time > 0.5) {
    bias.gyroscope = sum / time;
  } else if (has_visual_bias_) {
    bias.gyroscope = visual_bias_;
  }
  return bias;
}

void PriorEstimator::BuildProblem() {
  OdometryLinkOptions link_options;
  link_options.max_imu_gap_s = options_.max_imu_gap_s;
  link_options.max_wheel_gap_s = options_.max_wheel_gap_s;
  link_options.max_link_s = options_.max_link_s;
  link_options.max_lead_s = options_.max_lead_s;
  link_options.lateral_speed_noise = options_.fusion.lateral_speed_noise;
  link_options.vertical_speed_noise = options_.fusion.vertical_speed_noise;
  std::vector<timestamp_t> times;
  for (const ImageStamp& image : images_) {
    times.push_back(image.timestamp_ns + timeshift_ns_);
  }
  problem_ = OdometryFusionProblem();
  timeline_ = BuildTimeline(times, logs_, link_options);
  problem_.imu_from_wheel = calibration_.imu_from_wheel;
  problem_.imu_noise = calibration_.imu_noise;
  problem_.wheel_persistence = wheel_persistence_;
  problem_.links = BuildOdometryLinks(timeline_.times_ns, logs_, calibration_,
                                      ImuBias(), link_options);
  const ImuBias bias = FirstBias();
  if (bias.gyroscope != Eigen::Vector3d::Zero()) {
    // Preintegrated about the right bias, first-order corrections stay small.
    problem_.links = BuildOdometryLinks(timeline_.times_ns, logs_, calibration_,
                                        bias, link_options);
  }
  AddHoleUncertainty(logs_, timeline_.times_ns,
                     calibration_.imu_from_wheel.rotation, &problem_.links);
  if (options_.use_visual_rotations) {
    const VisualLinks visual = AddVisualRotations(
        rotations_, timeshift_ns_, calibration_.cam_from_imu.rotation,
        timeline_, &problem_);
    estimate_.summary.num_visual_links = visual.num_links;
    estimate_.summary.visual_sigma_deg = RadToDeg(visual.sigma_rad);
  }
  // What the links hold already must not count twice.
  if (has_visual_bias_ && estimate_.summary.num_visual_links == 0) {
    problem_.prior_gyroscope_bias = visual_bias_;
    problem_.prior_gyroscope_bias_sigma = visual_bias_sigma_;
  }
  problem_.initial_states =
      EstimateInitialOdometry(problem_.links, problem_.imu_from_wheel,
                              options_.fusion.gravity_m_s2, bias);
}

bool PriorEstimator::CorrectNoise() {
  NoiseCheck speed = fused_.wheel_speed_check;
  NoiseCheck yaw = fused_.wheel_yaw_check;
  SensorSummary& summary = estimate_.summary;
  if (calibration_.wheel_type == WheelType::kDifferential ||
      calibration_.wheel_type == WheelType::kTicks) {
    // One figure for the speed of a wheel.
    speed.chi2 += yaw.chi2;
    speed.redundancy += yaw.redundancy;
    yaw = NoiseCheck();
  }
  // A smaller figure than the stated one is not believed: what wheels err by is
  // more than the noise of their readings.
  bool any = Correct(speed.Factor(), 1.0, kMaxWheelNoiseFactor,
                     &summary.wheel_speed_noise_factor);
  any |= Correct(yaw.Factor(), 1.0, kMaxNoiseFactor,
                 &summary.wheel_yaw_noise_factor);
  double persistence = std::sqrt(wheel_persistence_);
  any |= Correct(std::sqrt(fused_.wheel_persistence / wheel_persistence_), 1.0,
                 std::sqrt(kMaxWheelPersistence), &persistence);
  wheel_persistence_ = persistence * persistence;
  double accelerometer = calibration_.imu_noise.accelerometer_noise_density /
                         stated_.imu_noise.accelerometer_noise_density;
  any |= Correct(fused_.accelerometer_check.Factor(), 1.0, kMaxNoiseFactor,
                 &accelerometer);
  calibration_.imu_noise.accelerometer_noise_density =
      accelerometer * stated_.imu_noise.accelerometer_noise_density;
  calibration_.wheel_speed_noise =
      summary.wheel_speed_noise_factor * stated_.wheel_speed_noise;
  calibration_.wheel_yaw_rate_noise =
      summary.wheel_yaw_noise_factor * stated_.wheel_yaw_rate_noise;
  return any;
}

void PriorEstimator::Fuse() {
  for (int i = 0; i <= kMaxNumCorrections; ++i) {
    BuildProblem();
    fused_ = FuseOdometry(problem_, options_.fusion);
    if (i == kMaxNumCorrections || !CorrectNoise()) break;
  }
  estimate_.summary.gyroscope_noise_factor =
      calibration_.imu_noise.gyroscope_noise_density /
      stated_.imu_noise.gyroscope_noise_density;
  estimate_.summary.accelerometer_noise_factor =
      calibration_.imu_noise.accelerometer_noise_density /
      stated_.imu_noise.accelerometer_noise_density;
}

void PriorEstimator::BuildPriors() {
  const Eigen::Vector3d down(0.0, 0.0, -1.0);
  for (size_t i = 0; i < images_.size(); ++i) {
    const size_t index = timeline_.indices[i];
    const bool has_imu =
        (index > 0 && problem_.links[index - 1].has_imu) ||
        (index < problem_.links.size() && problem_.links[index].has_imu);
    if (has_imu) {
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
    if (prior.flags != 0) estimate_.priors.push_back(prior);
  }
}

void PriorEstimator::FillSummary() {
  SensorSummary& summary = estimate_.summary;
  summary.num_images = static_cast<int>(all_images_.size());
  summary.num_images_in_logs = static_cast<int>(images_.size());
  summary.num_priors = static_cast<int>(estimate_.priors.size());
  summary.prior_ratio = static_cast<double>(summary.num_priors) /
                        std::max<size_t>(1, all_images_.size() - 1);
  summary.timeshift_cam_imu_s = SecondsFromNs(timeshift_ns_);
  const auto first = estimate_.gravity_in_cam.find(images_[0].image_id);
  if (first != estimate_.gravity_in_cam.end()) {
    summary.first_gravity_in_cam = first->second;
  }
  SummarizeFusion(problem_, fused_, logs_, &summary);
  PredictDrift(problem_, !logs_.imu.empty(), &summary);
  summary.wheel_slips = ListWheelSlips(fused_, timeline_, timeshift_ns_);
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
  timeshift_ns_ = NsFromSeconds(calibration_.timeshift_cam_imu_s);
  // 1. Images inside the logs.
  StatusOr<std::vector<ImageStamp>> ordered = OrderImages(images);
  if (!ordered.ok()) return ordered.status();
  all_images_ = std::move(ordered).value();
  Status status = FindImagesInLogs();
  if (!status.ok()) return status;
  // 2. Vision against the gyroscope; it may move the time shift.
  std::map<image_t, timestamp_t> times_ns;
  for (const ImageStamp& image : all_images_) {
    times_ns[image.image_id] = image.timestamp_ns;
  }
  rotations_ = ComputeTimedRotations(rotations, times_ns);
  const timestamp_t calibrated_shift = timeshift_ns_;
  status = CheckVision();
  if (status.ok() && timeshift_ns_ != calibrated_shift) {
    status = FindImagesInLogs();
  }
  if (!status.ok()) return status;
  if (logs_.IsEmpty()) {
    estimate_.summary.num_images = static_cast<int>(all_images_.size());
    return std::move(estimate_);
  }
  // The other sensors against each other.
  CorrectWheelClock();
  status = CheckMotion();
  if (!status.ok()) return status;
  // 3. and 4. Preintegration and smoother.
  Fuse();
  // 5. Camera frames and figures.
  BuildPriors();
  FillSummary();
  status = CheckWheelScale();
  if (!status.ok()) return status;
  return std::move(estimate_);
}

}  // namespace

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
