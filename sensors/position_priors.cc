// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/position_priors.h"

#include <algorithm>
#include <set>
#include <sstream>

#include "core/option_checker.h"

namespace adasfm {
namespace {

// A fix between two images at most this far apart belongs to both, weighted by
// time. At 2 m/s^2 a straight line between them errs by 6 cm at most.
constexpr double kMaxImageGapS = 0.5;

// Both on the IMU's clock, in s from the first image: exact to nanoseconds and
// small enough for double.
struct Times {
  std::vector<double> images;
  std::vector<double> fixes;
};

Times BringTogether(const SensorCalibration& calibration,
                    const std::vector<ImageStamp>& images,
                    const std::vector<GnssFix>& fixes) {
  Times times;
  const timestamp_t start_ns = images.front().timestamp_ns;
  const timestamp_t shift_ns = NsFromSeconds(calibration.timeshift_gnss_imu_s -
                                             calibration.timeshift_cam_imu_s);
  for (const ImageStamp& image : images) {
    times.images.push_back(SecondsFromNs(image.timestamp_ns - start_ns));
  }
  for (const GnssFix& fix : fixes) {
    times.fixes.push_back(
        SecondsFromNs(fix.timestamp_ns - start_ns + shift_ns));
  }
  return times;
}

// Index of the last element at or before a time; -1 before the first.
int FindLastBefore(const std::vector<double>& times, double time) {
  return static_cast<int>(std::upper_bound(times.begin(), times.end(), time) -
                          times.begin()) -
         1;
}

// Factor on the variance of a fix, since its neighbours share its error: the
// number of fixes in the correlation time, on both sides.
double CorrelationFactor(double correlation_time_s,
                         const std::vector<double>& times, size_t index) {
  if (correlation_time_s <= 0.0 || times.size() < 2) return 1.0;
  const size_t before = index == 0 ? 0 : index - 1;
  const double period = times[before + 1] - times[before];
  return std::max(1.0, 2.0 * correlation_time_s / period);
}

class PriorBuilder {
 public:
  PriorBuilder(const PositionPriorOptions& options,
               const SensorCalibration& calibration,
               const std::vector<ImageStamp>& images,
               const std::vector<GnssFix>& fixes)
      : options_(options),
        images_(images),
        fixes_(fixes),
        times_(BringTogether(calibration, images, fixes)),
        antenna_in_cam_(calibration.has_gnss ? calibration.cam_from_imu *
                                                   calibration.antenna_in_imu
                                             : Eigen::Vector3d::Zero()) {}

  StatusOr<PositionPriors> Build() {
    result_.num_fixes = static_cast<int>(fixes_.size());
    result_.origin = fixes_.front().position;
    const EnuFrame frame(result_.origin);
    for (const GnssFix& fix : fixes_) {
      positions_.push_back(frame.EnuFromGeodetic(fix.position));
    }
    std::set<int> far_images;
    for (size_t k = 0; k < fixes_.size(); ++k) AddFix(k, &far_images);
    for (const int image : far_images) AddImage(image);
    if (result_.priors.empty()) return NoOverlap();
    return result_;
  }

 private:
  void AddFix(size_t k, std::set<int>* far_images) {
    const double time = times_.fixes[k];
    const int before = FindLastBefore(times_.images, time);
    const int last = static_cast<int>(images_.size()) - 1;
    if (before < 0 || (before == last && time > times_.images[last])) {
      ++result_.num_fixes_outside;
      return;
    }
    const int after = std::min(before + 1, last);
    const double gap = times_.images[after] - times_.images[before];
    if (gap > kMaxImageGapS) {
      far_images->insert(before);
      far_images->insert(after);
      return;
    }
    PositionPrior prior;
    prior.image_id1 = images_[before].image_id;
    prior.image_id2 = images_[after].image_id;
    if (gap > 0.0) prior.share = (time - times_.images[before]) / gap;
    prior.position = positions_[k];
    prior.covariance = Covariance(k);
    Add(prior);
  }

  // Adds the image's position between the fixes around it.
  void AddImage(int image) {
    const double time = times_.images[image];
    const int before = FindLastBefore(times_.fixes, time);
    const int last = static_cast<int>(fixes_.size()) - 1;
    if (before < 0 || (before == last && time > times_.fixes[last])) return;
    const int after = std::min(before + 1, last);
    const double gap = times_.fixes[after] - times_.fixes[before];
    if (gap > options_.max_fix_gap_s) return;
    const double share = gap > 0.0 ? (time - times_.fixes[before]) / gap : 0.0;
    PositionPrior prior;
    prior.image_id1 = prior.image_id2 = images_[image].image_id;
    prior.position =
        (1.0 - share) * positions_[before] + share * positions_[after];
    prior.covariance = (1.0 - share) * (1.0 - share) * Covariance(before) +
                       share * share * Covariance(after);
    Add(prior);
  }

  Eigen::Matrix3d Covariance(size_t k) const {
    return CorrelationFactor(options_.correlation_time_s, times_.fixes, k) *
           fixes_[k].covariance;
  }

  void Add(PositionPrior prior) {
    prior.antenna_in_cam = antenna_in_cam_;
    result_.priors.push_back(prior);
  }

  Status NoOverlap() const {
    std::ostringstream text;
    text.precision(12);
    text << "no position belongs to an image: the positions are from "
         << times_.fixes.front() << " to " << times_.fixes.back()
         << " s after the first image, the images from 0 to "
         << times_.images.back() << " s (" << images_.front().timestamp_ns
         << " to " << images_.back().timestamp_ns
         << " ns); is the log of another day, or in another unit or time zone?";
    return Status::Error(text.str());
  }

  const PositionPriorOptions& options_;
  const std::vector<ImageStamp>& images_;
  const std::vector<GnssFix>& fixes_;
  const Times times_;
  const Eigen::Vector3d antenna_in_cam_;
  std::vector<Eigen::Vector3d> positions_;
  PositionPriors result_;
};

}  // namespace

bool PositionPriorOptions::IsValid(std::string* error) const {
  return OptionChecker("AdaSfmGnss", error)
      .NotNegative({{"max_fix_gap_s", max_fix_gap_s},
                    {"correlation_time_s", correlation_time_s}})
      .AllHold();
}

StatusOr<PositionPriors> ComputePositionPriors(
    const PositionPriorOptions& options, const SensorCalibration& calibration,
    const std::vector<ImageStamp>& images, const std::vector<GnssFix>& fixes) {
  if (images.empty() || fixes.empty()) {
    return Status::Error("no images with a time, or no positions");
  }
  return PriorBuilder(options, calibration, images, fixes).Build();
}

}  // namespace adasfm
