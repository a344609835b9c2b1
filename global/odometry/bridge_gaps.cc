// SPDX-License-Identifier: BSD-3-Clause
#include "global/odometry/bridge_gaps.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "global/odometry/gap_smoother.h"
#include "global/odometry/inertial_scale.h"

namespace adasfm {
namespace {

// 1 sigma of a step within a model of known scale, as a ratio.
constexpr double kStepSigmaRatio = 0.02;
constexpr size_t kMinNumImagesOfSide = 8;
// Largest sigma of a scale found across a gap.
constexpr double kMaxFoundSizeSigma = 0.1;
// Longer ones are known to metres only.
constexpr double kMaxGapS = 20.0;

std::vector<DriveChain> FindChains(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors) {
  std::map<ImagePair, size_t> rotations;
  for (size_t k = 0; k < priors.size(); ++k) {
    if (priors[k].HasRotation()) {
      rotations[ImagePair(priors[k].image_id1, priors[k].image_id2)] = k;
    }
  }
  std::vector<DriveChain> chains;
  for (const InertialMotion& motion : motions) {
    const auto rotation =
        rotations.find(ImagePair(motion.image_id1, motion.image_id2));
    if (rotation == rotations.end() ||
        priors[rotation->second].image_id1 != motion.image_id1) {
      continue;
    }
    if (chains.empty() || chains.back().images.back() != motion.image_id1) {
      chains.emplace_back();
      chains.back().images.push_back(motion.image_id1);
    }
    DriveChain& chain = chains.back();
    chain.images.push_back(motion.image_id2);
    chain.motions.push_back(&motion);
    chain.priors.push_back(rotation->second);
  }
  return chains;
}

// Sets the model of each image; runs too short for a velocity have none.
void LabelImages(const std::vector<SizedModel>& models, DriveChain* chain) {
  for (const image_t image_id : chain->images) {
    int label = kNoModel;
    for (size_t k = 0; k < models.size() && label == kNoModel; ++k) {
      if (models[k].cams_from_world.count(image_id) == 0) continue;
      label = static_cast<int>(k);
    }
    chain->models.push_back(label);
  }
  for (size_t first = 0; first < chain->models.size();) {
    size_t end = first;
    while (end < chain->models.size() &&
           chain->models[end] == chain->models[first]) {
      ++end;
    }
    if (end - first < kMinNumImagesOfSide) {
      std::fill(chain->models.begin() + first, chain->models.begin() + end,
                kNoModel);
    }
    first = end;
  }
}

std::vector<DriveGap> FindGaps(const DriveChain& chain) {
  std::vector<DriveGap> gaps;
  std::optional<size_t> last_known;
  for (size_t k = 0; k < chain.models.size(); ++k) {
    if (chain.models[k] == kNoModel) continue;
    if (last_known &&
        (k > *last_known + 1 || chain.models[k] != chain.models[*last_known])) {
      gaps.push_back({*last_known, k});
    }
    last_known = k;
  }
  return gaps;
}

void SetMotion(const MeasuredTranslation& measured, RelativePosePrior* prior) {
  prior->flags |= kPriorDirection | kPriorLength;
  SetTranslation(measured, prior);
}

MeasuredTranslation StepOfModel(const Rigid3d& cam1_from_world,
                                const Rigid3d& cam2_from_world,
                                double metres_per_unit) {
  MeasuredTranslation step;
  step.translation = metres_per_unit *
                     (cam2_from_world * cam1_from_world.Inverse()).translation;
  const double sigma = std::hypot(std::sqrt(2.0) * GapSmoother::kPositionSigmaM,
                                  kStepSigmaRatio * step.translation.norm());
  step.covariance = sigma * sigma * Eigen::Matrix3d::Identity();
  return step;
}

class GapBridger {
 public:
  GapBridger(const std::vector<InertialMotion>& motions,
             const std::vector<RelativePosePrior>& priors,
             const std::vector<std::map<image_t, Rigid3d>>& models)
      : priors_(priors), chains_(FindChains(motions, priors)) {
    for (const std::map<image_t, Rigid3d>& model : models) {
      models_.push_back({model, EstimateInertialScale(motions, model)});
    }
    for (DriveChain& chain : chains_) LabelImages(models_, &chain);
  }

  InertialOdometry Bridge() {
    while (FindSize()) {
    }
    InertialOdometry odometry;
    odometry.priors = priors_;
    for (const DriveChain& chain : chains_) {
      AddSteps(chain, &odometry.priors);
      for (const DriveGap& gap : FindGaps(chain)) {
        if (HasScale(chain, gap.first) && HasScale(chain, gap.last)) {
          AddBridge(chain, gap, &odometry);
        }
      }
    }
    return odometry;
  }

 private:
  bool HasScale(const DriveChain& chain, size_t k) const {
    return models_[chain.models[k]].scale.has_value();
  }

  // Finds the scale of a model across a gap from one of known scale. False when
  // there is none left.
  bool FindSize() {
    for (const DriveChain& chain : chains_) {
      for (const DriveGap& gap : FindGaps(chain)) {
        const bool is_far = HasScale(chain, gap.first);
        if (HasScale(chain, gap.last) == is_far) continue;
        GapSmoother smoother(priors_, models_, chain, gap);
        if (smoother.Seconds() > kMaxGapS || !smoother.Solve()) continue;
        const InertialScale scale = smoother.Scale(is_far);
        if (!(scale.metres_per_unit > 0.0) ||
            !(scale.sigma_ratio <= kMaxFoundSizeSigma)) {
          continue;
        }
        models_[chain.models[is_far ? gap.last : gap.first]].scale = scale;
        return true;
      }
    }
    return false;
  }

  // Sets the motions of steps within models.
  void AddSteps(const DriveChain& chain,
                std::vector<RelativePosePrior>* priors) const {
    for (size_t k = 0; k < chain.priors.size(); ++k) {
      if (chain.models[k] == kNoModel ||
          chain.models[k + 1] != chain.models[k]) {
        continue;
      }
      const SizedModel& model = models_[chain.models[k]];
      if (!model.scale) continue;
      SetMotion(StepOfModel(model.cams_from_world.at(chain.images[k]),
                            model.cams_from_world.at(chain.images[k + 1]),
                            model.scale->metres_per_unit),
                &(*priors)[chain.priors[k]]);
    }
  }

  void AddBridge(const DriveChain& chain, const DriveGap& gap,
                 InertialOdometry* odometry) const {
    GapSmoother smoother(priors_, models_, chain, gap);
    if (smoother.Seconds() > kMaxGapS || !smoother.Solve()) return;
    size_t k = gap.first;
    for (const MeasuredTranslation& step : smoother.Steps()) {
      SetMotion(step, &odometry->priors[chain.priors[k]]);
      odometry->bridges[ImagePair(chain.images[k], chain.images[k + 1])] =
          step.covariance;
      ++k;
    }
    ++odometry->num_gaps;
  }

  const std::vector<RelativePosePrior>& priors_;
  std::vector<DriveChain> chains_;
  std::vector<SizedModel> models_;
};

}  // namespace

InertialOdometry BridgeGaps(
    const std::vector<InertialMotion>& motions,
    const std::vector<RelativePosePrior>& priors,
    const std::vector<std::map<image_t, Rigid3d>>& models) {
  return GapBridger(motions, priors, models).Bridge();
}

}  // namespace adasfm
