// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/prior_agreement.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
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
// Shared errors of more sigmas are no errors of a sensor: none is taken out.
constexpr double kMaxNumSharedSigmas = 3.0;
constexpr int kNumSharedSteps = 5;

// Chi-square of the residual; negative when the covariance is not definite.
double Chi2(const Eigen::Vector3d& residual,
            const Eigen::Matrix3d& covariance) {
  const Eigen::LLT<Eigen::Matrix3d> llt(covariance);
  if (!covariance.allFinite() || llt.info() != Eigen::Success) return -1.0;
  return residual.dot(llt.solve(residual));
}

// Residual of a prior in the frame of the later camera, rad or m, and its
// derivative by the error that it shares with all priors of its window.
struct SharedResidual {
  Eigen::Vector3d residual;
  Eigen::Matrix3d by_error;
  Eigen::Matrix3d covariance;
  int window = 0;

  double Chi2Without(const Eigen::Vector3d& error) const {
    return Chi2(residual - by_error * error, covariance);
  }
};

// Of the priors of a drive, in order of time.
using SharedResiduals = std::vector<SharedResidual>;

// By a rotation of the direction of driving (shared_errors.h).
SharedResidual TranslationResidual(const RelativePosePrior& prior,
                                   const Rigid3d& motion) {
  const Rigid3d& stated = prior.cam2_from_cam1;
  SharedResidual result;
  result.residual = motion.translation - stated.translation;
  result.by_error =
      -Hat(stated.translation) * CameraFromMiddle(stated.rotation);
  result.covariance = prior.covariance.bottomRightCorner<3, 3>();
  return result;
}

// By the gyroscope's bias.
SharedResidual RotationResidual(const RelativePosePrior& prior,
                                const Rigid3d& motion, int window) {
  const Eigen::Quaterniond& stated = prior.cam2_from_cam1.rotation;
  SharedResidual result;
  result.residual = LogSo3(motion.rotation * stated.conjugate());
  result.by_error = SecondsFromNs(prior.dt_ns) * CameraFromMiddle(stated);
  result.covariance = prior.covariance.topLeftCorner<3, 3>();
  result.window = window;
  return result;
}

// Numbers the windows of a drive. A long motion lies in one, so that there are
// no more windows than motions.
struct WindowCounter {
  int number = 0;
  double elapsed_s = 0.0;

  int Add(double dt_s, double window_s) {
    if (elapsed_s > window_s) {
      ++number;
      elapsed_s = 0.0;
    }
    elapsed_s += dt_s;
    return number;
  }
};

// Sigmas, per axis, of the error of the first window and of the random walk
// from each window to the next one.
struct WalkSigmas {
  double first = 0.0;
  double step = 0.0;
};

// One step of the robust (Cauchy) estimate: the errors by window that fit the
// residuals best, weighed by the errors before, from tridiagonal normal
// equations in blocks of 3.
std::vector<Eigen::Vector3d> FitSharedErrors(
    const SharedResiduals& residuals, const WalkSigmas& sigmas,
    const std::vector<Eigen::Vector3d>& before) {
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  const double step_weight = 1.0 / (sigmas.step * sigmas.step);
  const size_t count = before.size();
  std::vector<Eigen::Matrix3d> information(count, Eigen::Matrix3d::Zero());
  std::vector<Eigen::Vector3d> errors(count, Eigen::Vector3d::Zero());
  information[0] = identity / (sigmas.first * sigmas.first);
  for (size_t k = 1; k < count; ++k) {
    information[k - 1] += step_weight * identity;
    information[k] += step_weight * identity;
  }
  for (const SharedResidual& r : residuals) {
    const double chi2 = r.Chi2Without(before[r.window]);
    if (chi2 < 0.0) continue;
    const Eigen::Matrix3d weighted = r.by_error.transpose() *
                                     r.covariance.inverse() /
                                     (1.0 + chi2 / kLargeChi2);
    information[r.window] += weighted * r.by_error;
    errors[r.window] += weighted * r.residual;
  }
  for (size_t k = 1; k < count; ++k) {
    const Eigen::Matrix3d factor = step_weight * information[k - 1].inverse();
    information[k] -= step_weight * factor;
    errors[k] += factor * errors[k - 1];
  }
  for (size_t k = count; k-- > 0;) {
    if (k + 1 < count) errors[k] += step_weight * errors[k + 1];
    errors[k] = information[k].ldlt().solve(errors[k]);
  }
  return errors;
}

// Root mean square of the windows' errors and steps, in their sigmas.
double NumSigmas(const std::vector<Eigen::Vector3d>& errors,
                 const WalkSigmas& sigmas) {
  double sum = (errors[0] / sigmas.first).squaredNorm();
  for (size_t k = 1; k < errors.size(); ++k) {
    sum += ((errors[k] - errors[k - 1]) / sigmas.step).squaredNorm();
  }
  return std::sqrt(sum / errors.size());
}

// Appends the chi-squares of the residuals without the errors that they share,
// which are unknowns of the adjustment, unless its priors exclude them.
void AppendChi2(const SharedResiduals& residuals, const WalkSigmas& sigmas,
                std::vector<double>* chi2) {
  const std::vector<Eigen::Vector3d> none(residuals.back().window + 1,
                                          Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> errors = none;
  for (int step = 0; step < kNumSharedSteps; ++step) {
    errors = FitSharedErrors(residuals, sigmas, errors);
  }
  if (!(NumSigmas(errors, sigmas) <= kMaxNumSharedSigmas)) errors = none;
  for (const SharedResidual& r : residuals) {
    const double value = r.Chi2Without(errors[r.window]);
    if (value >= 0.0) chi2->push_back(value);
  }
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
  const SharedErrorOptions shared;
  std::map<int, SharedResiduals> rotations, translations;  // By drive.
  std::map<int, WindowCounter> windows;
  for (const RelativePosePrior& prior : data.priors) {
    const int window = windows[prior.drive].Add(SecondsFromNs(prior.dt_ns),
                                                shared.gyroscope_window_s);
    if (!IsHeldByPoints(model, prior.image_id1) ||
        !IsHeldByPoints(model, prior.image_id2)) {
      continue;
    }
    Rigid3d motion = CamFromWorld(model.Image(prior.image_id2)) *
                     CamFromWorld(model.Image(prior.image_id1)).Inverse();
    motion.translation /= size_over_priors;
    if (prior.HasRotation()) {
      rotations[prior.drive].push_back(RotationResidual(prior, motion, window));
    }
    if (prior.HasTranslation()) {
      translations[prior.drive].push_back(TranslationResidual(prior, motion));
    }
  }
  const WalkSigmas bias = {kGyroscopeBiasSigmaRadS,
                           shared.gyroscope_random_walk_rad_s_sqrt_s *
                               std::sqrt(shared.gyroscope_window_s)};
  for (const auto& [drive, of_drive] : rotations) {
    AppendChi2(of_drive, bias, &residuals->rotations);
  }
  const WalkSigmas direction = {shared.driving_direction_sigma_rad, 1.0};
  for (const auto& [drive, of_drive] : translations) {
    AppendChi2(of_drive, direction, &residuals->translations);
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
