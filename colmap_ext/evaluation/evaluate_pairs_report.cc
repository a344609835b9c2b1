// SPDX-License-Identifier: BSD-3-Clause
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "colmap_ext/evaluation/evaluate_pairs.h"

namespace adasfm {
namespace {

using Json = nlohmann::ordered_json;

double Share(int64_t part, int64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / whole;
}

Json SetToJson(const PairEvaluation& evaluation,
               const PairSetFigures& figures) {
  Json auc = Json::array();
  for (const RelativePoseAuc& at : figures.auc) {
    auc.push_back({{"threshold_deg", at.threshold_deg},
                   {"rotation_percent", at.rotation_percent},
                   {"translation_percent", at.translation_percent}});
  }
  Json json = {{"num_pairs", figures.num_pairs},
               {"num_matches", figures.num_matches},
               {"mean_inlier_ratio", figures.mean_inlier_ratio},
               {"inlier_ratio_histogram", figures.inlier_ratio_histogram},
               {"relative_pose_auc", auc}};
  if (!evaluation.has_landmarks) return json;
  json["num_true_matches"] = figures.num_true_matches;
  json["num_false_pairs"] = figures.num_false_pairs;
  json["precision"] = Share(figures.num_true_matches, figures.num_matches);
  json["recall"] =
      Share(figures.num_true_matches, evaluation.num_true_raw_matches);
  return json;
}

void FormatSet(const char* name, const PairEvaluation& evaluation,
               const PairSetFigures& figures, std::ostringstream* text) {
  *text << std::left << std::setw(22) << name << std::right << std::setw(8)
        << figures.num_pairs << std::setw(10) << figures.num_matches
        << std::setw(9) << 100.0 * figures.mean_inlier_ratio;
  if (evaluation.has_landmarks) {
    *text << std::setw(8) << figures.num_false_pairs << std::setw(10)
          << 100.0 * Share(figures.num_true_matches, figures.num_matches)
          << std::setw(9)
          << 100.0 * Share(figures.num_true_matches,
                           evaluation.num_true_raw_matches);
  }
  *text << "\n";
}

}  // namespace

std::string FormatPairEvaluation(const PairEvaluation& evaluation) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << "\n"
       << std::left << std::setw(22) << "pairs" << std::right << std::setw(8)
       << "number" << std::setw(10) << "matches" << std::setw(9) << "inl. %";
  if (evaluation.has_landmarks) {
    text << std::setw(8) << "false" << std::setw(10) << "precision"
         << std::setw(9) << "recall";
  }
  text << "\n";
  FormatSet("verified", evaluation, evaluation.verified, &text);
  FormatSet("kept, as verified", evaluation, evaluation.kept_before, &text);
  FormatSet("kept, refined", evaluation, evaluation.kept_after, &text);
  text << "\nAUC in percent       verified      as verified          refined\n"
       << "up to deg           R       t        R       t        R       t\n";
  for (size_t k = 0; k < evaluation.verified.auc.size(); ++k) {
    text << std::left << std::setw(12)
         << evaluation.verified.auc[k].threshold_deg << std::right;
    for (const PairSetFigures* figures :
         {&evaluation.verified, &evaluation.kept_before,
          &evaluation.kept_after}) {
      text << std::setw(9) << figures->auc[k].rotation_percent << std::setw(8)
           << figures->auc[k].translation_percent;
    }
    text << "\n";
  }
  return text.str();
}

std::string PairEvaluationToJson(const PairEvaluation& evaluation) {
  Json json;
  if (evaluation.has_landmarks) {
    json["num_true_raw_matches"] = evaluation.num_true_raw_matches;
  }
  json["verified"] = SetToJson(evaluation, evaluation.verified);
  json["kept_before"] = SetToJson(evaluation, evaluation.kept_before);
  json["kept_after"] = SetToJson(evaluation, evaluation.kept_after);
  return json.dump(2);
}

}  // namespace adasfm
