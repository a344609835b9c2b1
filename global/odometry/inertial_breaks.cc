// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/inertial_breaks.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>

#include "core/median.h"
#include "global/odometry/inertial_scale.h"

namespace adasfm {
namespace {

// Smaller jumps are tears at weak places, which the mapper mends in part; a
// part that is removed is lost to the model.
constexpr double kMinJumpM = 2.0;
// Ratio to the median; in the final models of eleven drives 99 % are within 5.
constexpr double kMinRatio = 10.0;
// Largest difference of the jumps by both neighbours, as a share of the jump.
constexpr double kMaxDisagreement = 0.25;
constexpr size_t kMinNumImagesOfPart = 3;

// What the IMU integrated between two images in a row that have a pose, in the
// axes of the first camera.
struct Interval {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  double dt_s = 0.0;
  Eigen::Vector3d delta_velocity = Eigen::Vector3d::Zero();
  Eigen::Vector3d delta_position = Eigen::Vector3d::Zero();
  Eigen::Vector3d camera_from_imu_origin = Eigen::Vector3d::Zero();
};

std::vector<Interval> FindIntervals(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors,
    const std::map<image_t, Rigid3d>& cams_from_world) {
  std::map<std::pair<image_t, image_t>, Eigen::Quaterniond> rotations;
  for (const RelativePosePrior& prior : priors) {
    if (prior.HasRotation()) {
      rotations[{prior.image_id1, prior.image_id2}] =
          prior.cam2_from_cam1.rotation;
    }
  }
  std::vector<Interval> intervals;
  Interval open;
  Eigen::Quaterniond first_from_cam = Eigen::Quaterniond::Identity();
  for (const InertialMotion& motion : motions) {
    if (open.image_id2 != motion.image_id1) {
      open = Interval();
      if (cams_from_world.count(motion.image_id1) == 0) continue;
      open.image_id1 = motion.image_id1;
      open.camera_from_imu_origin = motion.camera_from_imu_origin;
      first_from_cam.setIdentity();
    }
    open.delta_position += open.delta_velocity * motion.dt_s +
                           first_from_cam * motion.delta_position;
    open.delta_velocity += first_from_cam * motion.delta_velocity;
    open.dt_s += motion.dt_s;
    open.image_id2 = motion.image_id2;
    const auto rotation = rotations.find({motion.image_id1, motion.image_id2});
    if (cams_from_world.count(motion.image_id2) > 0) {
      intervals.push_back(open);
      open = Interval();
    } else if (rotation == rotations.end()) {
      open = Interval();
    } else {
      first_from_cam = first_from_cam * rotation->second.conjugate();
    }
  }
  return intervals;
}

// The change from an interval to the next one, in metres and seconds.
struct Change {
  bool known = false;
  // Change of velocity minus what the IMU integrated: gravity and errors.
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  double dt_s = 0.0;
};

class Poses {
 public:
  Poses(const std::map<image_t, Rigid3d>& cams_from_world,
        double metres_per_unit)
      : cams_from_world_(cams_from_world), metres_per_unit_(metres_per_unit) {}

  Eigen::Quaterniond WorldFromCam(image_t image_id) const {
    return cams_from_world_.at(image_id).rotation.conjugate();
  }

  // Velocity at the start: the mean over the interval, corrected by the IMU.
  Eigen::Vector3d VelocityAtStart(const Interval& interval) const {
    const Eigen::Vector3d way = ImuPosition(interval.image_id2, interval) -
                                ImuPosition(interval.image_id1, interval);
    return (way - WorldFromCam(interval.image_id1) * interval.delta_position) /
           interval.dt_s;
  }

  Eigen::Vector3d VelocityAtEnd(const Interval& interval) const {
    return VelocityAtStart(interval) +
           WorldFromCam(interval.image_id1) * interval.delta_velocity;
  }

 private:
  Eigen::Vector3d ImuPosition(image_t image_id,
                              const Interval& interval) const {
    return metres_per_unit_ *
               cams_from_world_.at(image_id).TargetOriginInSource() -
           WorldFromCam(image_id) * interval.camera_from_imu_origin;
  }

  const std::map<image_t, Rigid3d>& cams_from_world_;
  const double metres_per_unit_;
};

std::vector<Change> FindChanges(const std::vector<Interval>& intervals,
                                const Poses& poses) {
  std::vector<Change> changes;
  for (size_t k = 0; k + 1 < intervals.size(); ++k) {
    Change change;
    if (intervals[k].image_id2 == intervals[k + 1].image_id1) {
      change.known = true;
      change.velocity = poses.VelocityAtStart(intervals[k + 1]) -
                        poses.VelocityAtEnd(intervals[k]);
      change.dt_s = 0.5 * (intervals[k].dt_s + intervals[k + 1].dt_s);
    }
    changes.push_back(change);
  }
  return changes;
}

// Takes gravity out; returns the median acceleration that is left, m/s^2.
double RemoveGravity(std::vector<Change>* changes) {
  Eigen::Vector3d gravity;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Change& change : *changes) {
      if (change.known) values.push_back(change.velocity[axis] / change.dt_s);
    }
    gravity[axis] = UpperMedian(&values);
  }
  std::vector<double> errors;
  for (Change& change : *changes) {
    if (!change.known) continue;
    change.velocity -= gravity * change.dt_s;
    errors.push_back(change.velocity.norm() / change.dt_s);
  }
  return UpperMedian(&errors);
}

// The jump across interval k, in metres, by which the model's motion exceeds
// the accelerometer's; none where the neighbours do not agree. The effect of
// the usual error (m/s^2) grows with the square of the time, as by a tilt.
std::optional<Eigen::Vector3d> FindJump(const std::vector<Interval>& intervals,
                                        const std::vector<Change>& changes,
                                        size_t k, double usual) {
  if (k == 0 || k >= changes.size() || !changes[k - 1].known ||
      !changes[k].known) {
    return std::nullopt;
  }
  const double dt_s = intervals[k].dt_s;
  const Eigen::Vector3d before = changes[k - 1].velocity * dt_s;
  const Eigen::Vector3d after = -changes[k].velocity * dt_s;
  const double least = std::min(before.norm(), after.norm());
  if (least < kMinJumpM || least < kMinRatio * usual * dt_s * dt_s ||
      (before - after).norm() > kMaxDisagreement * least) {
    return std::nullopt;
  }
  return 0.5 * (before + after);
}

// Images whose relative positions are right, and the offset of all of them.
struct Place {
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();
  std::set<image_t> images;
};

void AddToPlace(const Eigen::Vector3d& offset_m, std::set<image_t> images,
                std::vector<Place>* places) {
  for (Place& place : *places) {
    if ((place.offset_m - offset_m).norm() < kMinJumpM) {
      place.images.merge(images);
      return;
    }
  }
  places->push_back({offset_m, std::move(images)});
}

}  // namespace

std::vector<std::set<image_t>> FindPartsByInertia(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors,
    const std::map<image_t, Rigid3d>& cams_from_world) {
  const std::optional<InertialScale> scale =
      EstimateInertialScale(motions, cams_from_world);
  if (!scale) return {};
  const std::vector<Interval> intervals =
      FindIntervals(motions, priors, cams_from_world);
  std::vector<Change> changes =
      FindChanges(intervals, Poses(cams_from_world, scale->metres_per_unit));
  const double usual = RemoveGravity(&changes);

  std::vector<Place> places;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  std::set<image_t> run;
  for (size_t k = 0; k < intervals.size(); ++k) {
    run.insert(intervals[k].image_id1);
    if (const auto jump = FindJump(intervals, changes, k, usual)) {
      AddToPlace(offset, std::move(run), &places);
      run = {};
      offset += *jump;
    }
    run.insert(intervals[k].image_id2);
  }
  AddToPlace(offset, std::move(run), &places);

  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
    return a.images.size() > b.images.size();
  });
  std::vector<std::set<image_t>> parts;
  for (size_t k = 1; k < places.size(); ++k) {
    if (places[k].images.size() >= kMinNumImagesOfPart) {
      parts.push_back(std::move(places[k].images));
    }
  }
  return parts;
}

}  // namespace adasfm
