// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <iostream>
#include <string>

#include "colmap_ext/commands/log_options.h"
#include "colmap_ext/commands/progress_display.h"
#include "colmap_ext/commands/registry.h"
#include "colmap_ext/workspace/automatic_reconstruction.h"
#include "core/check_options.h"

namespace adasfm {
namespace {

void AddBagOptions(BagExtractionOptions* bag,
                   AutomaticReconstructionPaths* paths,
                   CommandOptions* command) {
  command->AddDefault(
      "bag_path", &paths->bag_path,
      "in place of --image_path: a ROS 2 bag (.mcap, .db3 or bag folder) or a "
      "ROS 1 bag with photos, logs and calibration");
  AddBagTopicOptions(&bag->topics, command);
  command->AddDefault(
      "image_topic", &bag->topics.image,
      "image topic of the bag; when empty, the only image topic");
  command->AddDefault("image_step", &bag->photos.image_step,
                      "n: use every n-th photo of the bag; of a video, the "
                      "sharpest frame in the first half of every n frames");
  command->AddDefault(
      "image_distance_m", &bag->photos.image_distance_m,
      "smallest distance between used photos of the bag or video by the wheel "
      "log, unless they turn by 10 deg [m]; 0: all");
}

void AddPaths(AutomaticReconstructionOptions* options,
              AutomaticReconstructionPaths* paths, CommandOptions* command) {
  command->AddDefault("image_path", &paths->image_path,
                      "folder of the photos or, with --data_format, root "
                      "folder of the recording");
  AddBagOptions(&options->bag, paths, command);
  command->AddDefault("video_path", &paths->video_path,
                      "in place of --image_path: a video, read by ffmpeg; "
                      "frame times are those of the file");
  command->AddDefault("video_start_ns", &options->video_start_ns,
                      "start time of the video on the clock of the logs [ns]");
  command->AddRequired(
      "workspace_path", &paths->workspace_path,
      "folder for all results; the same command continues an earlier run");
  command->AddDefault("data_format", &paths->data_format,
                      "layout of the recording, which provides logs, times and "
                      "camera: euroc, 4seasons, kitti or tum; none when empty");
  AddLogOptions(paths, command);
  command->AddDefault("sensors_path", &paths->sensors_path,
                      "YAML file with the calibration of the sensors");
  command->AddDefault("ground_truth_path", &paths->ground_truth_path,
                      "true poses, for the report: a COLMAP model, a TUM "
                      "trajectory, or lines `name qw qx qy qz tx ty tz`; none "
                      "when empty");
}

void AddFeatureOptions(FeatureOptions* features, CommandOptions* command) {
  command->AddDefault("camera_model", &features->camera_model,
                      "COLMAP's camera model, such as PINHOLE or OPENCV");
  command->AddDefault(
      "camera_params", &features->camera_params,
      "parameters of the camera model, comma-separated [px]; when empty, the "
      "focal length from EXIF, else 1.2 times the longer side");
  command->AddDefault(
      "single_camera", &features->single_camera,
      "1: one camera for all photos, 0: one per photo, 2: one per folder, -1: "
      "one for all photos of equal size and focal length");
  command->AddDefault(
      "max_image_size", &features->max_image_size,
      "photos with a longer side are scaled down for SIFT [px]");
  command->AddDefault("max_num_features", &features->max_num_features,
                      "largest number of features per photo");
  command->AddDefault("extractor", &features->extractor,
                      "SIFT implementation: colmap, or opencv (CPU only, takes "
                      "less than half of the time)");
  command->AddDefault("first_octave", &features->first_octave,
                      "SIFT on the photo at twice its size (-1), or at its own "
                      "size (0): four times as fast, with fewer features");
  command->AddDefault("use_gpu", &features->use_gpu,
                      "SIFT on the GPU: 0, 1, or -1: if COLMAP was built with "
                      "CUDA and a device is present");
  command->AddDefault(
      "matcher", &features->matcher,
      "adasfm: compares all descriptors; host: COLMAP's matcher, always used "
      "on the GPU and with ADASFM_HOST_COLMAP");
}

void PrintResult(const AutomaticReconstructionResult& result) {
  std::cout << "\nTime [s]:";
  for (const AutomaticReconstructionResult::Step& step : result.steps) {
    char seconds[32];
    std::snprintf(seconds, sizeof(seconds), "%.1f", step.seconds);
    std::cout << "  " << step.name << " " << seconds;
  }
  std::cout << "\nModel:  " << result.model_path
            << "\nReport: " << result.report_path << std::endl;
}

}  // namespace

Status RunAdasfmAutomaticReconstructor(int argc, char** argv) {
  AutomaticReconstructionPaths paths;
  AutomaticReconstructionOptions options;
  CommandOptions command(
      "adasfm_automatic_reconstructor",
      "Reconstructs a model, with a report, from a folder of photos with "
      "optional logs of IMU, wheels and GNSS, from a video or from a ROS bag.");
  AddPaths(&options, &paths, &command);
  AddFeatureOptions(&options.features, &command);
  command.AddDefault("refine_intrinsics", &options.refine_intrinsics,
                     "adjust focal length and distortion: 0, 1, or -1: when "
                     "camera_params is empty");
  command.AddDefault("num_temporal_neighbors",
                     &options.pairs.num_temporal_neighbors,
                     "number of following images to match each image with");
  command.AddDefault(
      "num_similar_images", &options.pairs.num_similar_images,
      "number of further, similar images to match each image with");
  command.AddDefault(
      "guided_matching", &options.guided_matching,
      "1: where sensor logs predict the motion between two photos, compare "
      "only features near the epipolar lines; 0: compare all");
  command.AddDefault("restart", &options.restart,
                     "1: remove the results of earlier runs in the workspace "
                     "and start again; 0: continue");
  command.AddDefault(
      "max_memory_gb", &options.max_memory_gb,
      "memory limit of prior import, coarse model and mapper each; a stage "
      "that may need more does not start [GB]; -1: no limit");
  command.AddDefault("num_threads", &options.num_threads,
                     "number of threads; -1: all of the machine, and pairs are "
                     "matched while features are extracted");
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;
  const Status valid =
      command.Check([&options] { return CheckOptions(options); });
  if (!valid.ok()) return valid;

  ProgressDisplay display;
  const StatusOr<AutomaticReconstructionResult> result =
      ReconstructAutomatically(
          options, paths, display.Callback(),
          [&display](const std::string& text) { display.Print(text); });
  display.Finish();
  if (!result.ok()) return result.status();
  PrintResult(*result);
  if (result->has_failed) return Status::Error(result->verdict);
  std::cout << result->verdict << std::endl;
  return Status::Ok();
}

}  // namespace adasfm
