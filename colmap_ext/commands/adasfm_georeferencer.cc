// SPDX-License-Identifier: BSD-3-Clause
#include <filesystem>
#include <iostream>
#include <string>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/host/frame_files.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/georeference_file.h"
#include "colmap_ext/io/output_files.h"
#include "colmap_ext/scene/align_to_gravity.h"
#include "colmap_ext/scene/georeferenced_model.h"

namespace adasfm {
namespace {

struct GeoreferencerOptions {
  std::string input_path;
  std::string output_path;
  std::string frame = "ecef";
  GeodeticPosition enu_origin;
  std::string georeference_path;
};

Status WriteInFrame(const GeoreferencerOptions& options) {
  const StatusOr<GeodeticPosition> origin =
      ReadGeoreference(options.georeference_path);
  if (!origin.ok()) return origin.status();
  const StatusOr<TargetFrame> target =
      FindTargetFrame(options.frame, *origin, options.enu_origin);
  if (!target.ok()) return target.status();
  StatusOr<colmap::Reconstruction> model = ReadModel(options.input_path);
  if (!model.ok()) return model.status();
  StatusOr<ModelFrames> frames = ReadFrameFiles(options.input_path);
  if (!frames.ok()) return frames.status();
  TransformReconstruction(target->target_from_enu, &*model);
  for (auto& [camera_id, camera] : frames->rigs.cameras) {
    if (!camera.cam_from_rig) continue;
    camera.cam_from_rig->translation *= target->target_from_enu.scale;
  }
  Status status = PrepareOutputFolder(options.output_path);
  if (!status.ok()) return status;
  const auto lock =
      FolderLock::Acquire(options.output_path, FolderLock::Mode::kExclusive);
  if (!lock.ok()) return lock.status();
  status = CheckModelFolder(options.output_path);
  if (status.ok()) {
    status = WriteBinaryModel(*model, options.output_path, *frames);
  }
  if (!status.ok()) return status;
  std::cout << "Model in " << target->description << " written to "
            << options.output_path << std::endl;
  return Status::Ok();
}

}  // namespace

Status RunAdasfmGeoreferencer(int argc, char** argv) {
  GeoreferencerOptions options;
  CommandOptions command("adasfm_georeferencer",
                         "Converts a georeferenced model to ECEF, UTM or the "
                         "ENU frame of another origin.");
  command.AddRequired("input_path", &options.input_path,
                      "model folder, in the ENU frame of --georeference_path");
  command.AddRequired("output_path", &options.output_path,
                      "folder for the model");
  command.AddDefault(
      "frame", &options.frame,
      "ecef, utm (zone of the model's origin), or enu at the given origin");
  command.AddDefault("latitude_deg", &options.enu_origin.latitude_deg,
                     "latitude of the origin of --frame enu [deg]");
  command.AddDefault("longitude_deg", &options.enu_origin.longitude_deg,
                     "longitude of the origin of --frame enu [deg]");
  command.AddDefault(
      "height_m", &options.enu_origin.height_m,
      "height of the origin of --frame enu above the ellipsoid [m]");
  command.AddDefault("georeference_path", &options.georeference_path,
                     "ENU origin of the model; when empty, georeference.json "
                     "in the parent of --input_path");
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;
  if (options.georeference_path.empty()) {
    options.georeference_path =
        (std::filesystem::path(options.input_path) / ".." / kGeoreferenceName)
            .lexically_normal()
            .string();
  }
  return WriteInFrame(options);
}

}  // namespace adasfm
