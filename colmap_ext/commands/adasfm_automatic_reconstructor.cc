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
  command->AddDefault("bag_path", &paths->bag_path,
                      "in place of --image_path: a ROS 2 bag (.mcap, .db3 or "
                      "its folder) or a ROS 1 bag with photos, logs and "
                      "calibration");
  AddBagTopicOptions(&bag->topics, command);
  command->AddDefault("image_topic", &bag->topics.image,
                      "topic of the photos in the bag; when empty, the only "
                      "one");
  command->AddDefault("image_step", &bag->photos.image_step,
                      "every so many photos of the bag are used; of a video, "
                      "the sharpest of every so many frames or half of them");
  command->AddDefault("image_distance_m", &bag->photos.image_distance_m,
                      "photos of the bag or video are this far apart by the "
                      "wheels, or 10 degrees of turn [m]; 0: all");
}

void AddPaths(AutomaticReconstructionOptions* options,
              AutomaticReconstructionPaths* paths, CommandOptions* command) {
  command->AddDefault("image_path", &paths->image_path,
                      "folder of the photos or, with --data_format, root "
                      "folder of the recording");
  AddBagOptions(&options->bag, paths, command);
  command->AddDefault("video_path", &paths->video_path,
                      "in place of --image_path: a film, read by ffmpeg; times "
                      "are the container's");
  command->AddDefault("video_start_ns", &options->video_start_ns,
                      "time of the video's beginning on the clock of the logs "
                      "[ns]");
  command->AddRequired("workspace_path", &paths->workspace_path,
                       "folder for all results; the same command on it again "
                       "continues");
  command->AddDefault("data_format", &paths->data_format,
                      "euroc, 4seasons, kitti or tum: logs, times and camera "
                      "are found in the recording; none when empty");
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
  command->AddDefault("camera_params", &features->camera_params,
                      "parameters of the model, comma-separated [px]; when "
                      "empty, the focal length is EXIF's or 1.2 times the "
                      "longer side");
  command->AddDefault("single_camera", &features->single_camera,
                      "1: one camera took all photos, 0: each its own, 2: one "
                      "a folder, -1: photos of equal size and focal length "
                      "share one");
  command->AddDefault("max_image_size", &features->max_image_size,
                      "larger photos are scaled down for the detector [px]");
  command->AddDefault("max_num_features", &features->max_num_features,
                      "features of a photo at most");
  command->AddDefault("extractor", &features->extractor,
                      "SIFT by colmap, or by opencv: on the CPU in less than "
                      "half of the time, not for the GPU");
  command->AddDefault("first_octave", &features->first_octave,
                      "SIFT begins with the photo at twice its size (-1), or "
                      "as it is (0): four times as fast, with fewer features");
  command->AddDefault("use_gpu", &features->use_gpu,
                      "SIFT on the GPU: 0, 1, or -1: when COLMAP was built "
                      "with CUDA and finds a device");
  command->AddDefault("matcher", &features->matcher,
                      "adasfm: compares all descriptors; host: COLMAP's "
                      "matcher, as always on the GPU and with "
                      "ADASFM_HOST_COLMAP");
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
      "From a folder of photos, and the logs of an IMU and wheels where there "
      "are any, from a film or from a ROS bag, to a model and a report about "
      "it.");
  AddPaths(&options, &paths, &command);
  AddFeatureOptions(&options.features, &command);
  command.AddDefault("refine_intrinsics", &options.refine_intrinsics,
                     "adjust focal length and distortion: 0, 1, or -1: when "
                     "camera_params is empty");
  command.AddDefault("num_temporal_neighbors",
                     &options.pairs.num_temporal_neighbors,
                     "every image is matched with so many of the next ones");
  command.AddDefault("num_similar_images", &options.pairs.num_similar_images,
                     "and with so many of the most similar ones beyond them");
  command.AddDefault("guided_matching", &options.guided_matching,
                     "1: where sensor logs predict the motion between two "
                     "photos, compare only features near their epipolar "
                     "lines; 0: compare all");
  command.AddDefault("restart", &options.restart,
                     "1: remove what earlier runs left in the workspace, and "
                     "do it all anew; 0: continue");
  command.AddDefault("max_memory_gb", &options.max_memory_gb,
                     "for each of the stages from priors to the model, which "
                     "do not begin when they may take more [GB]; -1: no bound");
  command.AddDefault(
      "num_threads", &options.num_threads,
      "-1: all of the machine's, and pairs are matched while features "
      "are extracted");
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
