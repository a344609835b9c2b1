// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/verdict.h"

#include <algorithm>
#include <iomanip>
#include <set>
#include <sstream>
#include <utility>

#include "colmap_ext/mapper_stage/verdict_report.h"
#include "core/median.h"
#include "core/prior_lengths.h"

namespace adasfm {
namespace {

// With half of the images lost it is no model of the scene any more.
constexpr double kMinShareOfImages = 0.5;
constexpr double kGoodShareOfImages = 0.95;
// Images without points, as in a tunnel, rest on the priors alone.
constexpr double kMinShareHeld = 0.25;
constexpr double kGoodShareHeld = 0.85;
// Where most verified matches contradict the poses, one of both is wrong.
constexpr double kMinShareOfMatchedHeld = 0.5;
constexpr double kGoodShareOfMatchedHeld = 0.9;
// Correct priors have 1 or less; twice the sigma gives 4.
constexpr double kGoodChi2Ratio = 2.0;
constexpr double kGoodShareContradicting = 0.05;
constexpr double kMaxShareContradicting = 0.5;
// Radial error that keypoints share, over their sigma: wrong camera models gave
// 0.3 to 0.6 on drives with turns, calibrations of real cameras at most 0.2.
constexpr double kGoodLensErrorRatio = 0.25;
// Keypoint sigma that agrees with the priors over that of the residuals.
constexpr double kGoodSigmaFactor = 4.0;
// Share of the registered images.
constexpr double kGoodShareReset = 0.02;
// Fewer priors are no statistic.
constexpr int kMinPriors = 10;

std::string Number(double value, int digits) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << value;
  return text.str();
}

void CountImages(const std::vector<AssessedModel>& models,
                 const SceneData& rest, Verdict* verdict) {
  std::vector<double> counts;
  verdict->num_database_images = static_cast<int>(rest.images.size());
  for (const AssessedModel& model : models) {
    for (const image_t image_id : model.model->RegImageIds()) {
      counts.push_back(model.model->Image(image_id).NumPoints3D());
      verdict->num_images_held_by_points +=
          IsHeldByPoints(*model.model, image_id);
    }
    verdict->num_database_images += static_cast<int>(model.data->images.size());
    verdict->num_points += static_cast<int>(model.model->NumPoints3D());
  }
  verdict->num_images = static_cast<int>(counts.size());
  verdict->median_points_per_image = UpperMedian(&counts);
}

// Collects reasons; the worst result counts.
class Judge {
 public:
  void Decide(Verdict* verdict) const {
    verdict->result = !failures_.empty() ? VerdictResult::kFailed
                      : !doubts_.empty() ? VerdictResult::kDoubtful
                                         : VerdictResult::kGood;
    verdict->reasons = failures_;
    verdict->reasons.insert(verdict->reasons.end(), doubts_.begin(),
                            doubts_.end());
  }
  void Fail(const std::string& reason) { failures_.push_back(reason); }
  void Doubt(const std::string& reason) { doubts_.push_back(reason); }
  // Fails or doubts by two limits; larger is better.
  void Limit(double value, double failed_below, double good_from,
             const std::string& reason) {
    if (value < failed_below) {
      Fail(reason);
    } else if (value < good_from) {
      Doubt(reason);
    }
  }

 private:
  std::vector<std::string> failures_;
  std::vector<std::string> doubts_;
};

std::set<image_t> FindMatchedImages(const SceneData& data) {
  std::set<image_t> matched;
  for (const ScenePair& pair : data.pairs) {
    if (pair.inlier_matches.empty()) continue;
    matched.insert(pair.image_id1);
    matched.insert(pair.image_id2);
  }
  return matched;
}

// Images with verified matches must also see points, unlike those in the dark.
// The reason states how many do not.
void JudgeMatchedImages(const std::vector<AssessedModel>& models,
                        const SceneData& rest, Judge* judge) {
  int num_matched = static_cast<int>(FindMatchedImages(rest).size());
  int num_held = 0;
  for (const AssessedModel& model : models) {
    const std::set<image_t> matched = FindMatchedImages(*model.data);
    num_matched += static_cast<int>(matched.size());
    num_held += static_cast<int>(
        std::count_if(matched.begin(), matched.end(), [&](image_t image_id) {
          return IsHeldByPoints(*model.model, image_id);
        }));
  }
  judge->Limit(1.0 * num_held / std::max(1, num_matched),
               kMinShareOfMatchedHeld, kGoodShareOfMatchedHeld,
               std::to_string(num_matched - num_held) + " of " +
                   std::to_string(num_matched) +
                   " images with verified matches are lost or see too few "
                   "points");
}

void JudgeImages(const Verdict& verdict, Judge* judge) {
  const double share =
      1.0 * verdict.num_images / std::max(1, verdict.num_database_images);
  judge->Limit(
      share, kMinShareOfImages, kGoodShareOfImages,
      std::to_string(verdict.num_database_images - verdict.num_images) +
          " of " + std::to_string(verdict.num_database_images) +
          " images are lost");
  if (verdict.num_points == 0) {
    judge->Fail("the model has no points: its poses are the sensors' alone");
    return;
  }
  const double held =
      1.0 * verdict.num_images_held_by_points / std::max(1, verdict.num_images);
  judge->Limit(
      held, kMinShareHeld, kGoodShareHeld,
      std::to_string(verdict.num_images - verdict.num_images_held_by_points) +
          " of " + std::to_string(verdict.num_images) +
          " images see too few points: their poses are the sensors'");
}

void CollectLensErrors(const std::vector<AssessedModel>& models,
                       Verdict* verdict) {
  for (const AssessedModel& model : models) {
    for (const auto& [camera_id, error] : MeasureLensErrors(*model.model)) {
      LensError& largest = verdict->lens_errors[camera_id];
      if (error.ratio >= largest.ratio) largest = error;
    }
  }
}

void JudgeLenses(const Verdict& verdict, Judge* judge) {
  for (const auto& [camera_id, error] : verdict.lens_errors) {
    if (error.ratio <= kGoodLensErrorRatio) continue;
    judge->Doubt("the lens model of camera " + std::to_string(camera_id) +
                 " does not fit (systematic radial residuals of " +
                 Number(error.rms_px, 2) +
                 " px; check camera model and distortion)");
  }
}

void JudgePriors(const Verdict& verdict, Judge* judge) {
  for (const PriorAgreement& priors : verdict.priors) {
    if (priors.num_priors < kMinPriors) continue;
    const std::string reason =
        "vision and the sensors' " + priors.kind + "s contradict each other (" +
        FormatShare(priors.share_contradicting) + " of " +
        std::to_string(priors.num_priors) + ", typical squared residual " +
        Number(priors.chi2_ratio, 1) + " times the expected one)";
    // Wrong lengths alone, as of wheels that slip all the time, do not change
    // the shape that vision gives, unless the keypoint sigma was raised for
    // them.
    const bool bends_model = priors.kind == "rotation" ||
                             verdict.keypoint_sigma_factor >= kGoodSigmaFactor;
    if (bends_model && priors.share_contradicting > kMaxShareContradicting) {
      judge->Fail(reason);
    } else if (priors.share_contradicting > kGoodShareContradicting ||
               priors.chi2_ratio > kGoodChi2Ratio) {
      judge->Doubt(reason);
    }
  }
  if (!verdict.priors.empty() &&
      verdict.keypoint_sigma_factor >= kGoodSigmaFactor) {
    judge->Doubt("the keypoint sigma had to be raised to " +
                 Number(verdict.keypoint_sigma_px, 1) +
                 " px for vision to agree with the sensors");
  }
}

// `name` identifies the model among several; empty for a single one.
void JudgeStage(const std::string& name, const MapperStageSummary& summary,
                int num_images, Judge* judge) {
  if (summary.started_from_coarse_poses) {
    judge->Doubt(name +
                 "the merged parts violated priors of the sensors; the "
                 "model was refined from the coarse poses instead");
  }
  if (summary.refine.num_images_reset > kGoodShareReset * num_images) {
    judge->Doubt(name + std::to_string(summary.refine.num_images_reset) +
                 " images contradicted the sensors and were reset to their "
                 "coarse poses");
  }
  int num_lost_parts = 0;
  for (size_t k = 0; k < summary.parts.size(); ++k) {
    const bool is_merged = k < summary.aligned.alignments.size() &&
                           summary.aligned.alignments[k].success;
    if (!summary.parts[k].failure.empty() || !is_merged) ++num_lost_parts;
  }
  if (num_lost_parts > 0) {
    judge->Doubt(name + std::to_string(num_lost_parts) + " of " +
                 std::to_string(summary.parts.size()) +
                 " parts failed or did not fit the coarse model");
  }
}

// Judges each model by itself: a large sound one must not hide a wrong one.
void JudgeEachModel(const std::vector<AssessedModel>& models, int num_images,
                    Judge* judge) {
  int num_sound_images = num_images;
  std::string reason;
  for (size_t k = 0; k < models.size(); ++k) {
    const AssessedModel& model = models[k];
    const Verdict verdict =
        AssessModel(*model.data, *model.summary, {}, *model.model);
    if (verdict.result != VerdictResult::kFailed) continue;
    num_sound_images -= verdict.num_images;
    reason += std::string(reason.empty() ? "" : "; ") + "model " +
              std::to_string(k) + " of " + std::to_string(verdict.num_images) +
              " images failed: " + verdict.reasons.front();
  }
  if (reason.empty()) return;
  const double share = 1.0 * num_sound_images / std::max(1, num_images);
  if (share < kMinShareOfImages) {
    judge->Fail(reason);
  } else {
    judge->Doubt(reason);
  }
}

std::string MetricSource(const std::vector<AssessedModel>& models) {
  bool has_wheels = false;
  bool has_accelerometer = false;
  bool has_rig = false;
  bool is_georeferenced = false;
  for (const AssessedModel& model : models) {
    is_georeferenced |= model.summary->is_georeferenced;
    if (!model.summary->has_metric_sensors) continue;
    const bool is_by_wheels = HasMeasuredLengths(model.data->priors);
    has_wheels |= is_by_wheels;
    has_accelerometer |=
        !is_by_wheels && model.data->inertial_scale_sigma > 0.0;
    has_rig |= HasLengths(model.data->frame_priors);
  }
  std::string source;
  const auto add = [&source](bool has, const char* name) {
    if (has) source += (source.empty() ? "" : " and ") + std::string(name);
  };
  add(has_wheels, "wheels");
  add(has_accelerometer, "the accelerometer");
  add(has_rig, "the rig");
  add(is_georeferenced, "positions");
  return source;
}

void CollectFigures(const std::vector<AssessedModel>& models,
                    Verdict* verdict) {
  verdict->num_models = static_cast<int>(models.size());
  double sum_px = 0.0;
  for (const AssessedModel& model : models) {
    const MapperStageSummary& summary = *model.summary;
    verdict->num_metric_models += summary.is_metric;
    sum_px += summary.mean_reproj_error_px * model.model->NumPoints3D();
    if (summary.refine.keypoint_sigma_factor <=
            verdict->keypoint_sigma_factor &&
        verdict->keypoint_sigma_px > 0.0) {
      continue;
    }
    verdict->keypoint_sigma_px = summary.refine.keypoint_sigma_px;
    verdict->keypoint_sigma_factor = summary.refine.keypoint_sigma_factor;
  }
  verdict->is_metric = verdict->num_metric_models == verdict->num_models;
  verdict->metric_source = MetricSource(models);
  for (const AssessedModel& model : models) {
    const double sigma = model.summary->scale_sigma;
    if (sigma > verdict->metric_sigma.value_or(0.0)) {
      verdict->metric_sigma = sigma;
    }
  }
  if (verdict->num_points > 0) {
    verdict->mean_reproj_error_px = sum_px / verdict->num_points;
  }
}

}  // namespace

Verdict AssessModels(const std::vector<AssessedModel>& models,
                     const SceneData& rest,
                     const std::vector<std::string>& warnings) {
  Verdict verdict;
  CountImages(models, rest, &verdict);
  CollectFigures(models, &verdict);
  PriorResiduals residuals;
  for (const AssessedModel& model : models) {
    AddPriorResiduals(*model.data, *model.model,
                      model.summary->size_over_priors, &residuals);
  }
  verdict.priors = SummarizeAgreement(std::move(residuals));
  CollectLensErrors(models, &verdict);
  Judge judge;
  JudgeImages(verdict, &judge);
  JudgeMatchedImages(models, rest, &judge);
  JudgeLenses(verdict, &judge);
  JudgePriors(verdict, &judge);
  if (models.size() > 1) JudgeEachModel(models, verdict.num_images, &judge);
  bool know_lengths = false;
  for (size_t k = 0; k < models.size(); ++k) {
    JudgeStage(models.size() == 1 ? "" : "model " + std::to_string(k) + ": ",
               *models[k].summary,
               static_cast<int>(models[k].model->NumRegImages()), &judge);
    know_lengths = know_lengths || HasMeasuredLengths(models[k].data->priors) ||
                   HasLengths(models[k].data->frame_priors);
  }
  for (const std::string& warning : warnings) {
    judge.Doubt("an earlier step warned: " + warning);
  }
  // An IMU alone measures none: that is no reason for doubt.
  if (!verdict.is_metric && know_lengths) {
    judge.Doubt("lengths " +
                FormatOfModels(verdict.num_models - verdict.num_metric_models,
                               verdict.num_models) +
                "are in no unit, though sensors measure some");
  }
  judge.Decide(&verdict);
  return verdict;
}

Verdict AssessModel(const SceneData& data, const MapperStageSummary& summary,
                    const std::vector<std::string>& warnings,
                    const colmap::Reconstruction& model) {
  return AssessModels({{&data, &summary, &model}}, {}, warnings);
}

}  // namespace adasfm
