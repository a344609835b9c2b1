// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/mapper_fingerprint.h"

#include "core/hash.h"

namespace adasfm {
namespace {

class Hash : public Fnv1aHash {
 public:
  using Fnv1aHash::Add;
  void Add(const std::string& text) {
    Add(text.size());
    AddBytes(text.data(), text.size());
  }
  template <typename Derived>
  void AddMatrix(const Eigen::DenseBase<Derived>& matrix) {
    for (const double value : matrix.reshaped()) Add(value);
  }
  void Add(const Rigid3d& pose) {
    AddMatrix(pose.rotation.coeffs());
    AddMatrix(pose.translation);
  }
};

// The priors within frames follow from the rigs (ComputeFramePriors).
void AddRigs(const CameraRigs& rigs, Hash* hash) {
  for (const auto& [camera_id, camera] : rigs.cameras) {
    hash->Add(camera_id);
    hash->Add(camera.rig_id);
    hash->Add(camera.is_reference);
    if (camera.cam_from_rig) hash->Add(*camera.cam_from_rig);
    hash->Add(camera.rotation_sigma_rad);
    hash->Add(camera.translation_sigma_m);
  }
  for (const auto& [image_id, image] : rigs.images) {
    hash->Add(image_id);
    hash->Add(image.camera_id);
    hash->Add(image.frame_id);
  }
}

void AddMotions(const SceneData& data, Hash* hash) {
  for (const RelativePosePrior& prior : data.priors) {
    hash->Add(prior.image_id1);
    hash->Add(prior.image_id2);
    hash->Add(prior.dt_ns);
    hash->Add(prior.cam2_from_cam1);
    hash->AddMatrix(prior.covariance);
    hash->Add(prior.flags);
    hash->AddMatrix(prior.rotation_by_time_shift);
  }
  for (const InertialMotion& motion : data.inertial_motions) {
    hash->Add(motion.image_id1);
    hash->Add(motion.image_id2);
    hash->Add(motion.dt_s);
    hash->AddMatrix(motion.delta_velocity);
    hash->AddMatrix(motion.delta_position);
    hash->AddMatrix(motion.velocity_by_bias);
    hash->AddMatrix(motion.position_by_bias);
    hash->AddMatrix(motion.velocity_by_time_shift);
    hash->AddMatrix(motion.position_by_time_shift);
    hash->AddMatrix(motion.camera_from_imu_origin);
    if (!motion.by_wheels) continue;
    hash->AddMatrix(motion.by_wheels->translation);
    hash->AddMatrix(motion.by_wheels->covariance);
  }
  hash->Add(data.length_drift_ratio);
  hash->Add(data.inertial_scale_sigma);
  if (data.wheel_scale) {
    hash->Add(data.wheel_scale->scale);
    hash->Add(data.wheel_scale->sigma);
    hash->Add(data.wheel_scale->stated_sigma);
  }
}

void AddPositions(const std::vector<PositionPrior>& positions, Hash* hash) {
  for (const PositionPrior& prior : positions) {
    hash->Add(prior.image_id1);
    hash->Add(prior.image_id2);
    hash->Add(prior.share);
    hash->AddMatrix(prior.position);
    hash->AddMatrix(prior.covariance);
    hash->AddMatrix(prior.antenna_in_cam);
  }
}

void AddScene(const SceneData& data, Hash* hash) {
  for (const auto& [image_id, image] : data.images) {
    hash->Add(image_id);
    hash->Add(image.name);
    for (const Eigen::Vector2d& keypoint : image.keypoints)
      hash->AddMatrix(keypoint);
    if (image.gravity_in_cam) hash->AddMatrix(*image.gravity_in_cam);
  }
  for (const auto& [camera_id, camera] : data.cameras) {
    hash->Add(camera_id);
    hash->Add(ModelIdOf(camera));
    for (const double parameter : ParamsOf(camera)) hash->Add(parameter);
  }
  for (const ScenePair& pair : data.pairs) {
    hash->Add(pair.image_id1);
    hash->Add(pair.image_id2);
    for (const FeatureMatch& match : pair.inlier_matches) {
      hash->Add(match.point2D_idx1);
      hash->Add(match.point2D_idx2);
    }
  }
  AddMotions(data, hash);
  AddPositions(data.positions, hash);
  AddRigs(data.rigs, hash);
  for (const auto& [image_id, pose] : data.fixed_poses) hash->Add(image_id);
}

void AddVarianceComponents(const VarianceComponentOptions& balance,
                           Hash* hash) {
  hash->Add(balance.enabled);
  hash->Add(balance.estimate_keypoint_sigma);
  hash->Add(balance.estimate_prior_sigmas);
  hash->Add(balance.max_sigma_factor);
}

void AddPartitionOptions(const PartitionPlanOptions& partition, Hash* hash) {
  hash->Add(partition.cut.max_part_size);
  hash->Add(partition.cut.min_part_size);
  hash->Add(partition.min_overlap_ratio);
  hash->Add(partition.max_num_images_undivided);
}

void AddLocalOptions(const LocalMapperOptions& local, Hash* hash) {
  hash->Add(local.registration.min_num_visible_points);
  hash->Add(local.registration.max_reproj_error_px);
  hash->Add(local.registration.use_global_candidate);
  hash->Add(local.use_priors_in_adjustment);
  hash->Add(local.use_coarse_motions_in_parts);
  hash->Add(local.filter_max_reproj_error_px);
  hash->Add(local.min_triangulation_angle_deg);
  hash->Add(local.keypoint_sigma_px);
  AddVarianceComponents(local.balance, hash);
}

void AddAlignOptions(const AlignSimilarityOptions& align, Hash* hash) {
  hash->Add(align.initial_threshold);
  hash->Add(align.threshold_increase);
  hash->Add(align.threshold_decrease);
  hash->Add(align.min_inlier_ratio);
  hash->Add(align.max_inlier_ratio);
  hash->Add(align.adapt_threshold);
}

void AddRefineOptions(const RefineModelOptions& refine, Hash* hash) {
  hash->Add(refine.refine_focal_length);
  hash->Add(refine.refine_principal_point);
  hash->Add(refine.refine_extra_params);
  for (const camera_t camera_id : refine.constant_cameras) hash->Add(camera_id);
  hash->Add(refine.initial_position_loss_scale);
}

}  // namespace

std::string ComputePartsFingerprint(const PartitionPlanOptions& partition,
                                    const LocalMapperOptions& local,
                                    const SceneData& data,
                                    const CoarsePoseMap& coarse) {
  Hash hash;
  AddScene(data, &hash);
  for (const auto& [image_id, pose] : coarse) {
    hash.Add(image_id);
    hash.Add(pose);
  }
  AddPartitionOptions(partition, &hash);
  AddLocalOptions(local, &hash);
  return hash.Text();
}

std::string ComputeMergeFingerprint(const std::string& parts_fingerprint,
                                    const AlignSimilarityOptions& align,
                                    const RefineModelOptions& refine,
                                    const std::vector<PartReport>& parts) {
  Hash hash;
  hash.Add(parts_fingerprint);
  AddAlignOptions(align, &hash);
  AddRefineOptions(refine, &hash);
  for (const PartReport& part : parts) {
    hash.Add(part.part_index);
    hash.Add(part.failure.empty());
    hash.Add(part.num_registered);
    hash.Add(part.num_points);
    hash.Add(part.mean_reproj_error_px);
  }
  return hash.Text();
}

}  // namespace adasfm
