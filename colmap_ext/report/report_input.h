// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/evaluation/evaluation.h"
#include "colmap_ext/host/colmap.h"
#include "colmap_ext/report/report.h"
#include "colmap_ext/report/report_pairs.h"
#include "colmap_ext/report/report_scene.h"
#include "colmap_ext/report/report_summaries.h"
#include "core/status.h"

namespace adasfm {

// Input of all sections of the page.
struct ReportInput {
  colmap::Reconstruction model;
  std::optional<colmap::Reconstruction> coarse;
  std::map<image_t, std::string> database_images;
  PriorTables priors;
  ReportSummaries summaries;
  std::string coarse_folder;
  ReportScene scene;
  std::optional<ReportPairs> pairs;
  std::optional<RemovedPairs> removed;
  // HTML of pairs with their matches on the photos.
  std::string removed_examples;
  std::string kept_examples;
  std::string weak_examples;
  NamedPoses truth;
  std::optional<Evaluation> evaluation;
  // What is not shown, and why.
  std::vector<std::string> notes;
};

// Reads the given inputs; the others stay empty and are listed in notes.
StatusOr<ReportInput> ReadReportInput(const ReportOptions& options);

}  // namespace adasfm
