// SPDX-License-Identifier: BSD-3-Clause
#include <iostream>
#include <string>
#include <vector>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/evaluation/evaluate_pairs.h"
#include "colmap_ext/evaluation/evaluation.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/io/output_files.h"
#include "core/check_options.h"

namespace adasfm {
namespace {

struct PairOptions {
  std::string database_path;
  std::string landmarks_path;
  std::string json_path;
};

void AddPairOptions(PairOptions* options, CommandOptions* command) {
  command->AddDefault("database_path", &options->database_path,
                      "database whose verified pairs are compared too, both "
                      "before and after adasfm_global; none when empty");
  command->AddDefault("landmarks_path", &options->landmarks_path,
                      "true landmark of each keypoint, lines `name id id ...` "
                      "(adasfm_synthesizer's landmarks.txt), for precision and "
                      "recall of matches; none when empty");
  command->AddDefault(
      "pairs_json_path", &options->json_path,
      "file for the results of the pairs as JSON; none when empty");
}

Status ComparePairs(const PairOptions& options, const NamedPoses& truth) {
  if (options.database_path.empty()) return Status::Ok();
  const StatusOr<PairEvaluation> pairs = EvaluateDatabasePairs(
      options.database_path, truth, options.landmarks_path);
  if (!pairs.ok()) return pairs.status();
  std::cout << FormatPairEvaluation(*pairs) << std::flush;
  if (options.json_path.empty()) return Status::Ok();
  return WriteTextFile(options.json_path, PairEvaluationToJson(*pairs) + "\n");
}

}  // namespace

Status RunAdasfmEvaluator(int argc, char** argv) {
  std::string input_path;
  std::string ground_truth_path;
  std::string json_path;
  GroundTruthOptions options;
  CommandOptions command("adasfm_evaluator",
                         "Compares a model with the ground truth.");
  command.AddRequired("input_path", &input_path,
                      "model folder, or a folder of models, of which the "
                      "largest is compared");
  command.AddRequired("ground_truth_path", &ground_truth_path,
                      "true poses: a COLMAP model, a TUM trajectory, or lines "
                      "`name qw qx qy qz tx ty tz` (cam_from_world)");
  command.AddDefault("json_path", &json_path,
                     "file for the results as JSON; none when empty");
  command.AddDefault("image_times_path", &options.image_times_path,
                     "image times, for a ground-truth trajectory; when empty, "
                     "the digits of an image name are nanoseconds");
  command.AddDefault(
      "max_time_gap_s", &options.max_time_gap_s,
      "largest gap between trajectory poses that is interpolated [s]");
  PairOptions pairs;
  AddPairOptions(&pairs, &command);
  const Status parsed = command.Parse(argc, argv);
  if (!parsed.ok() || command.HelpShown()) return parsed;
  Status valid = CheckOptions(options);
  for (const std::string& output : {json_path, pairs.json_path}) {
    if (!valid.ok()) break;
    valid = CheckOutputIsNoInput(
        output, {{"ground_truth_path", ground_truth_path},
                 {"image_times_path", options.image_times_path},
                 {"database_path", pairs.database_path},
                 {"landmarks_path", pairs.landmarks_path}});
  }
  if (!valid.ok()) return valid;

  const std::vector<std::string> folders = FindModels(input_path);
  if (folders.empty()) {
    return Status::Error("there is no COLMAP model in " + input_path +
                         "; check --input_path");
  }
  const StatusOr<LargestModel> model = ReadLargestModel(folders);
  if (!model.ok()) return model.status();
  std::vector<std::string> image_names;
  for (const auto& [name, pose] : PosesOfModel(model->reconstruction)) {
    image_names.push_back(name);
  }
  const StatusOr<NamedPoses> truth =
      ReadGroundTruth(ground_truth_path, image_names, options);
  if (!truth.ok()) return truth.status();
  StatusOr<Evaluation> evaluation =
      EvaluateModel(model->reconstruction, *truth);
  if (!evaluation.ok()) return evaluation.status();
  evaluation->num_models = folders.size();
  std::cout << FormatEvaluation(*evaluation) << std::flush;
  if (!json_path.empty()) {
    const Status written =
        WriteTextFile(json_path, EvaluationToJson(*evaluation) + "\n");
    if (!written.ok()) return written;
  }
  return ComparePairs(pairs, *truth);
}

}  // namespace adasfm
