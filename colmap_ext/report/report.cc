// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report/report.h"

#include <cmath>
#include <optional>
#include <utility>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/report/report_html.h"
#include "colmap_ext/report/report_input.h"

namespace adasfm {
namespace {

// Largest number of cells per side of the matrix of pairs: no screen shows
// more, and the page stays small for any number of pairs.
constexpr size_t kMaxMatrixSize = 700;
// Largest number of points in the 3D view: more points make the file large and
// the view slow, without showing more.
constexpr int kMaxNumPoints = 20000;

// Reprojection errors of all observations of the model's points.
Histogram MeasureReprojection(const colmap::Reconstruction& model) {
  Histogram errors(0.1, 41);
  for (const image_t image_id : model.RegImageIds()) {
    const colmap::Image& image = model.Image(image_id);
    const colmap::Camera& camera = model.Camera(image.CameraId());
    const Rigid3d cam_from_world = CamFromWorld(image);
    for (const colmap::Point2D& point2D : image.Points2D()) {
      if (!point2D.HasPoint3D()) continue;
      const std::optional<Eigen::Vector2d> projected = ProjectPoint(
          camera, cam_from_world * XyzOf(model.Point3D(PointIdOf(point2D))));
      if (!projected) continue;
      errors.Add((*projected - XyOf(point2D)).norm());
    }
  }
  return errors;
}

double TotalSeconds(const std::vector<StageTime>& times) {
  double seconds = 0.0;
  for (const StageTime& time : times) seconds += time.seconds;
  return seconds;
}

// "75.3 s", "5 min 20 s", "2 h 5 min".
std::string FormatDuration(double seconds) {
  if (seconds < 120.0) return FormatNumber("%.1f s", seconds);
  const double minutes = std::floor(seconds / 60.0);
  if (minutes < 120.0) {
    return FormatNumber("%.0f min ", minutes) +
           FormatNumber("%.0f s", std::floor(seconds - 60.0 * minutes));
  }
  const double hours = std::floor(minutes / 60.0);
  return FormatNumber("%.0f h ", hours) +
         FormatNumber("%.0f min", minutes - 60.0 * hours);
}

std::vector<ReportFigure> ListFigures(const ReportInput& input) {
  std::vector<ReportFigure> figures;
  const colmap::Reconstruction& model = input.model;
  figures.push_back({"Images registered",
                     FormatCount(model.NumRegImages()) + " of " +
                         FormatCount(input.scene.images.size()),
                     input.database_images.empty()
                         ? "of the images known without database"
                         : "of the database's images"});
  figures.push_back({"Points", FormatCount(model.NumPoints3D()), ""});
  if (model.NumPoints3D() > 0) {
    figures.push_back({"Mean track length",
                       FormatNumber("%.2f", model.ComputeMeanTrackLength()),
                       "images that see a point"});
  }
  if (model.NumPoints3D() > 0) {
    figures.push_back({"Reprojection error",
                       FormatNumber("%.2f px", ComputeReprojectionRmse(model)),
                       "RMSE of the points' errors"});
  }
  const std::optional<bool> metric = IsMetric(input.summaries);
  figures.push_back({"In metres",
                     !metric   ? "unknown"
                     : *metric ? "yes"
                               : "no",
                     !metric   ? "no stage says"
                     : *metric ? "scale from the sensors"
                               : "lengths are in arbitrary units"});
  if (input.evaluation) {
    const bool is_metric = metric.value_or(false);
    const AlignmentErrors& errors = is_metric
                                        ? input.evaluation->se3_least_squares
                                        : input.evaluation->sim3_least_squares;
    figures.push_back({"Position error",
                       FormatNumber("%.3f m", errors.translation_rmse_m),
                       is_metric ? "RMSE against the truth, scale as it is"
                                 : "RMSE against the truth, scale fitted"});
    figures.push_back({"Rotation error",
                       FormatNumber("%.2f deg", errors.rotation_mean_deg),
                       "mean against the truth"});
    if (is_metric) {
      const double scale = input.evaluation->sim3_least_squares.scale;
      figures.push_back({"Scale error",
                         FormatNumber("%.2f %%", 100.0 * std::abs(scale - 1.0)),
                         "of lengths against the truth"});
    }
  }
  if (input.removed) {
    figures.push_back({"Pairs removed",
                       FormatCount(input.removed->pairs.size()),
                       "refuted by adasfm_global"});
  }
  const std::vector<StageTime> times = ListStageTimes(input.summaries);
  if (!times.empty()) {
    figures.push_back(
        {"Time", FormatDuration(TotalSeconds(times)), "of the steps below"});
  }
  return figures;
}

ReportTable FormatErrors(const ReportInput& input) {
  ReportTable table;
  if (!input.evaluation) return table;
  table.head = {"alignment",  "scale",   "RMSE [m]",   "mean [m]",
                "median [m]", "max [m]", "mean [deg]", "median [deg]"};
  const Evaluation& evaluation = *input.evaluation;
  const std::pair<const char*, const AlignmentErrors*> rows[] = {
      {"similarity, least squares", &evaluation.sim3_least_squares},
      {"similarity, robust", &evaluation.sim3},
      {"rigid, least squares", &evaluation.se3_least_squares},
      {"rigid, robust", &evaluation.se3}};
  for (const auto& [name, errors] : rows) {
    table.rows.push_back({name, FormatNumber("%.5f", errors->scale),
                          FormatNumber("%.3f", errors->translation_rmse_m),
                          FormatNumber("%.3f", errors->translation_mean_m),
                          FormatNumber("%.3f", errors->translation_median_m),
                          FormatNumber("%.3f", errors->translation_max_m),
                          FormatNumber("%.3f", errors->rotation_mean_deg),
                          FormatNumber("%.3f", errors->rotation_median_deg)});
  }
  return table;
}

nlohmann::json ChartData(const ReportInput& input,
                         const Histogram& reprojection) {
  nlohmann::json data;
  data["unit"] = IsMetric(input.summaries).value_or(false) ? "m" : "units";
  data["images"] = SceneToJson(input.scene);
  data["points"] = PointsToJson(input.model, input.scene, kMaxNumPoints);
  data["num_points"] = input.model.NumPoints3D();
  if (reprojection.Count() > 0) data["reprojection"] = reprojection.ToJson();
  if (input.removed) {
    std::vector<uint32_t> indices;
    for (const auto& [index1, index2] : input.removed->pairs) {
      indices.push_back(index1);
      indices.push_back(index2);
    }
    data["removed"] = PackUint32(indices);
  }
  if (input.pairs) {
    data["pairs"] =
        PairsToJson(*input.pairs, input.scene.images.size(), kMaxMatrixSize);
    data["ratios_before"] = input.pairs->inlier_ratios_before;
    data["ratios_after"] = input.pairs->inlier_ratios_after;
  }
  for (const StageTime& time : ListStageTimes(input.summaries)) {
    data["times"].push_back({time.stage, time.step, time.seconds});
  }
  return data;
}

std::string FormatVerdictLine(const ReportVerdict& verdict) {
  if (verdict.result.empty()) return "";
  return "<p class=\"verdict " + verdict.result + "\" role=\"status\">" +
         EscapeHtml(verdict.line) + "</p>\n";
}

std::string FormatNotes(const std::vector<std::string>& notes) {
  std::string html;
  for (const std::string& note : notes) {
    html += "<li>" + EscapeHtml(note) + "</li>\n";
  }
  return html;
}

}  // namespace

bool ReportOptions::IsValid(std::string* error) const {
  return ground_truth.IsValid(error);
}

StatusOr<std::string> BuildReport(const ReportOptions& options) {
  const StatusOr<ReportInput> input = ReadReportInput(options);
  if (!input.ok()) return input.status();
  const Histogram reprojection = MeasureReprojection(input->model);
  const bool is_metric = IsMetric(input->summaries).value_or(false);
  return FillTemplate(
      kReportTemplate,
      {{"SOURCE", EscapeHtml(options.input_path)},
       {"VERDICT", FormatVerdictLine(FindVerdict(input->summaries))},
       {"FIGURES", FormatFigures(ListFigures(*input))},
       {"NOTES", FormatNotes(input->notes)},
       {"SENSORS", FormatTable(FormatSensors(input->summaries))},
       {"STEPS", FormatTable(FormatGlobalSteps(input->summaries))},
       {"MODELS", FormatTable(FormatModels(input->summaries))},
       {"LOST", FormatTable(FormatLostImages(input->summaries))},
       {"WEAK",
        FormatTable(FormatWeakPlaces(FindWeakPlaces(input->summaries)))},
       {"WEAK_EXAMPLES", input->weak_examples},
       {"PARTS", FormatTable(FormatParts(input->summaries, is_metric))},
       {"REMOVED_EXAMPLES", input->removed_examples},
       {"KEPT_EXAMPLES", input->kept_examples},
       {"ERRORS", FormatTable(FormatErrors(*input))},
       {"DATA", JsonForScript(ChartData(*input, reprojection))}});
}

}  // namespace adasfm
