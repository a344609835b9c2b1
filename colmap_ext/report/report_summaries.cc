// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report/report_summaries.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <map>

namespace adasfm {
namespace {

using Json = nlohmann::json;

Json ReadJson(const std::string& path, Json::value_t type,
              std::vector<std::string>* notes) {
  std::ifstream file(path);
  if (!file) return Json();
  Json json = Json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (json.type() == type) return json;
  notes->push_back(path + " is not a complete JSON file and was left out");
  return Json();
}

// Files of other versions may lack a key or have another type there.
double NumberAt(const Json& json, const char* key) {
  if (!json.is_object()) return std::numeric_limits<double>::quiet_NaN();
  const auto value = json.find(key);
  return value != json.end() && value->is_number()
             ? value->get<double>()
             : std::numeric_limits<double>::quiet_NaN();
}

std::string TextAt(const Json& json, const char* key) {
  if (!json.is_object()) return "";
  const auto value = json.find(key);
  return value != json.end() && value->is_string() ? value->get<std::string>()
                                                   : "";
}

// An empty list when there is none.
Json ListAt(const Json& json, const char* key) {
  if (!json.is_object()) return Json::array();
  const auto value = json.find(key);
  return value != json.end() && value->is_array() ? *value : Json::array();
}

std::string Cell(const char* format, const Json& json, const char* key) {
  const double value = NumberAt(json, key);
  return std::isfinite(value) ? FormatNumber(format, value) : "-";
}

std::string VectorCell(const Json& json, const char* key) {
  std::string text;
  for (const Json& value : ListAt(json, key)) {
    if (!value.is_number()) return "-";
    text += FormatNumber("%.4f  ", value.get<double>());
  }
  return text.empty() ? "-" : text.substr(0, text.size() - 2);
}

std::vector<std::vector<image_t>> PartsOfPlan(const Json& plan) {
  std::vector<std::vector<image_t>> parts;
  for (const Json& list : ListAt(plan, "parts")) {
    std::vector<image_t> ids;
    for (const Json& id : list) {
      if (id.is_number_unsigned()) ids.push_back(id.get<image_t>());
    }
    parts.push_back(ids);
  }
  return parts;
}

// Parts of all components, whose images are disjoint.
std::vector<std::vector<image_t>> ReadPlans(const std::string& mapper_folder,
                                            std::vector<std::string>* notes) {
  std::vector<std::vector<image_t>> parts;
  std::string folder = mapper_folder;
  for (int k = 1;; ++k) {
    const Json plan = ReadJson(folder + "/checkpoints/plan.json",
                               Json::value_t::object, notes);
    if (plan.is_null()) break;
    const auto more = PartsOfPlan(plan);
    parts.insert(parts.end(), more.begin(), more.end());
    folder = mapper_folder + "/component_" + std::to_string(k);
  }
  return parts;
}

std::string PartOutcome(const Json& part) {
  const std::string failure = TextAt(part, "failure");
  if (!failure.empty()) return "failed: " + failure;
  const auto merged = part.find("merged");
  if (merged != part.end() && *merged == false) {
    return "does not fit the coarse model, not merged";
  }
  const std::string retry = TextAt(part, "retry_reason");
  return retry.empty() ? "merged" : "merged after a retry: " + retry;
}

}  // namespace

ReportSummaries ReadReportSummaries(const std::string& database_path,
                                    const std::string& coarse_folder,
                                    const std::string& mapper_folder) {
  ReportSummaries summaries;
  std::vector<std::string>* notes = &summaries.notes;
  if (!database_path.empty()) {
    summaries.importer =
        ReadJson(database_path + ".priors.json", Json::value_t::object, notes);
  }
  if (!coarse_folder.empty()) {
    summaries.global =
        ReadJson(coarse_folder + "/summary.json", Json::value_t::object, notes);
  }
  if (!mapper_folder.empty()) {
    summaries.mapper =
        ReadJson(mapper_folder + "/summary.json", Json::value_t::object, notes);
    summaries.parts = ReadPlans(mapper_folder, notes);
    summaries.steps =
        ReadJson(mapper_folder + "/../steps.json", Json::value_t::array, notes);
  }
  return summaries;
}

ReportVerdict FindVerdict(const ReportSummaries& summaries) {
  if (!summaries.mapper.is_object()) return {};
  const auto verdict = summaries.mapper.find("verdict");
  if (verdict == summaries.mapper.end()) return {};
  const std::string result = TextAt(*verdict, "result");
  // The result becomes the name of a style.
  if (result != "good" && result != "doubtful" && result != "failed") return {};
  return {result, TextAt(*verdict, "line")};
}

std::optional<bool> IsMetric(const ReportSummaries& summaries) {
  const Json& mapper = summaries.mapper;
  if (mapper.is_object() && mapper.contains("is_metric")) {
    return mapper["is_metric"] == true;
  }
  const Json models = ListAt(summaries.global, "models");
  if (!models.empty() && models[0].is_object() &&
      models[0].contains("metric")) {
    return models[0]["metric"] == true;
  }
  return std::nullopt;
}

std::vector<StageTime> ListStageTimes(const ReportSummaries& summaries) {
  std::vector<StageTime> times;
  const auto add = [&times](const char* stage, const std::string& step,
                            double seconds) {
    if (std::isfinite(seconds)) times.push_back({stage, step, seconds});
  };
  // Our own stages record their times themselves.
  for (const Json& step : summaries.steps) {
    const std::string name = TextAt(step, "name");
    if (name == "features" || name == "matching") {
      add("COLMAP", name, NumberAt(step, "seconds"));
    }
  }
  add("import", "priors from the logs",
      NumberAt(summaries.importer, "seconds"));
  for (const Json& step : ListAt(summaries.global, "steps")) {
    add("global", TextAt(step, "name"), NumberAt(step, "seconds"));
  }
  const Json& mapper = summaries.mapper;
  add("mapper", "plan", NumberAt(mapper, "plan_seconds"));
  add("mapper", "parts", NumberAt(mapper, "parts_seconds"));
  add("mapper", "merge", NumberAt(mapper, "merge_seconds"));
  add("mapper", "refinement", NumberAt(mapper, "refine_seconds"));
  return times;
}

ReportTable FormatSensors(const ReportSummaries& summaries) {
  const Json& json = summaries.importer;
  ReportTable table;
  if (!json.is_object()) return table;
  const auto add = [&table](const char* label, const std::string& value) {
    table.rows.push_back({label, value});
  };
  add("images with times", Cell("%.0f", json, "num_images"));
  add("inside the logs", Cell("%.0f", json, "num_images_in_logs"));
  add("priors", Cell("%.0f", json, "num_priors") + ", " +
                    FormatNumber("%.1f %% of consecutive images",
                                 100.0 * NumberAt(json, "prior_ratio")));
  add("camera to IMU time shift", Cell("%.4f s", json, "timeshift_cam_imu_s"));
  add("shift that vision would add",
      Cell("%.4f s", json, "visual_timeshift_correction_s"));
  if (NumberAt(json, "imu_rate_hz") > 0.0) {
    add("IMU", Cell("%.0f Hz, ", json, "imu_rate_hz") +
                   Cell("%.0f gaps, longest ", json, "num_imu_gaps") +
                   Cell("%.3f s", json, "max_imu_gap_s"));
    add("gyroscope bias, x y z",
        VectorCell(json, "gyroscope_bias_rad_s") + " rad/s");
    add("accelerometer bias, x y z",
        VectorCell(json, "accelerometer_bias_m_s2") + " m/s²");
    add("standstill", Cell("%.1f s", json, "standstill_s"));
  }
  if (NumberAt(json, "wheel_rate_hz") > 0.0) {
    add("wheels", Cell("%.0f Hz, ", json, "wheel_rate_hz") +
                      Cell("%.0f gaps, longest ", json, "num_wheel_gaps") +
                      Cell("%.3f s", json, "max_wheel_gap_s"));
    add("wheel scale", Cell("%.4f ± ", json, "wheel_scale") +
                           Cell("%.4f", json, "wheel_scale_sigma"));
    add("wheel slips",
        FormatNumber("%.0f", ListAt(json, "wheel_slips").size()));
    add("distance driven", Cell("%.1f m", json, "distance_m"));
    add("expected drift per 100 m",
        Cell("%.2f m, ", json, "drift_per_100m_m") +
            Cell("%.2f deg", json, "drift_per_100m_deg"));
  }
  for (const Json& warning : ListAt(json, "warnings")) {
    if (warning.is_string()) add("warning", warning.get<std::string>());
  }
  return table;
}

ReportTable FormatGlobalSteps(const ReportSummaries& summaries) {
  ReportTable table;
  table.head = {"step of adasfm_global", "what it did"};
  for (const Json& warning : ListAt(summaries.global, "warnings")) {
    if (warning.is_string()) {
      table.rows.push_back({"warning", warning.get<std::string>()});
    }
  }
  for (const Json& step : ListAt(summaries.global, "steps")) {
    table.rows.push_back({TextAt(step, "name"), TextAt(step, "summary")});
  }
  return table;
}

ReportTable FormatModels(const ReportSummaries& summaries) {
  ReportTable table;
  const Json models = ListAt(summaries.mapper, "models");
  if (models.size() < 2) return table;
  table.head = {"model",      "coarse model", "images", "points",
                "error [px]", "in metres",    "verdict"};
  for (size_t k = 0; k < models.size(); ++k) {
    const Json& model = models[k];
    if (!model.is_object()) continue;
    table.rows.push_back(
        {std::to_string(k), Cell("%.0f", model, "coarse_model"),
         Cell("%.0f", model, "num_images"), Cell("%.0f", model, "num_points"),
         Cell("%.2f", model, "mean_reproj_error_px"),
         model.value("is_metric", Json()) == true ? "yes" : "no",
         TextAt(model.value("verdict", Json()), "line")});
  }
  return table;
}

ReportTable FormatLostImages(const ReportSummaries& summaries) {
  std::map<std::string, std::vector<std::string>> names;
  for (const Json& image : ListAt(summaries.mapper, "images_in_no_model")) {
    names[TextAt(image, "reason")].push_back(TextAt(image, "name"));
  }
  ReportTable table;
  table.head = {"images in no model", "number", "names"};
  for (const auto& [reason, list] : names) {
    std::string text;
    for (const std::string& name : list) {
      text += (text.empty() ? "" : ", ") + name;
    }
    table.rows.push_back({reason, FormatCount(list.size()), text});
  }
  return table;
}

std::vector<ReportPlace> FindWeakPlaces(const ReportSummaries& summaries) {
  std::vector<ReportPlace> places;
  for (const Json& place : ListAt(summaries.global, "weak_places")) {
    places.push_back({TextAt(place, "name1"), TextAt(place, "name2"),
                      "between the coarse models " +
                          Cell("%.0f", place, "model1") + " and " +
                          Cell("%.0f", place, "model2") + ": " +
                          Cell("%.0f", place, "pairs") + " pairs, not used (" +
                          TextAt(place, "reason") + ")"});
  }
  const Json models = ListAt(summaries.global, "models");
  for (size_t k = 0; k < models.size(); ++k) {
    for (const Json& join : ListAt(models[k], "unconfirmed_closures")) {
      places.push_back(
          {TextAt(join, "name1"), TextAt(join, "name2"),
           "in the coarse model " + std::to_string(k) + ": " +
               Cell("%.0f", join, "pairs") + " pairs, which alone hold " +
               Cell("%.0f", join, "images") + " images to the rest"});
    }
  }
  return places;
}

ReportTable FormatWeakPlaces(const std::vector<ReportPlace>& places) {
  ReportTable table;
  table.head = {"photo", "photo", "place"};
  for (const ReportPlace& place : places) {
    table.rows.push_back({place.name1, place.name2, place.what});
  }
  return table;
}

ReportTable FormatParts(const ReportSummaries& summaries, bool is_metric) {
  const std::string unit = is_metric ? " [m]" : " [units]";
  ReportTable table;
  table.head = {"model",           "part",
                "outcome",         "images",
                "registered",      "by coarse pose",
                "points",          "error [px]",
                "overlap [%]",     "fit inliers [%]",
                "fit RMSE" + unit, "threshold" + unit,
                "scale",           "time [s]"};
  for (const Json& part : ListAt(summaries.mapper, "parts")) {
    const auto percent = [&part](const char* key) {
      const double ratio = NumberAt(part, key);
      return std::isfinite(ratio) ? FormatNumber("%.0f", 100.0 * ratio) : "-";
    };
    table.rows.push_back(
        {Cell("%.0f", part, "model"), Cell("%.0f", part, "part_index"),
         PartOutcome(part), Cell("%.0f", part, "num_images"),
         Cell("%.0f", part, "num_registered"),
         Cell("%.0f", part, "num_registered_by_global_pose"),
         Cell("%.0f", part, "num_points"),
         Cell("%.2f", part, "mean_reproj_error_px"), percent("overlap_ratio"),
         percent("inlier_ratio"), Cell("%.3f", part, "alignment_rmse"),
         Cell("%.2f", part, "threshold"), Cell("%.4f", part, "scale"),
         Cell("%.1f", part, "seconds")});
  }
  return table;
}

}  // namespace adasfm
