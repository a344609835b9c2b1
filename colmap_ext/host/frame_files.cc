// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/frame_files.h"

#include "colmap_ext/host/binary_file_reader.h"

namespace adasfm {
namespace {

class FrameFileReader : public BinaryFileReader {
 public:
  using BinaryFileReader::BinaryFileReader;

  Rigid3d ReadPose() {
    Eigen::Matrix<double, 7, 1> pose;
    for (double& value : pose) value = Read<double>();
    return Rigid3d(Eigen::Quaterniond(pose(0), pose(1), pose(2), pose(3)),
                   pose.tail<3>());
  }

  // Reads the type of a sensor; COLMAP numbers cameras 0.
  void ReadType() { only_cameras_ &= Read<int32_t>() == 0; }

  bool only_cameras() const { return only_cameras_; }

 private:
  bool only_cameras_ = true;
};

// Reads the cameras of rigs that have several cameras.
void ReadRigCameras(FrameFileReader* file, CameraRigs* rigs) {
  const auto num_rigs = file->Read<uint64_t>();
  for (uint64_t i = 0; i < num_rigs && file->ok(); ++i) {
    const auto rig_id = file->Read<uint32_t>();
    const auto num_cameras = file->Read<uint32_t>();
    for (uint32_t k = 0; k < num_cameras && file->ok(); ++k) {
      file->ReadType();
      const auto camera_id = file->Read<uint32_t>();
      RigCamera camera;
      camera.rig_id = rig_id;
      camera.is_reference = k == 0;
      if (camera.is_reference) {
        camera.cam_from_rig = Rigid3d();
      } else if (file->Read<uint8_t>() != 0) {
        camera.cam_from_rig = file->ReadPose();
      }
      if (num_cameras > 1) rigs->cameras[camera_id] = camera;
    }
  }
}

void ReadFramesOfImages(FrameFileReader* file,
                        std::map<image_t, FrameOfImage>* frames) {
  const auto num_frames = file->Read<uint64_t>();
  for (uint64_t i = 0; i < num_frames && file->ok(); ++i) {
    FrameOfImage frame;
    frame.frame_id = file->Read<uint32_t>();
    frame.rig_id = file->Read<uint32_t>();
    file->ReadPose();
    const auto num_images = file->Read<uint32_t>();
    for (uint32_t k = 0; k < num_images && file->ok(); ++k) {
      file->ReadType();
      file->Read<uint32_t>();  // the camera
      (*frames)[static_cast<image_t>(file->Read<uint64_t>())] = frame;
    }
  }
}

}  // namespace

StatusOr<ModelFrames> ReadFrameFiles(const std::string& folder) {
  FrameFileReader rigs(folder + "/rigs.bin");
  FrameFileReader frames(folder + "/frames.bin");
  ModelFrames result;
  if (!rigs.ok() || !frames.ok()) return result;
  ReadRigCameras(&rigs, &result.rigs);
  ReadFramesOfImages(&frames, &result.frames);
  if (!rigs.ok() || !frames.ok()) {
    return Status::Error("rigs.bin or frames.bin in " + folder +
                         " is cut short; make the model again");
  }
  return rigs.only_cameras() && frames.only_cameras() ? result : ModelFrames();
}

}  // namespace adasfm
