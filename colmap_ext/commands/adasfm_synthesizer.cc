// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <opencv2/core.hpp>
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
#include "colmap_ext/io/image_codecs.h"
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
  add("num_images", &world->num_images, "number of images of each camera");
  add("stereo_baseline", &world->stereo_baseline_m,
      "baseline length to a second, synchronous camera on the right [m]; 0: "
      "one camera");
  add("seed", &world->seed, "equal seeds give equal worlds");
  add("spacing", &world->spacing_m, "mean distance between images [m]");
  add("image_interval", &world->image_interval_s,
      "mean time between images while driving [s]; 0: that of 8 m/s (lanes: 1 "
      "m/s), within 0.05 to 0.4 s");
  add("trajectory", &options->trajectory,
      "town (bends and revisits), straight, parallel (similar streets in "
      "alternating directions), floors (similar floors of a car park) or lanes "
      "(of a mower)");
  add("street_blocks", &world->street_num_blocks,
      "trajectory parallel: length of a street [60 m]");
  add("floor_height", &world->floor_height_m,
      "trajectory floors: height from floor to floor [m]");
  add("lane_spacing", &world->lane_spacing_m,
      "trajectory lanes: distance between neighbouring lanes [m]");
  add("lane_length", &world->lane_length_m,
      "trajectory lanes: length of a lane [m]");
  add("stops", &world->num_stops, "number of stops, with images at rest");
  add("stop_duration", &world->stop_duration_s, "duration of a stop [s]");
  add("stop_image_interval", &world->stop_image_interval_s,
      "time between images at rest, for stops of hours [s]; 0: as under way, "
      "and at most half of the time at rest");
  add("spins", &world->num_spins,
      "number of turns by 360 deg on the spot, with images");
  add("spin_duration", &world->spin_duration_s,
      "duration of a turn on the spot [s]");
}

void AddImageOptions(SynthesizerOptions* options, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  SyntheticWorldOptions* world = &options->world;
  add("camera_model", &options->camera_model,
      "camera model: PINHOLE or OPENCV_FISHEYE");
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
      "autofocus: largest relative deviation of an image's focal length from "
      "the calibrated one");
  add("focal_steps", &world->num_focal_steps,
      "number of steps of the focal_breathing deviation, constant in between; "
      "0: a slow wave");
  add("moving_ratio", &world->moving_keypoint_ratio,
      "share of keypoints on cars that drive ahead");
  add("outlier_ratio", &world->outlier_match_ratio,
      "share of raw matches that are wrong");
  add("num_blackouts", &world->num_blackouts,
      "number of blackouts (intervals without texture)");
  add("blackout_images", &world->blackout_num_images,
      "number of images of each blackout");
  add("blackout_keypoints", &world->blackout_num_keypoints,
      "largest number of keypoints of an image in a blackout");
}

void AddPhotoOptions(SynthesizerOptions* options, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  SyntheticWorldOptions* world = &options->world;
  add("exposure_jumps", &world->exposure_jump_ratio,
      "render: share of photos that are darker or brighter than the previous "
      "photo");
  add("exposure_factor", &world->exposure_jump_factor,
      "render: brightness factor of exposure jumps, saturating at white");
  add("exposure_time", &world->exposure_time_s,
      "render: exposure time, which causes motion blur [s]; 0: no blur");
  add("render", &options->render, "1: photos in images/ instead of a database");
}

void AddPairOptions(SyntheticWorldOptions* world, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  add("num_neighbors", &world->num_sequential_neighbors,
      "number of following images to match each image with");
  add("alias_ratio", &world->alias_pair_ratio,
      "share of pairs that are false by perceptual aliasing");
  add("spurious_ratio", &world->spurious_pair_ratio,
      "share of pairs that are false, between images without overlap, with 15 "
      "to 25 matches");
  add("rotation_outliers", &world->rotation_outlier_ratio,
      "share of true pairs whose rotation is wrong");
}

void AddSensorOptions(SyntheticWorldOptions* world, CommandOptions* command) {
  const auto add = [command](const char* name, auto* value, const char* help) {
    command->AddDefault(name, value, help);
  };
  add("wheel_slips", &world->num_wheel_slips,
      "number of intervals in which the wheels slip");
  add("wheel_slip_noise", &world->wheel_slip_sigma,
      "gravel: random slip of each wheel, correlated over 1 s, 1 sigma as a "
      "share of its speed; not in sensors.yaml");
  add("gyro_drift", &world->gyro_drift,
      "drift of the gyroscope bias about the vertical, not in sensors.yaml "
      "[rad/s^2]");
  add("gyro_scale", &world->gyro_scale,
      "share by which the gyroscope's rates are too large, not in "
      "sensors.yaml");
  add("gnss_rate", &world->gnss_rate_hz,
      "rate of the GNSS positions in gnss.csv [Hz]; 0: no positions");
  add("gnss_noise", &world->gnss_noise_m,
      "noise of the GNSS positions per axis, 1 sigma [m]");
  add("gnss_jumps", &world->num_gnss_jumps,
      "number of intervals of 5 s with GNSS positions 15 m off");
  add("wheel_scale", &world->wheel_scale,
      "true speed divided by the logged wheel speed");
  add("wheel_noise", &world->wheel_speed_noise,
      "noise of the wheel speeds, 1 sigma [m/s]");
  add("standstill", &world->standstill_s, "time at rest at the start [s]");
  add("timeshift_cam_imu", &world->timeshift_cam_imu_s,
      "IMU time minus camera time [s]");
}

void AddOptions(SynthesizerOptions* options, CommandOptions* command) {
  command->AddRequired("output_path", &options->output_path,
                       "folder for the simulated data");
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
    const std::vector<unsigned char> bytes =
        EncodeImage(path.extension().string(), renderer.Render(i));
    std::ofstream file(path, std::ios::binary);
    file.write(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (!file.flush()) {
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
      "Simulates a drive with ground truth: IMU and wheel logs, and either a "
      "database with verified matches or photos.");
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
