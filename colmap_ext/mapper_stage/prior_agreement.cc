// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/prior_agreement.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <map>
#include <utility>

#include "colmap_ext/cost_functions/shared_errors.h"
#include "core/median.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Fewer points do not fix six degrees of freedom if a few are wrong.
constexpr int kMinPointsOfImage = 15;
// Quantiles of chi-square with three degrees of freedom: 50 % and 99.9 %.
constexpr double kMedianChi2 = 2.366;
constexpr double kLargeChi2 = 16.27;
// Search for the rotation that translations share: a rotation of more sigmas is
// rejected.
constexpr double kMaxNumSharedSigmas = 3.0;
constexpr int kNumSharedSteps = 5;

// Chi-square of the residual; negative when the covariance is not definite.
double Chi2(const Eigen::Vector3d& residual,
            const Eigen::Matrix3d& covariance) {
  const Eigen::LLT<Eigen::Matrix3d> llt(covariance);
  if (!covariance.allFinite() || llt.info() != Eigen::Success) return -1.0;
  return residual.dot(llt.solve(residual));
}

// Residual of a prior's translation in the frame of the later camera [m], and
// its derivative by a rotation of the direction of driving (shared_errors.h)
// [m/rad].
struct TranslationResidual {
  Eigen::Vector3d residual;
  Eigen::Matrix3d by_rotation;
  Eigen::Matrix3d covariance;
};

TranslationResidual ComputeTranslationResidual(const RelativePosePrior& prior,
                                               const Rigid3d& motion) {
  const Rigid3d& stated = prior.cam2_from_cam1;
  const Eigen::Matrix3d later_from_middle =
      ExpSo3(0.5 * LogSo3(stated.rotation)).toRotationMatrix();
  TranslationResidual result;
  result.residual = motion.translation - stated.translation;
  result.by_rotation = -Hat(stated.translation) * later_from_middle;
  result.covariance = prior.covariance.bottomRightCorner<3, 3>();
  return result;
}

// Robust estimate (Cauchy) of the rotation that translations of a drive share,
// an unknown of the adjustment; zero where the adjustment's prior excludes it.
Eigen::Vector3d FindSharedRotation(
    const std::vector<TranslationResidual>& translations) {
  const double sigma = SharedErrorOptions().driving_direction_sigma_rad;
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  for (int step = 0; step < kNumSharedSteps; ++step) {
    Eigen::Matrix3d information = Eigen::Matrix3d::Identity() / (sigma * sigma);
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const TranslationResidual& t : translations) {
      const double chi2 =
          Chi2(t.residual - t.by_rotation * rotation, t.covariance);
      if (chi2 < 0.0) continue;
      const Eigen::Matrix3d weighted = t.by_rotation.transpose() *
                                       t.covariance.inverse() /
                                       (1.0 + chi2 / kLargeChi2);
      information += weighted * t.by_rotation;
      gradient += weighted * t.residual;
    }
    rotation = information.ldlt().solve(gradient);
  }
  if (rotation.norm() > kMaxNumSharedSigmas * sigma) rotation.setZero();
  return rotation;
}

PriorAgreement Summarize(const std::string& kind, std::vector<double> chi2) {
  PriorAgreement agreement;
  agreement.kind = kind;
  agreement.num_priors = static_cast<int>(chi2.size());
  if (chi2.empty()) return agreement;
  agreement.share_contradicting =
      1.0 *
      std::count_if(chi2.begin(), chi2.end(),
                    [](double value) { return value > kLargeChi2; }) /
      chi2.size();
  agreement.chi2_ratio = UpperMedian(&chi2) / kMedianChi2;
  return agreement;
}

}  // namespace

bool IsHeldByPoints(const colmap::Reconstruction& model, image_t image_id) {
  return model.ExistsImage(image_id) && IsRegistered(model, image_id) &&
         static_cast<int>(model.Image(image_id).NumPoints3D()) >=
             kMinPointsOfImage;
}

void AddPriorResiduals(const SceneData& data,
                       const colmap::Reconstruction& model,
                       double size_over_priors, PriorResiduals* residuals) {
  std::map<int, std::vector<TranslationResidual>> translations;
  for (const RelativePosePrior& prior : data.priors) {
    if (!IsHeldByPoints(model, prior.image_id1) ||
        !IsHeldByPoints(model, prior.image_id2)) {
      continue;
    }
    Rigid3d motion = CamFromWorld(model.Image(prior.image_id2)) *
                     CamFromWorld(model.Image(prior.image_id1)).Inverse();
    motion.translation /= size_over_priors;
    if (prior.HasRotation()) {
      const double chi2 = Chi2(
          LogSo3(motion.rotation * prior.cam2_from_cam1.rotation.conjugate()),
          prior.covariance.topLeftCorner<3, 3>());
      if (chi2 >= 0.0) residuals->rotations.push_back(chi2);
    }
    if (prior.HasTranslation()) {
      translations[prior.drive].push_back(
          ComputeTranslationResidual(prior, motion));
    }
  }
  for (const auto& [drive, of_drive] : translations) {
    const Eigen::Vector3d rotation = FindSharedRotation(of_drive);
    for (const TranslationResidual& t : of_drive) {
      const double chi2 =
          Chi2(t.residual - t.by_rotation * rotation, t.covariance);
      if (chi2 >= 0.0) residuals->translations.push_back(chi2);
    }
  }
}

std::vector<PriorAgreement> SummarizeAgreement(PriorResiduals residuals) {
  std::vector<PriorAgreement> agreements;
  if (!residuals.rotations.empty()) {
    agreements.push_back(Summarize("rotation", std::move(residuals.rotations)));
  }
  if (!residuals.translations.empty()) {
    agreements.push_back(
        Summarize("translation", std::move(residuals.translations)));
  }
  return agreements;
}

}  // namespace adasfm
