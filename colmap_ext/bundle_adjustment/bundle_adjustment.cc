// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/bundle_adjustment/bundle_adjustment.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "colmap_ext/bundle_adjustment/block_ordering.h"
#include "colmap_ext/bundle_adjustment/bundle_problem.h"
#include "colmap_ext/bundle_adjustment/inertial_factors.h"
#include "colmap_ext/bundle_adjustment/minimize_bundle.h"
#include "colmap_ext/bundle_adjustment/position_priors.h"
#include "colmap_ext/bundle_adjustment/reduced_system.h"
#include "colmap_ext/scene/covisibility.h"
#include "core/median.h"
#include "core/option_checker.h"
#include "core/parallel.h"
#include "core/release_memory.h"
#include "core/stopwatch.h"

namespace adasfm {
namespace {

// The length of a scale that nothing measures is held to this share of itself;
// no residual pulls against it, so the value is not a weight.
constexpr double kGaugeLengthRatio = 1e-3;
// The chain's length and bends are soft: the damping that Ceres begins with
// (radius 1e4) would let them go a little at each of many steps, and an
// adjustment end before they are where they belong.
constexpr double kInitialTrustRegionRadius = 1e10;
// Of priors: beyond, a direction is nearly any; below, there is no motion.
constexpr double kMaxDirectionSigmaRad = 0.5;
constexpr double kMinLengthM = 1e-9;
// Problems with fewer residuals are solved faster by one thread.
constexpr int kMinNumResidualsForThreads = 20000;
// Beyond so many blocks (1.2 GB) of the factor a point is one for each group of
// its images of which any two share three points: of 30,000 images 12 to 37 %
// of the pairs that see points together share fewer, which tell little of each
// other, but take much of the memory (docs/reference/math.md). Where memory is
// bounded they must share more, in steps of two, up to the last number.
constexpr size_t kMaxNumBlocksWhole = 4000000;
constexpr int kMinNumSharedPoints = 3;
constexpr int kMaxMinNumSharedPoints = 48;
// Measured on 30,000 images: a block of the equations, with the rows of its
// numbers, one of their factor, and an observation with its part of its point.
constexpr double kBytesPerBlock = 440.0;
constexpr double kBytesPerFactorBlock = 380.0;
constexpr double kBytesPerObservation = 100.0;

bool HasMeasuredLengths(const std::vector<PosePriorEdge>& priors) {
  return std::any_of(priors.begin(), priors.end(), [](const auto& edge) {
    return edge.is_length_measured && std::isfinite(edge.length_sigma_m);
  });
}

// Holds the degrees of freedom that the data leave open (see AdjustBundle).
void FixGauge(bool has_lengths, BundleProblem* problem) {
  const std::vector<image_t> constant_images = problem->ConstantImages();
  if (constant_images.empty()) problem->FixFirstPose();
  if (has_lengths || constant_images.size() >= 2) return;
  problem->FixDistanceToFarthestPose(kGaugeLengthRatio);
}

// Numbers the windows of one of the shared errors.
void AssignWindows(double window_s, int SharedErrorWindows::*number,
                   std::vector<PosePriorEdge>* edges) {
  int window = -1;
  double elapsed_s = 0.0;
  image_t last_image = kInvalidImageId;
  for (PosePriorEdge& edge : *edges) {
    if (edge.dt_s < 0.0) continue;
    if (window < 0 || edge.image_id1 != last_image || elapsed_s > window_s) {
      ++window;
      elapsed_s = 0.0;
    }
    edge.windows.*number = window;
    elapsed_s += edge.dt_s;
    last_image = edge.image_id2;
  }
}

// Once for the windows of each error, and what drifts in them.
void AssignWindows(const SharedErrorOptions& options,
                   std::vector<PosePriorEdge>* edges) {
  AssignWindows(options.gyroscope_window_s, &SharedErrorWindows::gyroscope,
                edges);
  AssignWindows(options.direction_window_s, &SharedErrorWindows::direction,
                edges);
  const double direction_sigma_rad = MedianDirectionSigma(*edges);
  if (!(direction_sigma_rad > 0.0)) return;
  for (PosePriorEdge& edge : *edges) {
    edge.windows.length_per_direction =
        options.length_drift_ratio / direction_sigma_rad;
  }
}

// The reduced camera system. Priors tie images of one drive that see points
// together anyway.
struct SystemSize {
  explicit SystemSize(const Covisibility& covisibility)
      : num_factor_blocks(
            FindBlockOrdering(covisibility.Neighbors()).num_factor_blocks) {
    for (const std::vector<int>& neighbors : covisibility.Neighbors()) {
      num_blocks += 1 + neighbors.size();
    }
  }

  double Bytes() const {
    return kBytesPerBlock * num_blocks +
           kBytesPerFactorBlock * num_factor_blocks;
  }

  size_t num_blocks = 0;
  size_t num_factor_blocks = 0;
};

// How it is solved.
struct FactorPlan {
  // Whether its factor is no larger than that of max_num_images_sparse images
  // that all see each other. Drives, nearly banded, stay far below.
  bool is_small = true;
  // Where points must be cut for it.
  std::optional<Covisibility> cut;
};

// What the points leave of the memory that the process may take.
double MaxSystemBytes(double max_memory_gb, const std::set<image_t>& images,
                      const colmap::Reconstruction& reconstruction) {
  if (max_memory_gb < 0.0) return std::numeric_limits<double>::infinity();
  ReleaseFreedMemory();
  double num_observations = 0.0;
  for (const image_t image_id : images) {
    num_observations += reconstruction.Image(image_id).NumPoints3D();
  }
  return 1e9 * max_memory_gb - ResidentMemoryBytes() -
         kBytesPerObservation * num_observations;
}

FactorPlan PlanFactor(const PriorBundleAdjustmentOptions& options,
                      const std::set<image_t>& images,
                      const colmap::Reconstruction& reconstruction) {
  FactorPlan plan;
  const size_t max_num_images = options.max_num_images_sparse;
  if (images.size() <= max_num_images && options.max_memory_gb < 0.0) {
    return plan;
  }
  const double max_bytes =
      MaxSystemBytes(options.max_memory_gb, images, reconstruction);
  SystemSize size(Covisibility(images, reconstruction));
  if (size.num_factor_blocks > kMaxNumBlocksWhole || size.Bytes() > max_bytes) {
    for (int min_num_shared = kMinNumSharedPoints;; min_num_shared *= 2) {
      plan.cut.emplace(images, reconstruction, min_num_shared);
      size = SystemSize(*plan.cut);
      if (size.Bytes() <= max_bytes) break;
      if (min_num_shared >= kMaxMinNumSharedPoints) break;
    }
  }
  plan.is_small =
      size.num_factor_blocks <= max_num_images * (max_num_images - 1) / 2;
  return plan;
}

int NumThreads(const PriorBundleAdjustmentOptions& options,
               const BundleProblem& problem) {
  return problem.NumResiduals() < kMinNumResidualsForThreads
             ? 1
             : EffectiveNumThreads(options.num_threads);
}

ceres::Solver::Options SolverOptions(
    const PriorBundleAdjustmentOptions& options, bool has_small_factor,
    BundleProblem* problem) {
  ceres::Solver::Options solver;
  solver.max_num_iterations = options.max_num_iterations;
  solver.function_tolerance = options.function_tolerance;
  solver.initial_trust_region_radius = kInitialTrustRegionRadius;
  // The cost alone decides: gradients and steps have no common unit here.
  solver.gradient_tolerance = 1e-12;
  solver.parameter_tolerance = 1e-12;
  solver.logging_type = ceres::SILENT;
  solver.num_threads = NumThreads(options, *problem);
  solver.max_linear_solver_iterations = 200;
  solver.max_num_consecutive_invalid_steps = 10;
  const int num_images = problem->NumImages();
  const bool has_points = problem->NumPoints() > 0;
  if (num_images <= options.max_num_images_dense && has_points) {
    solver.linear_solver_type = ceres::DENSE_SCHUR;
  } else if (!has_points) {
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  } else if (has_small_factor) {
    solver.linear_solver_type = ceres::SPARSE_SCHUR;
  } else {
    solver.linear_solver_type = ceres::ITERATIVE_SCHUR;
    solver.preconditioner_type = ceres::SCHUR_JACOBI;
  }
  if (has_points) solver.linear_solver_ordering = problem->Ordering();
  return solver;
}

// Sets what a solver has to say, and whether its parameters may be used.
void SolveWithCeres(const PriorBundleAdjustmentOptions& options,
                    bool has_small_factor, BundleProblem* bundle,
                    PriorBundleAdjustmentSummary* summary) {
  ceres::Solver::Summary solver_summary;
  ceres::Solve(SolverOptions(options, has_small_factor, bundle),
               bundle->CeresProblem(), &solver_summary);
  summary->num_iterations = solver_summary.num_successful_steps +
                            solver_summary.num_unsuccessful_steps;
  summary->initial_cost = solver_summary.initial_cost;
  summary->final_cost = solver_summary.final_cost;
  summary->message = solver_summary.message;
  summary->success = solver_summary.IsSolutionUsable();
}

void SolveByPoints(const PriorBundleAdjustmentOptions& options,
                   BundleProblem* bundle,
                   PriorBundleAdjustmentSummary* summary) {
  MinimizeBundleOptions minimize;
  minimize.max_num_iterations = options.max_num_iterations;
  minimize.function_tolerance = options.function_tolerance;
  minimize.initial_radius = kInitialTrustRegionRadius;
  minimize.num_threads = NumThreads(options, *bundle);
  const MinimizeBundleSummary minimized = MinimizeBundle(minimize, bundle);
  summary->num_iterations = minimized.num_iterations;
  summary->initial_cost = minimized.initial_cost;
  summary->final_cost = minimized.final_cost;
  summary->message = minimized.message;
  summary->success = minimized.success;
}

}  // namespace

PosePriorEdge PosePriorEdgeFromPrior(const RelativePosePrior& prior) {
  PosePriorEdge edge;
  edge.image_id1 = prior.image_id1;
  edge.image_id2 = prior.image_id2;
  edge.cam2_from_cam1 = prior.cam2_from_cam1;
  // Within a frame of a rig no time passes, and no log measured the motion.
  if (prior.dt_ns > 0) edge.dt_s = SecondsFromNs(prior.dt_ns);
  const auto sigma_or_infinity = [](double variance) {
    return std::isfinite(variance) && variance > 0.0
               ? std::sqrt(variance)
               : std::numeric_limits<double>::infinity();
  };
  if (prior.HasRotation()) {
    edge.rotation_sigma_rad =
        sigma_or_infinity(prior.covariance.topLeftCorner<3, 3>().trace() / 3.0);
  }
  const Eigen::Vector3d& translation = prior.cam2_from_cam1.translation;
  const double length = std::max(kMinLengthM, translation.norm());
  if (!std::isfinite(length)) return edge;
  const Eigen::Matrix3d covariance = prior.covariance.bottomRightCorner<3, 3>();
  const Eigen::Vector3d direction = translation / length;
  const double variance_along = direction.dot(covariance * direction);
  const double variance_across = (covariance.trace() - variance_along) / 2.0;
  // What the accelerometer tells of the unit is given back to the adjusted
  // model as a whole (KeepInertialUnit); but across a gap it is a measurement.
  if (prior.HasOwnLength()) {
    edge.length_sigma_m = sigma_or_infinity(variance_along);
  }
  if (prior.HasDirection()) {
    edge.direction_sigma_rad = sigma_or_infinity(variance_across) / length;
  }
  // A motion that drowns in its own noise has no direction.
  if (edge.direction_sigma_rad > kMaxDirectionSigmaRad) {
    edge.direction_sigma_rad = std::numeric_limits<double>::infinity();
    if (prior.HasTranslation()) {
      edge.translation_sigma_m = sigma_or_infinity(covariance.trace() / 3.0);
      edge.length_sigma_m = std::numeric_limits<double>::infinity();
    }
  }
  return edge;
}

double MedianDirectionSigma(const std::vector<PosePriorEdge>& edges) {
  std::vector<double> sigmas;
  for (const PosePriorEdge& edge : edges) {
    if (edge.dt_s >= 0.0 && std::isfinite(edge.direction_sigma_rad)) {
      sigmas.push_back(edge.direction_sigma_rad);
    }
  }
  return UpperMedian(&sigmas);
}

bool PriorBundleAdjustmentOptions::IsValid(std::string* error) const {
  return OptionChecker(error)
             .Positive({{"keypoint_sigma_px", keypoint_sigma_px},
                        {"prior_loss_scale", prior_loss_scale},
                        {"position_loss_scale", position_loss_scale}})
             .Require(std::isfinite(reproj_loss_scale_px),
                      "reproj_loss_scale_px", reproj_loss_scale_px,
                      "must be finite")
             .AtLeast(1, "max_num_iterations", max_num_iterations)
             .PositiveOrMinusOne("max_memory_gb", max_memory_gb)
             .NotNegative({{"function_tolerance", function_tolerance},
                           {"accelerometer_noise", accelerometer_noise}})
             .AtLeast(max_num_images_dense, "max_num_images_sparse",
                      max_num_images_sparse)
             .AllHold() &&
         shared_errors.IsValid(error);
}

PriorBundleAdjustmentSummary AdjustBundle(
    const PriorBundleAdjustmentOptions& options,
    const PriorBundleAdjustmentProblem& problem,
    colmap::Reconstruction* reconstruction,
    std::unique_ptr<ReducedSystem>* system) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);

  PriorBundleAdjustmentSummary summary;
  summary.keypoint_sigma_px = options.keypoint_sigma_px;
  summary.keypoint_sigma_ratios = options.keypoint_sigma_ratios;
  summary.prior_sigma_factors = options.prior_sigma_factors;
  PriorBundleAdjustmentProblem with_windows = problem;
  AssignWindows(options.shared_errors, &with_windows.priors);
  FactorPlan plan = PlanFactor(options, problem.images, *reconstruction);
  BundleProblem bundle(options, with_windows, *reconstruction,
                       /*may_keep_points_apart=*/plan.is_small,
                       plan.cut ? &*plan.cut : nullptr);
  plan.cut.reset();
  const InertialTerms inertial =
      AddInertialFactors(options, problem.inertial_motions, &bundle);
  summary.accelerometer_noise = inertial.noise;
  summary.num_images = bundle.NumImages();
  summary.num_points = bundle.NumPoints();
  summary.num_residuals = bundle.NumResiduals();
  if (bundle.NumImages() == 0 || bundle.NumResiduals() == 0) {
    summary.message = "nothing to adjust";
    return summary;
  }
  if (AddPositionPriors(options.position_loss_scale, problem, &bundle) <
      kMinNumPositionsForGauge) {
    FixGauge(HasMeasuredLengths(problem.priors), &bundle);
  }

  const Stopwatch watch;
  if (bundle.NumPointsApart() > 0) {
    SolveByPoints(options, &bundle, &summary);
  } else {
    SolveWithCeres(options, plan.is_small, &bundle, &summary);
  }
  summary.seconds = watch.Seconds();
  summary.success =
      summary.success && std::isfinite(summary.final_cost) && bundle.IsFinite();
  if (summary.success) {
    bundle.UpdatePoses();  // The last step may have been taken back.
    bundle.WriteTo(reconstruction);
    summary.shared_errors = bundle.EstimatedSharedErrors();
    if (system != nullptr) *system = BuildReducedSystem(&bundle, inertial.unit);
  }
  return summary;
}

std::vector<PosePriorEdge> CorrectSharedErrors(
    const SharedErrorOptions& options, const SharedErrors& shared_errors,
    std::vector<PosePriorEdge> priors) {
  AssignWindows(options, &priors);
  for (PosePriorEdge& edge : priors) {
    if (edge.dt_s < 0.0) continue;
    edge.cam2_from_cam1 =
        shared_errors.Correct(edge.cam2_from_cam1, edge.dt_s, edge.windows);
  }
  return priors;
}

}  // namespace adasfm
