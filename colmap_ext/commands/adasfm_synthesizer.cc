// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <iostream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include "colmap_ext/commands/command.h"
#include "colmap_ext/commands/progress_display.h"
#include "colmap_ext/commands/registry.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/output_files.h"
#include "core/check_options.h"
#include "synthetic/render_world.h"
#include "synthetic/world_summary.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

struct SynthesizerOptions {
  std::string output_path;
  std::string camera_model = "PINHOLE";
  std::string trajectory = "town";
  bool render = false;
  SyntheticWorldOptions world;
};

void AddDriveOptions(SynthesizerOptions* options, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  SyntheticWorldOptions* world = &options->world;
  add("num_images", &world->num_images, "images of the drive, of each camera");
  add("stereo_baseline", &world->stereo_baseline_m,
      "above 0: a second camera so far to the right of the "
      "first, with images at the same times [m]");
  add("seed", &world->seed, "equal seeds give equal worlds");
  add("spacing", &world->spacing_m, "mean distance between images [m]");
  add("image_interval", &world->image_interval_s,
      "mean time between images under way; 0: that of 8 m/s, "
      "within 0.05 to 0.4 s [s]");
  add("trajectory", &options->trajectory,
      "town (bends and revisits), straight, parallel (streets "
      "that look alike, up and down), floors (of a car park, "
      "which look alike) or lanes (of a mower)");
  add("street_blocks", &world->street_num_blocks,
      "parallel: length of a street [60 m]");
  add("floor_height", &world->floor_height_m,
      "floors: height from one to the next [m]");
  add("lane_spacing", &world->lane_spacing_m,
      "lanes: distance between neighbouring ones [m]");
  add("lane_length", &world->lane_length_m, "lanes: length of each [m]");
  add("stops", &world->num_stops, "stops under way; images go on");
  add("stop_duration", &world->stop_duration_s, "duration of a stop [s]");
  add("spins", &world->num_spins, "turns by 360 deg on the spot; images go on");
  add("spin_duration", &world->spin_duration_s, "duration of such a turn [s]");
}

void AddImageOptions(SynthesizerOptions* options, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  SyntheticWorldOptions* world = &options->world;
  add("camera_model", &options->camera_model,
      "camera of the drive: PINHOLE or OPENCV_FISHEYE");
  add("image_width", &world->image_width, "width of an image [px]");
  add("image_height", &world->image_height, "height of an image [px]");
  add("num_keypoints", &world->num_keypoints_per_image,
      "keypoints per image of the database");
  add("pixel_noise", &world->pixel_noise_px,
      "noise of keypoints, 1 sigma [px]");
  add("rolling_shutter", &world->rolling_shutter_s,
      "time from the first to the last row of an image; 0: "
      "global shutter [s]");
  add("focal_breathing", &world->focal_breathing_ratio,
      "autofocus: largest error of an image's focal length, as a share of the "
      "camera's, which stays stated");
  add("focal_steps", &world->num_focal_steps,
      "changes of that error under way, constant in between; 0: a slow wave");
  add("moving_ratio", &world->moving_keypoint_ratio,
      "share of keypoints on cars that drive ahead");
  add("outlier_ratio", &world->outlier_match_ratio,
      "share of raw matches that are wrong");
  add("num_blackouts", &world->num_blackouts, "intervals without texture");
  add("blackout_images", &world->blackout_num_images,
      "images of each such interval");
  add("blackout_keypoints", &world->blackout_num_keypoints,
      "keypoints at most of such an image");
}

void AddPhotoOptions(SynthesizerOptions* options, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  SyntheticWorldOptions* world = &options->world;
  add("exposure_jumps", &world->exposure_jump_ratio,
      "render: share of photos with more or less light than the one before");
  add("exposure_factor", &world->exposure_jump_factor,
      "render: by which factor; grey levels end at white");
  add("exposure_time", &world->exposure_time_s,
      "render: time for which the shutter is open, so that motion blurs; 0: "
      "none [s]");
  add("render", &options->render, "1: photos in images/ instead of a database");
}

void AddPairOptions(SyntheticWorldOptions* world, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  add("num_neighbors", &world->num_sequential_neighbors,
      "images matched with so many of the next ones");
  add("alias_ratio", &world->alias_pair_ratio,
      "share of pairs that join look-alike places");
  add("spurious_ratio", &world->spurious_pair_ratio,
      "share of pairs that join images with nothing in common "
      "by 15 to 25 matches");
  add("rotation_outliers", &world->rotation_outlier_ratio,
      "share of true pairs whose rotation is wrong");
}

void AddSensorOptions(SyntheticWorldOptions* world, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  add("wheel_slips", &world->num_wheel_slips,
      "intervals in which the wheels slip");
  add("wheel_slip_noise", &world->wheel_slip_sigma,
      "gravel: random slip of each wheel over a second, 1 "
      "sigma, as a share of its speed; not declared");
  add("gyro_drift", &world->gyro_drift,
      "growth of the gyroscope's bias about the vertical, not "
      "declared [rad/s^2]");
  add("gnss_rate", &world->gnss_rate_hz,
      "positions of a receiver, in gnss.csv; 0: none [Hz]");
  add("gnss_noise", &world->gnss_noise_m, "their noise per axis, 1 sigma [m]");
  add("gnss_jumps", &world->num_gnss_jumps,
      "intervals of 5 s in which they are 15 m off");
  add("wheel_scale", &world->wheel_scale, "true speed per logged speed");
  add("wheel_noise", &world->wheel_speed_noise,
      "noise of the wheel speeds, 1 sigma [m/s]");
  add("standstill", &world->standstill_s, "time at rest at the start [s]");
  add("timeshift_cam_imu", &world->timeshift_cam_imu_s,
      "IMU time minus camera time [s]");
}

void AddOptions(SynthesizerOptions* options, CommandOptions* command) {
  command->AddRequired("output_path", &options->output_path,
                       "folder for the world");
  AddDriveOptions(options, command);
  AddImageOptions(options, command);
  AddPairOptions(&options->world, command);
  AddSensorOptions(&options->world, command);
  AddPhotoOptions(options, command);
}

Status Translate(SynthesizerOptions* options) {
  const std::map<std::string, SyntheticTrajectory> trajectories = {
      {"town", SyntheticTrajectory::kTown},
      {"straight", SyntheticTrajectory::kStraight},
      {"parallel", SyntheticTrajectory::kParallel},
      {"floors", SyntheticTrajectory::kFloors},
      {"lanes", SyntheticTrajectory::kLanes}};
  const auto trajectory = trajectories.find(options->trajectory);
  if (trajectory == trajectories.end()) {
    return Status::Error("trajectory = " + options->trajectory +
                         ", but it must be town, straight, parallel, floors or "
                         "lanes");
  }
  options->world.trajectory = trajectory->second;
  if (options->camera_model == "OPENCV_FISHEYE") {
    options->world.camera_model = SyntheticCameraModel::kFisheye;
  } else if (options->camera_model != "PINHOLE") {
    return Status::Error("camera_model = " + options->camera_model +
                         ", but it must be PINHOLE or OPENCV_FISHEYE");
  }
  const SyntheticWorldOptions& world = options->world;
  if (options->render &&
      (options->trajectory == "floors" || options->trajectory == "lanes" ||
       world.moving_keypoint_ratio > 0.0 || world.rolling_shutter_s > 0.0)) {
    return Status::Error(
        "render = 1, but photos show streets of one level only, without cars "
        "or rolling shutter");
  }
  for (const auto& [name, value] :
       {std::pair("exposure_jumps", world.exposure_jump_ratio),
        std::pair("exposure_time", world.exposure_time_s)}) {
    if (options->render || value == 0.0) continue;
    std::ostringstream text;
    text << name << " = " << value << " needs render = 1: only photos show it";
    return Status::Error(text.str());
  }
  return CheckOptions(world);
}

// Allows replacing a world of ours, but not files of the user.
Status CheckWorldFolder(const std::string& path) {
  std::error_code none;
  if (fs::exists(path + "/landmarks.txt", none)) return Status::Ok();
  for (const char* name :
       {"database.db", "imu.csv", "wheel.csv", "times.csv", "sensors.yaml",
        "gt.txt", "gnss.csv", "world.json"}) {
    if (!fs::exists(path + "/" + name, none)) continue;
    return Status::Error(path + "/" + name +
                         " was not made by this command and is not replaced; "
                         "choose an empty output folder");
  }
  return Status::Ok();
}

// Photos of another world in the folder would become part of the user's model.
Status CheckPhotoFolder(const SyntheticWorld& world, const fs::path& folder) {
  std::set<std::string> names;
  for (const SyntheticImage& image : world.images) names.insert(image.name);
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (names.count(entry.path().filename().string()) == 0) {
      return Status::Error(
          "the folder " + folder.string() + " holds other files, as " +
          entry.path().filename().string() + "; choose an empty output folder");
    }
  }
  return Status::Ok();
}

Status WritePhotos(const SyntheticWorld& world, const fs::path& folder) {
  Status status = PrepareOutputFolder(folder.string());
  if (status.ok()) status = CheckPhotoFolder(world, folder);
  if (!status.ok()) return status;
  ProgressDisplay display;
  WorldRenderer renderer(world);
  for (size_t i = 0; i < world.images.size(); ++i) {
    const fs::path path = folder / world.images[i].name;
    fs::create_directories(path.parent_path());
    bool written = false;
    try {
      written = cv::imwrite(path.string(), renderer.Render(i));
    } catch (const cv::Exception&) {
      // OpenCV reports a full disk by an exception or by its result.
    }
    if (!written) {
      return Status::Error("cannot write " + path.string() +
                           "; check the free space");
    }
    display.Update("rendered " + std::to_string(i + 1) + " of " +
                       std::to_string(world.images.size()) + " photos",
                   (i + 1.0) / world.images.size());
  }
  return Status::Ok();
}

}  // namespace

Status RunAdasfmSynthesizer(int argc, char** argv) {
  SynthesizerOptions options;
  CommandOptions command(
      "adasfm_synthesizer",
      "Makes a drive through a town with ground truth: IMU and wheel logs, and "
      "a database with verified matches or photos.");
  AddOptions(&options, &command);
  Status status = command.Parse(argc, argv);
  if (!status.ok() || command.HelpShown()) return status;
  status = command.Check([&options] { return Translate(&options); });
  if (status.ok()) status = PrepareOutputFolder(options.output_path);
  if (!status.ok()) return status;
  const auto lock =
      FolderLock::Acquire(options.output_path, FolderLock::Mode::kExclusive);
  if (!lock.ok()) return lock.status();
  status = CheckWorldFolder(options.output_path);
  if (!status.ok()) return status;

  SyntheticWorld world;
  try {
    world = BuildSyntheticWorld(options.world);
  } catch (const std::invalid_argument& error) {
    return Status::Error(error.what());
  }
  status = WriteSyntheticLogs(world, options.output_path);
  if (!status.ok()) return status;
  const fs::path folder(options.output_path);
  status = options.render ? WritePhotos(world, folder / "images")
                          : WriteSyntheticDatabase(
                                world, (folder / "database.db").string());
  if (!status.ok()) return status;
  std::cout << "Wrote " << world.images.size() << " images, "
            << world.pairs.size() << " matched pairs and "
            << world.imu_samples.size() << " IMU samples to "
            << options.output_path << "; what the world has (world.json):\n";
  for (const auto& [name, value] : ListFigures(SummarizeWorld(world))) {
    std::cout << "  " << name << ": " << value << "\n";
  }
  return Status::Ok();
}

}  // namespace adasfm
