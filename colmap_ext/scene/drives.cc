// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/scene/drives.h"

#include <algorithm>
#include <map>

#include "core/disjoint_sets.h"

namespace adasfm {

void NumberDrives(SceneData* scene) {
  std::map<camera_t, int> index_of;
  for (const auto& [camera_id, camera] : scene->cameras) {
    index_of.emplace(camera_id, static_cast<int>(index_of.size()));
  }
  const auto index_of_image = [&](image_t image_id) {
    return index_of.at(scene->images.at(image_id).camera_id);
  };
  DisjointSets machines(index_of.size());
  std::map<int, int> camera_of_rig;
  for (const auto& [camera_id, camera] : scene->rigs.cameras) {
    const auto index = index_of.find(camera_id);
    if (index == index_of.end()) continue;
    machines.Join(
        index->second,
        camera_of_rig.emplace(camera.rig_id, index->second).first->second);
  }
  for (const RelativePosePrior& prior : scene->priors) {
    machines.Join(index_of_image(prior.image_id1),
                  index_of_image(prior.image_id2));
  }
  std::map<int, int> drives;
  for (RelativePosePrior& prior : scene->priors) {
    prior.drive = drives
                      .emplace(machines.Find(index_of_image(prior.image_id1)),
                               static_cast<int>(drives.size()))
                      .first->second;
  }
  for (auto& [image_id, image] : scene->images) {
    const auto drive = drives.find(machines.Find(index_of.at(image.camera_id)));
    if (drive != drives.end()) image.drive = drive->second;
  }
  for (InertialMotion& motion : scene->inertial_motions) {
    motion.drive = scene->images.at(motion.image_id1).drive;
  }
}

std::string DriveName(const SceneData& scene, int drive) {
  const auto prior = std::find_if(
      scene.priors.begin(), scene.priors.end(),
      [drive](const RelativePosePrior& prior) { return prior.drive == drive; });
  return scene.images.at(prior->image_id1).name;
}

void RotatePriors(const CameraImuCorrectionMap& corrections,
                  std::vector<RelativePosePrior>* priors) {
  for (RelativePosePrior& prior : *priors) {
    const auto found = corrections.find(prior.drive);
    if (found != corrections.end()) RotatePrior(found->second, &prior);
  }
}

void RotateGravityAndMotions(const CameraImuCorrectionMap& corrections,
                             SceneData* scene) {
  for (auto& [image_id, image] : scene->images) {
    const auto found = corrections.find(image.drive);
    if (found == corrections.end() || !image.gravity_in_cam) continue;
    image.gravity_in_cam = found->second * *image.gravity_in_cam;
  }
  for (InertialMotion& motion : scene->inertial_motions) {
    const auto found = corrections.find(motion.drive);
    if (found != corrections.end())
      RotateInertialMotion(found->second, &motion);
  }
}

CameraImuCorrectionMap Inverted(CameraImuCorrectionMap corrections) {
  for (auto& [drive, rotation] : corrections) {
    rotation = rotation.conjugate();
  }
  return corrections;
}

void AddTimeShifts(const TimeShiftMap& shifts,
                   std::vector<RelativePosePrior>* priors,
                   std::vector<InertialMotion>* motions) {
  for (RelativePosePrior& prior : *priors) {
    const auto found = shifts.find(prior.drive);
    if (found != shifts.end()) AddTimeShift(found->second, &prior);
  }
  for (InertialMotion& motion : *motions) {
    const auto found = shifts.find(motion.drive);
    if (found != shifts.end()) AddTimeShift(found->second, &motion);
  }
}

void CorrectGyroscopeScales(const GyroscopeScaleMap& scales,
                            std::vector<RelativePosePrior>* priors) {
  for (RelativePosePrior& prior : *priors) {
    const auto found = scales.find(prior.drive);
    if (found != scales.end()) CorrectGyroscopeScales(found->second, &prior);
  }
}

}  // namespace adasfm
