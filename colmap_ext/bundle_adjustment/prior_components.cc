// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/prior_components.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "colmap_ext/host/pose_conversion.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Terms count at most three sigmas, stated or estimated, whichever is larger:
// beyond that the adjustment's loss treats a term as an outlier
// (prior_loss_scale in bundle_adjustment.h), which is no evidence about the
// others.
constexpr double kMaxNumSigmas = 3.0;
constexpr double kMeanSquareTolerance = 1e-3;
// Fewer terms of a kind than this are no statistic.
constexpr int kMinNumTerms = 10;

constexpr std::array<int, kNumPriorTerms> kNumDof = {3, 2, 1, 3, 3};

// Huber's estimate of a scale, with its cap: the mean m of the squares, each at
// most 3^2 max(1, m). The search begins at the plain mean and only falls.
// Errors that most terms share count in full; a few large ones, up to one term
// in nine, do not.
double ComputeCappedMean(const std::vector<double>& squares, int num_dof) {
  double mean = std::numeric_limits<double>::infinity();
  double last = 0.0;
  do {
    last = mean;
    const double cap = kMaxNumSigmas * kMaxNumSigmas * std::max(1.0, last);
    double sum = 0.0;
    for (const double square : squares) sum += std::min(square / num_dof, cap);
    mean = sum / squares.size();
  } while (mean < (1.0 - kMeanSquareTolerance) * last);
  return mean;
}

// The error of one motion by term, in rad and m; a rotation vector for the
// direction.
using TermErrors = std::array<Eigen::Vector3d, kNumPriorTerms>;

Eigen::Vector3d RotationBetween(const Eigen::Vector3d& from,
                                const Eigen::Vector3d& to) {
  return LogSo3(Eigen::Quaterniond::FromTwoVectors(from, to));
}

TermErrors ErrorsOf(const Rigid3d& motion, const Rigid3d& prior) {
  TermErrors errors = {};
  errors[0] = LogSo3(motion.rotation * prior.rotation.conjugate());
  errors[1] = RotationBetween(prior.translation, motion.translation);
  errors[2] = Eigen::Vector3d(
      motion.translation.norm() - prior.translation.norm(), 0.0, 0.0);
  errors[3] = motion.translation - prior.translation;
  return errors;
}

// The errors of the motion between the prior's images; none when one is
// missing.
std::optional<TermErrors> ErrorsAt(
    const PosePriorEdge& edge, const colmap::Reconstruction& reconstruction) {
  if (!IsRegistered(reconstruction, edge.image_id1) ||
      !IsRegistered(reconstruction, edge.image_id2)) {
    return std::nullopt;
  }
  return ErrorsOf(
      ComputeCam2FromCam1(CamFromWorld(reconstruction.Image(edge.image_id1)),
                          CamFromWorld(reconstruction.Image(edge.image_id2))),
      edge.cam2_from_cam1);
}

}  // namespace

double PriorComponent::ScoringStep() const {
  constexpr double kMinStep = 0.25;
  return std::max(kMinStep, 1.0 + (mean_square - redundancy_share) / own_share);
}

double PriorComponent::Chi2Sigma() const {
  return num_residuals == 0 ? 0.0
                            : std::sqrt(2.0 / (own_share * num_residuals));
}

void AddPriorTerm(PriorTerm term, double squared_residual,
                  PriorComponents* components) {
  const auto k = static_cast<size_t>(term);
  PriorComponent& component = (*components)[k];
  component.num_residuals += kNumDof[k];
  component.squares.push_back(squared_residual);
}

void FinishPriorComponents(PriorComponents* components) {
  for (int k = 0; k < kNumPriorTerms; ++k) {
    PriorComponent& component = (*components)[k];
    if (component.num_residuals < kMinNumTerms * kNumDof[k]) {
      component = PriorComponent();
    } else {
      component.mean_square = ComputeCappedMean(component.squares, kNumDof[k]);
      component.squares.clear();
    }
  }
}

PriorComponents ComputePriorComponents(
    const PriorSigmaFactors& factors, const std::vector<PosePriorEdge>& priors,
    const colmap::Reconstruction& reconstruction) {
  PriorComponents components;
  for (const PosePriorEdge& edge : priors) {
    const std::optional<TermErrors> errors = ErrorsAt(edge, reconstruction);
    if (!errors) continue;
    for (int k = 0; k < kNumPriorTerms; ++k) {
      const auto term = static_cast<PriorTerm>(k);
      if (!IsTestedMeasurement(edge, term)) continue;
      const double sigma = factors[k] * edge.SigmaOf(term);
      if (!std::isfinite(sigma)) continue;
      AddPriorTerm(term, ((*errors)[k] / sigma).squaredNorm(), &components);
    }
  }
  FinishPriorComponents(&components);
  return components;
}

double LargestMeanSquare(const PriorComponents& components) {
  double largest = 0.0;
  for (const PriorComponent& component : components) {
    largest = std::max(largest, component.mean_square);
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
