// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report/report_input.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "colmap_ext/host/database.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/report/report_examples.h"
#include "colmap_ext/report/report_html.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// Pairs shown with their matches on the photos, for each of removed, kept and
// weak ones; each adds about 60 kB.
constexpr size_t kMaxNumExamples = 4;

// The largest model, and the parent of its folder, which has the summary.
StatusOr<colmap::Reconstruction> ReadLargest(const std::string& path,
                                             std::string* parent) {
  const std::vector<std::string> folders = FindModels(path);
  if (folders.empty()) {
    return Status::Error("there is no COLMAP model in " + path +
                         "; check the path");
  }
  StatusOr<LargestModel> largest = ReadLargestModel(folders);
  if (!largest.ok()) return largest.status();
  fs::path absolute = fs::absolute(largest->folder).lexically_normal();
  if (!absolute.has_filename()) absolute = absolute.parent_path();
  *parent = absolute.parent_path().string();
  return std::move(largest->reconstruction);
}

Status ReadDatabase(const std::string& path, ReportInput* input) {
  const Status checked = CheckDatabase(path);
  if (!checked.ok()) return checked;
  try {
    SqliteConnection database(path, SqliteConnection::Mode::kRead);
    for (const DatabaseImage& image : ReadImages(&database)) {
      input->database_images[image.image_id] = image.name;
    }
    input->priors = ReadPriorTables(&database).tables;
  } catch (const SqliteError& error) {
    return Status::Error(error.what());
  }
  return Status::Ok();
}

Status ReadPairs(const std::string& path, ReportInput* input) {
  try {
    SqliteConnection database(path, SqliteConnection::Mode::kRead);
    input->pairs = ReadReportPairs(input->scene, &database);
  } catch (const SqliteError& error) {
    return Status::Error(error.what());
  }
  if (!input->pairs->was_rewritten) {
    input->notes.push_back(
        "pairs before and after: adasfm_global has not rewritten this "
        "database");
  }
  return Status::Ok();
}

// The pairs that represent weak places, as far as the database has them.
std::vector<ReportPair> FindWeakPairs(const ReportInput& input) {
  std::vector<ReportPair> weak;
  for (const ReportPlace& place : FindWeakPlaces(input.summaries)) {
    const auto image1 = input.scene.index_of_name.find(place.name1);
    const auto image2 = input.scene.index_of_name.find(place.name2);
    if (image1 == input.scene.index_of_name.end() ||
        image2 == input.scene.index_of_name.end()) {
      continue;
    }
    const auto indices = std::minmax(image1->second, image2->second);
    const auto pair =
        std::find_if(input.pairs->pairs.begin(), input.pairs->pairs.end(),
                     [&indices](const ReportPair& candidate) {
                       return candidate.index1 == indices.first &&
                              candidate.index2 == indices.second;
                     });
    if (pair != input.pairs->pairs.end()) weak.push_back(*pair);
    if (weak.size() == kMaxNumExamples) break;
  }
  return weak;
}

Status ReadExamples(const ReportOptions& options, ReportInput* input) {
  if (!fs::is_directory(options.image_path)) {
    return Status::Error("there is no folder " + options.image_path +
                         "; check --image_path");
  }
  const size_t num_images = input->scene.images.size();
  const std::vector<ReportPair> removed =
      SelectRemovedExamples(*input->pairs, num_images, kMaxNumExamples);
  const std::vector<ReportPair> kept =
      SelectKeptExamples(*input->pairs, num_images, kMaxNumExamples);
  const std::vector<ReportPair> weak = FindWeakPairs(*input);
  int num_removed_unreadable = 0, num_kept_unreadable = 0;
  int num_weak_unreadable = 0;
  try {
    SqliteConnection database(options.database_path,
                              SqliteConnection::Mode::kRead);
    input->removed_examples =
        FormatExamples(removed, input->scene, options.image_path, &database,
                       &num_removed_unreadable);
    input->kept_examples =
        FormatExamples(kept, input->scene, options.image_path, &database,
                       &num_kept_unreadable);
    input->weak_examples =
        FormatExamples(weak, input->scene, options.image_path, &database,
                       &num_weak_unreadable);
  } catch (const SqliteError& error) {
    return Status::Error(error.what());
  }
  const int num_unreadable =
      num_removed_unreadable + num_kept_unreadable + num_weak_unreadable;
  if (num_unreadable > 0) {
    input->notes.push_back(FormatCount(num_unreadable) +
                           " of the pairs on photos: " + options.image_path +
                           " lacks a photo of theirs, or it cannot be read");
  }
  return Status::Ok();
}

void ReadRemoved(ReportInput* input) {
  const std::string path = input->coarse_folder + "/removed_pairs.txt";
  if (!fs::exists(path)) {
    input->notes.push_back("removed pairs: there is no " + path);
    return;
  }
  input->removed = ReadRemovedPairs(path, input->scene);
  if (input->removed->num_unknown > 0) {
    input->notes.push_back(
        "removed pairs: " + FormatCount(input->removed->num_unknown) +
        " lines of " + path + " name images that are not in the model");
  }
}

Status ReadTruth(const ReportOptions& options, bool is_metric,
                 ReportInput* input) {
  std::vector<std::string> names;
  for (const ReportImage& image : input->scene.images) {
    names.push_back(image.name);
  }
  StatusOr<NamedPoses> truth =
      ReadGroundTruth(options.ground_truth_path, names, options.ground_truth);
  if (!truth.ok()) return truth.status();
  input->truth = std::move(truth).value();
  const StatusOr<Evaluation> evaluation =
      EvaluateModel(input->model, input->truth);
  if (!evaluation.ok()) {
    input->notes.push_back("errors against ground truth: " +
                           evaluation.status().message());
    return Status::Ok();
  }
  input->evaluation = *evaluation;
  AlignTruth(input->truth, is_metric, &input->scene);
  return Status::Ok();
}

void NoteWhatIsMissing(const ReportOptions& options, ReportInput* input) {
  const auto note = [input](bool is_missing, const char* text) {
    if (is_missing) input->notes.push_back(text);
  };
  note(options.coarse_path.empty(),
       "coarse positions, removed pairs and the times of adasfm_global: no "
       "--coarse_path was given");
  note(options.database_path.empty(),
       "priors, view graph, inlier ratios and sensors: no --database_path was "
       "given");
  note(options.image_path.empty() || options.database_path.empty(),
       "pairs on photos: they need --image_path and --database_path");
  note(options.ground_truth_path.empty(),
       "errors: no --ground_truth_path was given");
  const ReportSummaries& summaries = input->summaries;
  note(!options.database_path.empty() && summaries.importer.is_null(),
       "sensors: there is no .priors.json of adasfm_prior_importer beside the "
       "database");
  note(!options.coarse_path.empty() && summaries.global.is_null(),
       "times of adasfm_global: there is no summary.json beside the coarse "
       "model");
  note(summaries.mapper.is_null(),
       "parts and times of adasfm_mapper: there is no summary.json beside the "
       "model");
  note(summaries.parts.empty(),
       "parts in colour: there is no checkpoints/plan.json beside the model");
  input->notes.insert(input->notes.end(), summaries.notes.begin(),
                      summaries.notes.end());
}

}  // namespace

StatusOr<ReportInput> ReadReportInput(const ReportOptions& options) {
  ReportInput input;
  std::string mapper_folder;
  StatusOr<colmap::Reconstruction> model =
      ReadLargest(options.input_path, &mapper_folder);
  if (!model.ok()) return model.status();
  input.model = std::move(model).value();
  if (!options.coarse_path.empty()) {
    StatusOr<colmap::Reconstruction> coarse =
        ReadLargest(options.coarse_path, &input.coarse_folder);
    if (!coarse.ok()) return coarse.status();
    input.coarse = std::move(coarse).value();
  }
  if (!options.database_path.empty()) {
    const Status read = ReadDatabase(options.database_path, &input);
    if (!read.ok()) return read;
  }
  input.summaries = ReadReportSummaries(options.database_path,
                                        input.coarse_folder, mapper_folder);
  NoteWhatIsMissing(options, &input);

  const bool is_metric = IsMetric(input.summaries).value_or(false);
  input.scene =
      BuildReportScene(input.database_images, input.model,
                       input.coarse ? &*input.coarse : nullptr, input.priors);
  // Metric lengths cannot be drawn in a world of unknown scale.
  if (is_metric) ChainPriors(input.priors.priors, &input.scene);
  MarkParts(input.summaries.parts, &input.scene);
  if (!options.database_path.empty()) {
    const Status read = ReadPairs(options.database_path, &input);
    if (!read.ok()) return read;
  }
  if (input.pairs && !options.image_path.empty()) {
    const Status read = ReadExamples(options, &input);
    if (!read.ok()) return read;
  }
  if (input.coarse) ReadRemoved(&input);
  if (!options.ground_truth_path.empty()) {
    const Status read = ReadTruth(options, is_metric, &input);
    if (!read.ok()) return read;
  }
  return input;
}

}  // namespace adasfm
