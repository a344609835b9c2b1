// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/frame_files.h"

#include <fstream>

namespace adasfm {
namespace {

// Numbers of a file, one after the other; zeros from its end on.
class NumberReader {
 public:
  explicit NumberReader(const std::string& path)
      : file_(path, std::ios::binary) {}

  template <typename T>
  T Take() {
    T value{};
    file_.read(reinterpret_cast<char*>(&value), sizeof(value));
    return file_ ? value : T{};
  }

  Rigid3d TakePose() {
    Eigen::Matrix<double, 7, 1> pose;
    for (double& value : pose) value = Take<double>();
    return Rigid3d(Eigen::Quaterniond(pose(0), pose(1), pose(2), pose(3)),
                   pose.tail<3>());
  }

  // Of a sensor; COLMAP numbers cameras 0.
  void TakeType() { only_cameras_ &= Take<int32_t>() == 0; }

  bool ok() const { return static_cast<bool>(file_); }
  bool only_cameras() const { return only_cameras_; }

 private:
  std::ifstream file_;
  bool only_cameras_ = true;
};

// The cameras of the rigs that have several.
void ReadRigCameras(NumberReader* file, CameraRigs* rigs) {
  const auto num_rigs = file->Take<uint64_t>();
  for (uint64_t i = 0; i < num_rigs && file->ok(); ++i) {
    const auto rig_id = file->Take<uint32_t>();
    const auto num_cameras = file->Take<uint32_t>();
    for (uint32_t k = 0; k < num_cameras && file->ok(); ++k) {
      file->TakeType();
      const auto camera_id = file->Take<uint32_t>();
      RigCamera camera;
      camera.rig_id = rig_id;
      camera.is_reference = k == 0;
      if (camera.is_reference) {
        camera.cam_from_rig = Rigid3d();
      } else if (file->Take<uint8_t>() != 0) {
        camera.cam_from_rig = file->TakePose();
      }
      if (num_cameras > 1) rigs->cameras[camera_id] = camera;
    }
  }
}

void ReadFramesOfImages(NumberReader* file,
                        std::map<image_t, FrameOfImage>* frames) {
  const auto num_frames = file->Take<uint64_t>();
  for (uint64_t i = 0; i < num_frames && file->ok(); ++i) {
    FrameOfImage frame;
    frame.frame_id = file->Take<uint32_t>();
    frame.rig_id = file->Take<uint32_t>();
    file->TakePose();
    const auto num_images = file->Take<uint32_t>();
    for (uint32_t k = 0; k < num_images && file->ok(); ++k) {
      file->TakeType();
      file->Take<uint32_t>();  // the camera
      (*frames)[static_cast<image_t>(file->Take<uint64_t>())] = frame;
    }
  }
}

}  // namespace

StatusOr<ModelFrames> ReadFrameFiles(const std::string& folder) {
  NumberReader rigs(folder + "/rigs.bin");
  NumberReader frames(folder + "/frames.bin");
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
