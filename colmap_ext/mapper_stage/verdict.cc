// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/verdict.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "colmap_ext/host/pose_conversion.h"
#include "core/median.h"
#include "core/prior_lengths.h"
#include "core/so3.h"

namespace adasfm {
namespace {

// Fewer do not fix six degrees of freedom against a few wrong ones.
constexpr int kMinPointsOfImage = 15;
// Half the images lost is no model of the scene any more.
constexpr double kMinShareOfImages = 0.5;
constexpr double kGoodShareOfImages = 0.95;
// Images between points, as in a tunnel, hang on the priors alone.
constexpr double kMinShareHeld = 0.25;
constexpr double kGoodShareHeld = 0.85;
// Verified matches and poses that most of them contradict: one is wrong.
constexpr double kMinShareOfMatchedHeld = 0.5;
constexpr double kGoodShareOfMatchedHeld = 0.9;
// Quantiles of chi-square with three degrees of freedom: 50 % and 99.9 %.
constexpr double kMedianChi2 = 2.366;
constexpr double kLargeChi2 = 16.27;
// An honest prior has 1 or less; twice the sigma gives 4.
constexpr double kGoodChi2Ratio = 2.0;
constexpr double kGoodShareContradicting = 0.05;
constexpr double kMaxShareContradicting = 0.5;
// Of the keypoint sigma that fits the priors, over that of the residuals.
constexpr double kGoodSigmaFactor = 4.0;
// Of the registered images.
constexpr double kGoodSharePutBack = 0.02;
// Below it a mean tells little.
constexpr int kMinPriors = 10;

std::string Percent(double share) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(share > 0.0 && share < 0.1 ? 1 : 0)
       << 100.0 * share << " %";
  return text.str();
}

std::string Number(double value, int digits) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << value;
  return text.str();
}

bool IsHeld(const colmap::Reconstruction& model, image_t image_id) {
  return model.ExistsImage(image_id) && model.IsImageRegistered(image_id) &&
         static_cast<int>(model.Image(image_id).NumPoints3D()) >=
             kMinPointsOfImage;
}

// Of the residual by its covariance; negative when that is not one.
double Chi2(const Eigen::Vector3d& residual,
            const Eigen::Matrix3d& covariance) {
  const Eigen::LLT<Eigen::Matrix3d> llt(covariance);
  if (!covariance.allFinite() || llt.info() != Eigen::Success) return -1.0;
  return residual.dot(llt.solve(residual));
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

// Squared whitened residuals.
struct PriorResiduals {
  std::vector<double> rotations;
  std::vector<double> translations;
};

void CollectResiduals(const SceneData& data,
                      const colmap::Reconstruction& model,
                      PriorResiduals* residuals) {
  for (const RelativePosePrior& prior : data.priors) {
    if (!IsHeld(model, prior.image_id1) || !IsHeld(model, prior.image_id2)) {
      continue;
    }
    const Rigid3d motion = CamFromWorld(model.Image(prior.image_id2)) *
                           CamFromWorld(model.Image(prior.image_id1)).Inverse();
    if (prior.HasRotation()) {
      const double chi2 = Chi2(
          LogSo3(motion.rotation * prior.cam2_from_cam1.rotation.conjugate()),
          prior.covariance.topLeftCorner<3, 3>());
      if (chi2 >= 0.0) residuals->rotations.push_back(chi2);
    }
    if (prior.HasDirection() && prior.HasLength()) {
      const double chi2 =
          Chi2(motion.translation - prior.cam2_from_cam1.translation,
               prior.covariance.bottomRightCorner<3, 3>());
      if (chi2 >= 0.0) residuals->translations.push_back(chi2);
    }
  }
}

std::vector<PriorAgreement> ComparePriors(
    const std::vector<AssessedModel>& models) {
  PriorResiduals residuals;
  for (const AssessedModel& model : models) {
    CollectResiduals(*model.data, *model.model, &residuals);
  }
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

void CountImages(const std::vector<AssessedModel>& models,
                 const SceneData& rest, Verdict* verdict) {
  std::vector<double> counts;
  verdict->num_database_images = static_cast<int>(rest.images.size());
  for (const AssessedModel& model : models) {
    for (const image_t image_id : model.model->RegImageIds()) {
      counts.push_back(model.model->Image(image_id).NumPoints3D());
      if (counts.back() >= kMinPointsOfImage) {
        ++verdict->num_images_held_by_points;
      }
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

// Images that have verified matches must have points too, unlike those in the
// dark. The reason names how many have not.
void JudgeMatchedImages(const std::vector<AssessedModel>& models,
                        const SceneData& rest, Judge* judge) {
  int num_matched = static_cast<int>(FindMatchedImages(rest).size());
  int num_held = 0;
  for (const AssessedModel& model : models) {
    const std::set<image_t> matched = FindMatchedImages(*model.data);
    num_matched += static_cast<int>(matched.size());
    num_held += static_cast<int>(std::count_if(
        matched.begin(), matched.end(),
        [&](image_t image_id) { return IsHeld(*model.model, image_id); }));
  }
  judge->Limit(1.0 * num_held / std::max(1, num_matched),
               kMinShareOfMatchedHeld, kGoodShareOfMatchedHeld,
               std::to_string(num_matched - num_held) + " of " +
                   std::to_string(num_matched) +
                   " images with verified matches have no place that their "
                   "matches agree with");
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
    judge->Fail("the model has no points: nothing but the sensors holds it");
    return;
  }
  const double held =
      1.0 * verdict.num_images_held_by_points / std::max(1, verdict.num_images);
  judge->Limit(
      held, kMinShareHeld, kGoodShareHeld,
      std::to_string(verdict.num_images - verdict.num_images_held_by_points) +
          " of " + std::to_string(verdict.num_images) +
          " images see too few points for a pose of their own");
}

void JudgePriors(const Verdict& verdict, Judge* judge) {
  for (const PriorAgreement& priors : verdict.priors) {
    if (priors.num_priors < kMinPriors) continue;
    const std::string reason =
        "vision and the sensors' " + priors.kind + "s contradict each other (" +
        Percent(priors.share_contradicting) + " of " +
        std::to_string(priors.num_priors) + ", typical squared error " +
        Number(priors.chi2_ratio, 1) + " times what their noise allows)";
    if (priors.share_contradicting > kMaxShareContradicting) {
      judge->Fail(reason);
    } else if (priors.share_contradicting > kGoodShareContradicting ||
               priors.chi2_ratio > kGoodChi2Ratio) {
      judge->Doubt(reason);
    }
  }
  if (!verdict.priors.empty() &&
      verdict.keypoint_sigma_factor >= kGoodSigmaFactor) {
    judge->Doubt("keypoints had to be taken for " +
                 Number(verdict.keypoint_sigma_px, 1) +
                 " px to agree with the sensors");
  }
}

// `name` tells the model from others; empty for the only one.
void JudgeStage(const std::string& name, const MapperStageSummary& summary,
                int num_images, Judge* judge) {
  if (summary.started_from_coarse_poses) {
    judge->Doubt(name + "the parts contradicted the sensors and were given up");
  }
  if (summary.refine.num_images_put_back > kGoodSharePutBack * num_images) {
    judge->Doubt(name + std::to_string(summary.refine.num_images_put_back) +
                 " images contradicted the sensors and were put back");
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
                 " parts could not be used");
  }
}

// Each by itself: a wrong one must not hide behind a large sound one.
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

// "of 1 of 3 models " when not all are meant.
std::string OfModels(int num_models, int num_all_models) {
  if (num_models == num_all_models) return "";
  return "of " + std::to_string(num_models) + " of " +
         std::to_string(num_all_models) + " models ";
}

std::string MetricSource(const std::vector<AssessedModel>& models) {
  bool has_wheels = false;
  bool has_rig = false;
  bool is_georeferenced = false;
  for (const AssessedModel& model : models) {
    is_georeferenced |= model.summary->is_georeferenced;
    if (!model.summary->has_metric_sensors) continue;
    has_wheels |= HasLengths(model.data->priors);
    has_rig |= HasLengths(model.data->frame_priors);
  }
  std::string source;
  const auto add = [&source](bool has, const char* name) {
    if (has) source += (source.empty() ? "" : " and ") + std::string(name);
  };
  add(has_wheels, "wheels");
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
  verdict.priors = ComparePriors(models);
  Judge judge;
  JudgeImages(verdict, &judge);
  JudgeMatchedImages(models, rest, &judge);
  JudgePriors(verdict, &judge);
  if (models.size() > 1) JudgeEachModel(models, verdict.num_images, &judge);
  bool know_lengths = false;
  for (size_t k = 0; k < models.size(); ++k) {
    JudgeStage(models.size() == 1 ? "" : "model " + std::to_string(k) + ": ",
               *models[k].summary,
               static_cast<int>(models[k].model->NumRegImages()), &judge);
    know_lengths = know_lengths || HasLengths(models[k].data->priors) ||
                   HasLengths(models[k].data->frame_priors);
  }
  for (const std::string& warning : warnings) {
    judge.Doubt("an earlier step warned: " + warning);
  }
  // An IMU alone knows none: that is no reason to doubt the rest.
  if (!verdict.is_metric && know_lengths) {
    judge.Doubt("lengths " +
                OfModels(verdict.num_models - verdict.num_metric_models,
                         verdict.num_models) +
                "are in no unit, though sensors know some");
  }
  judge.Decide(&verdict);
  return verdict;
}

Verdict AssessModel(const SceneData& data, const MapperStageSummary& summary,
                    const std::vector<std::string>& warnings,
                    const colmap::Reconstruction& model) {
  return AssessModels({{&data, &summary, &model}}, {}, warnings);
}

const char* VerdictName(VerdictResult result) {
  switch (result) {
    case VerdictResult::kGood:
      return "good";
    case VerdictResult::kDoubtful:
      return "doubtful";
    case VerdictResult::kFailed:
      break;
  }
  return "failed";
}

std::string FormatVerdict(const Verdict& verdict) {
  std::ostringstream text;
  text << "Verdict: " << VerdictName(verdict.result);
  for (size_t i = 0; i < verdict.reasons.size(); ++i) {
    text << (i == 0 ? ": " : "; ") << verdict.reasons[i];
  }
  text << ". " << verdict.num_images << " of " << verdict.num_database_images
       << " images, "
       << (verdict.num_models == 1
               ? ""
               : "in " + std::to_string(verdict.num_models) + " models, ")
       << verdict.num_points << " points, "
       << static_cast<int>(verdict.median_points_per_image) << " an image, "
       << (verdict.num_metric_models == 0
               ? "no metres"
               : OfModels(verdict.num_metric_models, verdict.num_models) +
                     "in metres from " + verdict.metric_source);
  for (const PriorAgreement& priors : verdict.priors) {
    text << ", " << priors.kind << "s agree to "
         << Percent(1.0 - priors.share_contradicting);
  }
  if (!verdict.lost_images.empty()) {
    text << ". In no model: " << DescribeLostImages(verdict.lost_images);
  }
  return text.str();
}

nlohmann::json VerdictToJson(const Verdict& verdict) {
  nlohmann::json json = {
      {"result", VerdictName(verdict.result)},
      {"line", FormatVerdict(verdict)},
      {"reasons", verdict.reasons},
      {"num_database_images", verdict.num_database_images},
      {"num_images", verdict.num_images},
      {"num_models", verdict.num_models},
      {"num_images_held_by_points", verdict.num_images_held_by_points},
      {"num_points", verdict.num_points},
      {"median_points_per_image", verdict.median_points_per_image},
      {"is_metric", verdict.is_metric},
      {"num_metric_models", verdict.num_metric_models},
      {"metric_source", verdict.metric_source},
      {"keypoint_sigma_px", verdict.keypoint_sigma_px},
      {"keypoint_sigma_factor", verdict.keypoint_sigma_factor},
      {"mean_reproj_error_px", verdict.mean_reproj_error_px}};
  json["priors"] = nlohmann::json::array();
  for (const PriorAgreement& priors : verdict.priors) {
    json["priors"].push_back(
        {{"kind", priors.kind},
         {"num_priors", priors.num_priors},
         {"chi2_ratio", priors.chi2_ratio},
         {"share_contradicting", priors.share_contradicting}});
  }
  return json;
}

}  // namespace adasfm
