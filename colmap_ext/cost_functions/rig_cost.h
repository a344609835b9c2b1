// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/cost_function.h>

#include <vector>

#include "colmap_ext/cost_functions/adjusted_pose.h"

namespace adasfm {

// The pose of an image by the pose of its rig's frame (R_f, C_f) and the mount
// of its camera, cam_from_rig (S, b):
//   R = S R_f,  C = C_f + R_f^T b.
// `pose` is derived from the other two by Update(); its own parameters stay
// zero, around (R, C), so that costs give their derivatives by a turn of R from
// the left. Without a mount `pose` is the
// frame's, or that of an image in no rig.
struct RigPose {
  AdjustedPose* pose = nullptr;
  AdjustedPose* frame = nullptr;
  AdjustedPose* mount = nullptr;

  bool IsDerived() const { return mount != nullptr; }
  void Update() const {
    pose->rotation = mount->rotation * frame->rotation;
    pose->center = frame->center + frame->rotation.transpose() * mount->center;
    pose->left_jacobian.setIdentity();
    pose->initial_rotation = Eigen::Quaterniond(pose->rotation);
    pose->initial_center = pose->center;
  }
};

// A cost on the poses of images as one on frames and mounts. With Jl of both,
//   dR = Jl_m dw_m + S Jl_f dw_f
//   dC = dc_f + R_f^T db + R_f^T [b]x Jl_f dw_f.
// Parameters: each of Blocks() (6), in that order, then those of the inner cost
// behind its poses. Images may share frames and mounts.
class RigCost final : public ceres::CostFunction {
 public:
  // inner: its first parameters are those of the poses, in the same order; it
  // reads them from the objects. Not owned.
  RigCost(const ceres::CostFunction* inner, std::vector<RigPose> poses);

  // The parameters of the frames, mounts and poses that take part, each once.
  const std::vector<double*>& Blocks() const { return blocks_; }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final;

 private:
  int IndexOf(double* block);

  struct Part {
    RigPose pose;
    int frame_block = 0;
    int mount_block = -1;
  };
  const ceres::CostFunction* inner_;
  std::vector<Part> parts_;
  std::vector<double*> blocks_;
};

}  // namespace adasfm
