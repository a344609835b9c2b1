// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/prior_components.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "colmap_ext/host/pose_conversion.h"
#include "core/random.h"
#include "core/so3.h"

namespace adasfm {
namespace {

constexpr double kMaxTerm = 25.0;
// Fewer terms of a kind than this are no statistic.
constexpr int kMinNumTerms = 10;
// The probe moves priors by this many sigmas: small against the robust loss,
// large against what the adjustment leaves unsolved.
constexpr double kProbeSigmas = 0.3;
constexpr int kMaxNumProbeIterations = 3;
constexpr double kProbeTolerance = 1e-6;

// A share near zero says that nothing but the priors holds the motions.
constexpr double kMinShare = 0.02;

constexpr std::array<int, kNumPriorTerms> kNumDof = {3, 2, 1, 3};

// The error of one motion by term, in rad and m; a rotation vector for the
// direction.
using TermErrors = std::array<Eigen::Vector3d, kNumPriorTerms>;
using TermSigmas = std::array<double, kNumPriorTerms>;

Eigen::Vector3d RotationBetween(const Eigen::Vector3d& from,
                                const Eigen::Vector3d& to) {
  return LogSo3(Eigen::Quaterniond::FromTwoVectors(from, to));
}

TermErrors ErrorsOf(const Rigid3d& motion, const Rigid3d& prior) {
  TermErrors errors;
  errors[0] = LogSo3(motion.rotation * prior.rotation.conjugate());
  errors[1] = RotationBetween(prior.translation, motion.translation);
  errors[2] = Eigen::Vector3d(
      motion.translation.norm() - prior.translation.norm(), 0.0, 0.0);
  errors[3] = motion.translation - prior.translation;
  return errors;
}

bool TakesPart(const PosePriorEdge& edge,
               const colmap::Reconstruction& reconstruction) {
  return edge.dt_s >= 0.0 && edge.is_held_by_points &&
         reconstruction.IsImageRegistered(edge.image_id1) &&
         reconstruction.IsImageRegistered(edge.image_id2);
}

Rigid3d MotionOf(const PosePriorEdge& edge,
                 const colmap::Reconstruction& reconstruction) {
  return ComputeCam2FromCam1(
      CamFromWorld(reconstruction.Image(edge.image_id1)),
      CamFromWorld(reconstruction.Image(edge.image_id2)));
}

// Infinite where the edge has no such term, or takes no part.
TermSigmas SigmasOf(const PosePriorEdge& edge, const PriorSigmaFactors& factors,
                    const colmap::Reconstruction& reconstruction) {
  TermSigmas sigmas;
  for (int k = 0; k < kNumPriorTerms; ++k) {
    sigmas[k] = TakesPart(edge, reconstruction)
                    ? factors[k] * edge.SigmaOf(static_cast<PriorTerm>(k))
                    : std::numeric_limits<double>::infinity();
  }
  return sigmas;
}

// Random signs times kProbeSigmas.
TermErrors DrawProbe(const PosePriorEdge& edge, const TermSigmas& sigmas,
                     Random* random) {
  const auto sign = [random] { return random->UniformInt(0, 1) ? 1.0 : -1.0; };
  const auto signs = [&sign] {
    const double x = sign(), y = sign();
    return Eigen::Vector3d(x, y, sign());
  };
  const Eigen::Vector3d along = edge.cam2_from_cam1.translation.normalized();
  const Eigen::Vector3d across = along.unitOrthogonal();
  const Eigen::Vector3d of_direction = signs();
  TermErrors probe = {
      signs(),
      of_direction.x() * across + of_direction.y() * along.cross(across),
      Eigen::Vector3d(sign(), 0.0, 0.0), signs()};
  for (int k = 0; k < kNumPriorTerms; ++k) {
    probe[k] *= std::isfinite(sigmas[k]) ? kProbeSigmas * sigmas[k] : 0.0;
  }
  return probe;
}

void MovePrior(const TermErrors& by, Rigid3d* prior) {
  prior->rotation = (ExpSo3(by[0]) * prior->rotation).normalized();
  prior->translation = ExpSo3(by[1]) * prior->translation;
  prior->translation += by[2].x() * prior->translation.normalized() + by[3];
}

}  // namespace

double PriorComponent::Chi2PerDof() const {
  return mean_square / redundancy_share;
}

double PriorComponent::VarianceFactor() const {
  return std::max(0.0, 1.0 + (mean_square - redundancy_share) / own_share);
}

double PriorComponent::VarianceFactorSigma() const {
  return std::sqrt(2.0 * mean_square / num_residuals) / own_share;
}

PriorComponents ComputePriorComponents(
    const PriorSigmaFactors& factors, const std::vector<PosePriorEdge>& priors,
    const colmap::Reconstruction& reconstruction) {
  PriorComponents components;
  for (const PosePriorEdge& edge : priors) {
    if (!TakesPart(edge, reconstruction)) continue;
    const TermSigmas sigmas = SigmasOf(edge, factors, reconstruction);
    const TermErrors errors =
        ErrorsOf(MotionOf(edge, reconstruction), edge.cam2_from_cam1);
    for (int k = 0; k < kNumPriorTerms; ++k) {
      if (!std::isfinite(sigmas[k])) continue;
      components[k].num_residuals += kNumDof[k];
      components[k].mean_square += std::min(
          kMaxTerm * kNumDof[k], (errors[k] / sigmas[k]).squaredNorm());
    }
  }
  for (int k = 0; k < kNumPriorTerms; ++k) {
    PriorComponent& component = components[k];
    component.mean_square =
        component.num_residuals < kMinNumTerms * kNumDof[k]
            ? 0.0
            : component.mean_square / component.num_residuals;
  }
  return components;
}

bool EstimateRedundancies(const PriorBundleAdjustmentOptions& options,
                          const PriorBundleAdjustmentProblem& problem,
                          const SharedErrors& shared_errors,
                          const colmap::Reconstruction& reconstruction,
                          PriorComponents* components) {
  Random random(1);
  PriorBundleAdjustmentProblem moved = problem;
  std::vector<TermErrors> probes;
  for (PosePriorEdge& edge : moved.priors) {
    probes.push_back(DrawProbe(
        edge, SigmasOf(edge, options.prior_sigma_factors, reconstruction),
        &random));
    MovePrior(probes.back(), &edge.cam2_from_cam1);
  }
  colmap::Reconstruction followed = reconstruction;
  PriorBundleAdjustmentOptions probe_options = options;
  probe_options.max_num_iterations = kMaxNumProbeIterations;
  probe_options.function_tolerance = kProbeTolerance;
  const PriorBundleAdjustmentSummary summary =
      AdjustBundle(probe_options, moved, &followed);
  if (!summary.success) return false;

  const std::vector<PosePriorEdge> before =
      CorrectSharedErrors(options.shared_errors, shared_errors, problem.priors);
  const std::vector<PosePriorEdge> after = CorrectSharedErrors(
      options.shared_errors, summary.shared_errors, problem.priors);
  TermSigmas followed_sum = {}, left_sum = {}, probe_sum = {};
  for (size_t i = 0; i < probes.size(); ++i) {
    if (!TakesPart(before[i], reconstruction)) continue;
    const TermErrors first =
        ErrorsOf(MotionOf(before[i], reconstruction), before[i].cam2_from_cam1);
    const TermErrors second =
        ErrorsOf(MotionOf(after[i], followed), after[i].cam2_from_cam1);
    const TermSigmas sigmas =
        SigmasOf(before[i], options.prior_sigma_factors, reconstruction);
    for (int k = 0; k < kNumPriorTerms; ++k) {
      if (!std::isfinite(sigmas[k])) continue;
      const Eigen::Vector3d probe = probes[i][k] / sigmas[k];
      const Eigen::Vector3d followed_by = (second[k] - first[k]) / sigmas[k];
      followed_sum[k] += probe.dot(followed_by);
      left_sum[k] += (probe - followed_by).squaredNorm();
      probe_sum[k] += probe.squaredNorm();
    }
  }
  for (int k = 0; k < kNumPriorTerms; ++k) {
    if (probe_sum[k] == 0.0) continue;
    PriorComponent& component = (*components)[k];
    component.redundancy_share =
        std::clamp(1.0 - followed_sum[k] / probe_sum[k], kMinShare, 1.0);
    // No larger, unless the adjustment has not converged.
    component.own_share = std::clamp(left_sum[k] / probe_sum[k], kMinShare,
                                     component.redundancy_share);
  }
  return true;
}

double LargestNumSigmas(const PosePriorEdge& prior,
                        const colmap::Reconstruction& reconstruction) {
  if (!reconstruction.IsImageRegistered(prior.image_id1) ||
      !reconstruction.IsImageRegistered(prior.image_id2)) {
    return 0.0;
  }
  const TermErrors errors =
      ErrorsOf(MotionOf(prior, reconstruction), prior.cam2_from_cam1);
  double largest = 0.0;
  for (int k = 0; k < kNumPriorTerms; ++k) {
    const double sigma = prior.SigmaOf(static_cast<PriorTerm>(k));
    if (std::isfinite(sigma)) {
      largest = std::max(largest, errors[k].norm() / sigma);
    }
  }
  return largest;
}

double LargestChi2PerDof(const PriorComponents& components) {
  double largest = 0.0;
  for (const PriorComponent& component : components) {
    largest = std::max(largest, component.Chi2PerDof());
  }
  return largest;
}

}  // namespace adasfm
