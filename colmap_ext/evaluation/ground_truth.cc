// SPDX-License-Identifier: BSD-3-Clause
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>

#include "colmap_ext/evaluation/evaluation.h"
#include "colmap_ext/host/model.h"
#include "core/interpolate_pose.h"
#include "core/option_checker.h"
#include "core/sensor_log.h"
#include "core/strict_stream.h"
#include "sensors/io/log_file.h"
#include "sensors/io/read_image_times.h"
#include "sensors/io/read_wheel.h"

namespace adasfm {
namespace {

bool IsNumber(const std::string& word) {
  char* end = nullptr;
  std::strtod(word.c_str(), &end);
  return !word.empty() && *end == '\0';
}

// Whether the first line that is not a comment begins with a number, which is a
// time and not an image name.
bool IsTrajectory(const std::string& path) {
  std::ifstream file(path);
  ThrowOnFailure(&file);
  SkipByteOrderMark(&file);
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    ThrowOnFailure(&words);
    std::string first;
    if (!(words >> first) || first[0] == '#') continue;
    return IsNumber(first);
  }
  return false;
}

StatusOr<NamedPoses> ReadPoseLines(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    return Status::Error("cannot read the ground truth " + path +
                         "; check --ground_truth_path");
  }
  ThrowOnFailure(&file);
  SkipByteOrderMark(&file);
  NamedPoses poses;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    std::istringstream words(line);
    ThrowOnFailure(&words);
    std::string name;
    if (!(words >> name) || name[0] == '#') continue;
    Eigen::Quaterniond rotation;
    Eigen::Vector3d translation;
    std::string rest;
    if (!(words >> rotation.w() >> rotation.x() >> rotation.y() >>
          rotation.z() >> translation.x() >> translation.y() >>
          translation.z()) ||
        words >> rest || !(std::abs(rotation.norm() - 1.0) < 1e-2) ||
        !translation.allFinite()) {
      return Status::Error(path + ", line " + std::to_string(number) +
                           ": expected `name qw qx qy qz tx ty tz` with a "
                           "unit quaternion");
    }
    if (!poses.emplace(name, Rigid3d(rotation, translation)).second) {
      return Status::Error(path + ", line " + std::to_string(number) +
                           ": image " + name + " appears twice");
    }
  }
  if (poses.empty()) {
    return Status::Error("the ground truth " + path +
                         " has no poses; check --ground_truth_path");
  }
  return poses;
}

StatusOr<std::vector<ImageTime>> TimesOfImages(
    const std::string& trajectory_path,
    const std::vector<std::string>& image_names,
    const GroundTruthOptions& options) {
  if (!options.image_times_path.empty()) {
    return ReadImageTimes(options.image_times_path);
  }
  std::vector<ImageTime> times;
  for (const std::string& name : image_names) {
    ImageTime time;
    time.name = name;
    if (ParseImageNameTime(name, &time.timestamp_ns)) times.push_back(time);
  }
  if (times.empty()) {
    return Status::Error("the ground truth " + trajectory_path +
                         " is a trajectory, but the image names hold no "
                         "times; give --image_times_path");
  }
  return times;
}

NamedPoses InterpolatePoses(const std::vector<OdometryPose>& trajectory,
                            const std::vector<ImageTime>& times,
                            double max_time_gap_s) {
  NamedPoses poses;
  for (const ImageTime& time : times) {
    const std::optional<Rigid3d> world_from_body =
        InterpolatePose(trajectory, time.timestamp_ns, max_time_gap_s);
    if (world_from_body) poses[time.name] = world_from_body->Inverse();
  }
  return poses;
}

StatusOr<NamedPoses> ReadTrajectory(const std::string& path,
                                    const std::vector<std::string>& image_names,
                                    const GroundTruthOptions& options) {
  const StatusOr<std::vector<OdometryPose>> trajectory = ReadOdometry(path);
  if (!trajectory.ok()) return trajectory.status();
  const StatusOr<std::vector<ImageTime>> times =
      TimesOfImages(path, image_names, options);
  if (!times.ok()) return times.status();
  NamedPoses poses =
      InterpolatePoses(*trajectory, *times, options.max_time_gap_s);
  if (poses.empty()) {
    return Status::Error("the ground truth " + path +
                         " has no pose at the time of any image; compare the "
                         "clocks");
  }
  return poses;
}

}  // namespace

bool GroundTruthOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
      .Positive({{"max_time_gap_s", max_time_gap_s}})
      .AllHold();
}

StatusOr<NamedPoses> ReadGroundTruth(
    const std::string& path, const std::vector<std::string>& image_names,
    const GroundTruthOptions& options) {
  if (std::filesystem::is_directory(path)) {
    const StatusOr<colmap::Reconstruction> model = ReadModel(path);
    if (!model.ok()) return model.status();
    return PosesOfModel(*model);
  }
  if (IsTrajectory(path)) return ReadTrajectory(path, image_names, options);
  return ReadPoseLines(path);
}

}  // namespace adasfm
