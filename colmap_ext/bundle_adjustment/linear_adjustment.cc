// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/linear_adjustment.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"
#include "core/sparse/ordered_cholesky.h"

namespace adasfm {
namespace {

// A share near zero means that only the priors constrain the motions.
constexpr double kMinShare = 0.005;

}  // namespace

struct LinearAdjustment::Factorization : OrderedCholesky {};

LinearAdjustment::LinearAdjustment(ReducedSystem* system,
                                   double prior_loss_scale)
    : system_(*system),
      loss_scale_(prior_loss_scale),
      factorization_(std::make_unique<Factorization>()) {
  factorization_->analyzePattern(system_.rest);
  for (const ReducedPriorRows& rows : system_.priors) {
    residuals_.push_back(rows.residuals);
  }
  weights_.resize(residuals_.size());
  FindChangedValues();
}

LinearAdjustment::~LinearAdjustment() = default;

void LinearAdjustment::ComputeWeights(const PriorSigmaFactors& factors) {
  for (size_t i = 0; i < weights_.size(); ++i) {
    const BundleProblem::PriorBlock& block = system_.priors[i].block;
    weights_[i] =
        block.has_factor ? 1.0 / factors[static_cast<size_t>(block.term)] : 1.0;
    if (!block.is_robust) continue;  // Plain squares.
    const double num_scales = weights_[i] * residuals_[i].norm() / loss_scale_;
    weights_[i] /= block.term == PriorTerm::kVelocity
                       ? std::sqrt(std::max(1.0, num_scales))  // Huber
                       : std::hypot(1.0, num_scales);          // Cauchy
  }
}

template <typename Function>
void LinearAdjustment::ForEachValueOf(size_t i,
                                      const Function& function) const {
  const std::vector<int>& columns = system_.priors[i].columns;
  const int* starts = system_.rest.outerIndexPtr();
  const int* rows = system_.rest.innerIndexPtr();
  for (size_t col = 0; col < columns.size(); ++col) {
    const int* end = rows + starts[columns[col] + 1];
    for (size_t row = 0; row < columns.size(); ++row) {
      if (columns[row] < columns[col]) continue;
      const int* found =
          std::lower_bound(rows + starts[columns[col]], end, columns[row]);
      function(row, col, static_cast<int>(found - rows));
    }
  }
}

void LinearAdjustment::FindChangedValues() {
  for (size_t i = 0; i < weights_.size(); ++i) {
    ForEachValueOf(
        i, [&](size_t, size_t, int value) { changed_.push_back(value); });
  }
  std::sort(changed_.begin(), changed_.end());
  changed_.erase(std::unique(changed_.begin(), changed_.end()), changed_.end());
  changed_.shrink_to_fit();
  for (const int value : changed_) {
    without_priors_.push_back(system_.rest.valuePtr()[value]);
  }
}

bool LinearAdjustment::Factorize() {
  double* values = system_.rest.valuePtr();
  for (size_t i = 0; i < weights_.size(); ++i) {
    const Eigen::MatrixXd jacobian = weights_[i] * system_.priors[i].jacobian;
    const Eigen::MatrixXd information = jacobian.transpose() * jacobian;
    ForEachValueOf(i, [&](size_t row, size_t col, int value) {
      values[value] += information(row, col);
    });
  }
  factorization_->factorize(system_.rest);
  for (size_t k = 0; k < changed_.size(); ++k) {
    values[changed_[k]] = without_priors_[k];
  }
  return factorization_->info() == Eigen::Success;
}

Eigen::VectorXd LinearAdjustment::ToColumns(const RowValues& values) const {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(system_.rest.rows());
  for (size_t i = 0; i < values.size(); ++i) {
    const ReducedPriorRows& rows = system_.priors[i];
    const Eigen::VectorXd part =
        weights_[i] * (rows.jacobian.transpose() * values[i]);
    for (size_t k = 0; k < rows.columns.size(); ++k) {
      sum[rows.columns[k]] += part[k];
    }
  }
  return sum;
}

LinearAdjustment::RowValues LinearAdjustment::SolveForRows(
    const Eigen::VectorXd& right_hand_side) const {
  const Eigen::VectorXd step = factorization_->solve(right_hand_side);
  RowValues values;
  for (size_t i = 0; i < weights_.size(); ++i) {
    const ReducedPriorRows& rows = system_.priors[i];
    Eigen::VectorXd of_columns(rows.columns.size());
    for (size_t k = 0; k < rows.columns.size(); ++k) {
      of_columns[k] = step[rows.columns[k]];
    }
    values.push_back(weights_[i] * (rows.jacobian * of_columns));
  }
  return values;
}

double LinearAdjustment::UnitVariance() const {
  if (system_.unit_column < 0) return 0.0;
  const Eigen::VectorXd unit =
      Eigen::VectorXd::Unit(system_.rest.rows(), system_.unit_column);
  return factorization_->solve(unit)[system_.unit_column];
}

bool LinearAdjustment::Solve(const PriorSigmaFactors& factors,
                             PriorComponents* components) {
  ComputeWeights(factors);
  if (!Factorize()) return false;
  RowValues whitened;
  for (size_t i = 0; i < weights_.size(); ++i) {
    whitened.push_back(weights_[i] * system_.priors[i].residuals);
  }
  const RowValues moved =
      SolveForRows(-system_.rest_gradient - ToColumns(whitened));
  *components = PriorComponents();
  for (size_t i = 0; i < weights_.size(); ++i) {
    const ReducedPriorRows& rows = system_.priors[i];
    residuals_[i] = rows.residuals + moved[i] / weights_[i];
    if (!rows.block.is_tested) continue;
    const double factor = factors[static_cast<size_t>(rows.block.term)];
    AddPriorTerm(rows.block.term, (residuals_[i] / factor).squaredNorm(),
                 components);
  }
  FinishPriorComponents(components);
  EstimateRedundancies(components);
  return true;
}

void LinearAdjustment::EstimateRedundancies(PriorComponents* components) const {
  std::array<double, kNumPriorTerms> redundancies = {}, own = {}, squares = {};
  Random random(1);
  for (int probe = 0; probe < kNumProbes; ++probe) {
    RowValues signs;
    for (size_t i = 0; i < weights_.size(); ++i) {
      signs.push_back(Eigen::VectorXd::Zero(residuals_[i].size()));
      if (!system_.priors[i].block.is_tested) continue;
      for (double& sign : signs.back()) {
        sign = random.UniformInt(0, 1) ? 1.0 : -1.0;
      }
    }
    const RowValues followed = SolveForRows(ToColumns(signs));
    for (size_t i = 0; i < weights_.size(); ++i) {
      const BundleProblem::PriorBlock& block = system_.priors[i].block;
      if (!block.is_tested) continue;
      const auto k = static_cast<size_t>(block.term);
      const Eigen::VectorXd left = signs[i] - followed[i];
      redundancies[k] += signs[i].dot(left);
      own[k] += left.squaredNorm();
      squares[k] += signs[i].squaredNorm();
    }
  }
  for (int k = 0; k < kNumPriorTerms; ++k) {
    if (squares[k] == 0.0) continue;
    PriorComponent& component = (*components)[k];
    component.redundancy_share =
        std::clamp(redundancies[k] / squares[k], kMinShare, 1.0);
    component.own_share =
        std::clamp(own[k] / squares[k], kMinShare, component.redundancy_share);
  }
}

}  // namespace adasfm
