// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/cost_function.h>

#include <vector>

#include "colmap_ext/cost_functions/adjusted_pose.h"

namespace adasfm {

// The pose of an image from the pose of its rig's frame (R_f, C_f) and the
// cam_from_rig (S, b) of its camera:
//   R = S R_f,  C = C_f + R_f^T b.
// Update() derives `pose` from the other two. Its own parameters stay zero,
// around (R, C), so that costs give derivatives by a left rotation of R.
// Without a cam_from_rig `pose` is that of the frame, or of an image in no rig.
struct RigPose {
  AdjustedPose* pose = nullptr;
  AdjustedPose* frame = nullptr;
  AdjustedPose* cam_from_rig = nullptr;

  bool IsDerived() const { return cam_from_rig != nullptr; }
  void Update() const {
    pose->rotation = cam_from_rig->rotation * frame->rotation;
    pose->center =
        frame->center + frame->rotation.transpose() * cam_from_rig->center;
    pose->left_jacobian.setIdentity();
    pose->initial_rotation = Eigen::Quaterniond(pose->rotation);
    pose->initial_center = pose->center;
  }
};

// Turns a cost on the poses of images into one on frames and cams_from_rig.
// With the left Jacobians Jl_f of the frame and Jl_m of the cam_from_rig,
//   dR = Jl_m dw_m + S Jl_f dw_f
//   dC = dc_f + R_f^T db + R_f^T [b]x Jl_f dw_f.
// Parameters: each of Blocks() (6), in that order, then those of the inner cost
// behind its poses. Images may share frames and cams_from_rig.
class RigCost final : public ceres::CostFunction {
 public:
  // inner: its first parameters are those of the poses, in the same order; it
  // reads them from the objects. Not owned.
  RigCost(const ceres::CostFunction* inner, std::vector<RigPose> poses);

  // The parameters of the frames, cams_from_rig and poses that take part, each
  // once.
  const std::vector<double*>& Blocks() const { return blocks_; }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const final;

 private:
  int IndexOf(double* block);

  struct Part {
    RigPose pose;
    int frame_block = 0;
    int cam_from_rig_block = -1;
  };
  const ceres::CostFunction* inner_;
  std::vector<Part> parts_;
  std::vector<double*> blocks_;
};

}  // namespace adasfm
