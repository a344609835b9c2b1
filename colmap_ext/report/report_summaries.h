// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/report/report_html.h"
#include "core/types.h"

namespace adasfm {

// The summaries that the stages wrote. Null JSON where a file is missing. A
// damaged file is skipped, too, and named in `notes`.
struct ReportSummaries {
  nlohmann::json importer;  // <database>.priors.json
  nlohmann::json global;    // summary.json beside the coarse model
  nlohmann::json mapper;    // summary.json beside the model
  nlohmann::json steps;     // steps.json of the workspace above the model
  // Image ids of the mapper's parts, from its checkpoints' plans.
  std::vector<std::vector<image_t>> parts;
  std::vector<std::string> notes;
};

// The folders are those that contain 0/; they may be empty.
ReportSummaries ReadReportSummaries(const std::string& database_path,
                                    const std::string& coarse_folder,
                                    const std::string& mapper_folder);

// The mapper's verdict: "good", "doubtful" or "failed", and its line. Empty
// without a verdict.
struct ReportVerdict {
  std::string result;
  std::string line;
};
ReportVerdict FindVerdict(const ReportSummaries& summaries);

// None when no summary states it.
std::optional<bool> IsMetric(const ReportSummaries& summaries);

// A bar of the chart of times.
struct StageTime {
  std::string stage;
  std::string step;
  double seconds = 0.0;
};
std::vector<StageTime> ListStageTimes(const ReportSummaries& summaries);

ReportTable FormatSensors(const ReportSummaries& summaries);
ReportTable FormatGlobalSteps(const ReportSummaries& summaries);
// The models of the mapper's run, when there are several.
ReportTable FormatModels(const ReportSummaries& summaries);
// The images in no model, by reason.
ReportTable FormatLostImages(const ReportSummaries& summaries);

// A place that connects models, or might connect them: one pair of images
// represents all pairs there.
struct ReportPlace {
  std::string name1;
  std::string name2;
  std::string what;
};
std::vector<ReportPlace> FindWeakPlaces(const ReportSummaries& summaries);
ReportTable FormatWeakPlaces(const std::vector<ReportPlace>& places);

ReportTable FormatParts(const ReportSummaries& summaries, bool is_metric);

}  // namespace adasfm
