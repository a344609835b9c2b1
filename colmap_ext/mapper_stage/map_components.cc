// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/mapper_stage/map_components.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include "colmap_ext/mapper_stage/model_checkpoint.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// The numbers k of folders component_<k> in the output folder.
std::vector<size_t> FindComponentFolders(const std::string& output_path) {
  const std::string prefix = "component_";
  std::vector<size_t> numbers;
  std::error_code error;
  for (const fs::directory_entry& entry :
       fs::directory_iterator(output_path, error)) {
    const std::string name = entry.path().filename().string();
    const std::string digits =
        name.substr(std::min(prefix.size(), name.size()));
    if (name.compare(0, prefix.size(), prefix) != 0 || digits.empty() ||
        digits.size() > 6 ||
        digits.find_first_not_of("0123456789") != std::string::npos) {
      continue;
    }
    numbers.push_back(std::stoul(digits));
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

// Beginning and share of each component in the progress, by its images.
std::vector<std::pair<double, double>> FindProgressRanges(
    const std::vector<ComponentToMap>& components, size_t first) {
  double num_images = 0.0;
  for (size_t k = first; k < components.size(); ++k) {
    num_images += components[k].data.images.size();
  }
  std::vector<std::pair<double, double>> ranges;
  double begin = 0.0;
  for (size_t k = first; k < components.size(); ++k) {
    const double share =
        components[k].data.images.size() / std::max(1.0, num_images);
    ranges.push_back({begin, share});
    begin += share;
  }
  return ranges;
}

std::vector<std::unique_ptr<MapperStage>> CreateStages(
    const MapperStageOptions& options,
    const std::vector<ComponentToMap>& components, size_t first,
    const std::string& output_path, const MapperProgress& progress) {
  const auto ranges = FindProgressRanges(components, first);
  std::vector<std::unique_ptr<MapperStage>> stages;
  for (size_t k = first; k < components.size(); ++k) {
    MapperProgress part_progress;
    if (progress) {
      const std::string prefix =
          components.size() == 1
              ? ""
              : "coarse model " + std::to_string(components[k].coarse_index) +
                    ": ";
      part_progress = [progress, prefix, range = ranges[k - first]](
                          const std::string& line, double share_done) {
        progress(prefix + line, range.first + range.second * share_done);
      };
    }
    MapperStageOptions component_options = options;
    component_options.refine.initial_position_loss_scale =
        components[k].initial_position_loss_scale.value_or(
            options.refine.initial_position_loss_scale);
    stages.push_back(std::make_unique<MapperStage>(
        component_options, components[k].data, components[k].coarse,
        ComponentOutputPath(output_path, k), part_progress));
  }
  return stages;
}

Status RunOnePart(int part_index,
                  std::vector<std::unique_ptr<MapperStage>>* stages) {
  int num_parts = 0;
  for (const std::unique_ptr<MapperStage>& stage : *stages) {
    const StatusOr<int> num_parts_here = stage->ReadNumParts();
    if (!num_parts_here.ok()) return num_parts_here.status();
    if (part_index < num_parts + *num_parts_here) {
      return stage->RunPart(part_index - num_parts);
    }
    num_parts += *num_parts_here;
  }
  return Status::Error(
      "AdaSfmMapper.part_index = " + std::to_string(part_index) +
      ", but the plan has the parts 0 to " + std::to_string(num_parts - 1));
}

Status RunComponent(MapperSteps steps, size_t component, MapperStage* stage,
                    std::vector<MappedComponent>* mapped) {
  Status status;
  if (steps != MapperSteps::kMerge) status = stage->Plan();
  if (status.ok() && steps == MapperSteps::kAll) status = stage->RunAllParts();
  // Reports the memory that the parts may need.
  if (status.ok() && steps == MapperSteps::kPlan) stage->FindNumParallelParts();
  if (!status.ok() || steps == MapperSteps::kPlan) return status;
  StatusOr<colmap::Reconstruction> model =
      stage->Merge(/*require_all_parts=*/true);
  if (!model.ok()) return model.status();
  mapped->push_back({component, stage->Summary(), std::move(*model)});
  return Status::Ok();
}

}  // namespace

std::string ComponentOutputPath(const std::string& output_path, size_t k) {
  return k == 0 ? output_path : output_path + "/component_" + std::to_string(k);
}

StatusOr<std::vector<MappedComponent>> MapComponents(
    const MapperStageOptions& options,
    const std::vector<ComponentToMap>& components, size_t first,
    const std::string& output_path, MapperSteps steps, int part_index,
    const MapperProgress& progress) {
  std::vector<std::unique_ptr<MapperStage>> stages =
      CreateStages(options, components, first, output_path, progress);
  std::vector<MappedComponent> mapped;
  if (steps == MapperSteps::kPart) {
    const Status status = RunOnePart(part_index, &stages);
    if (!status.ok()) return status;
    return mapped;
  }
  for (size_t k = 0; k < stages.size(); ++k) {
    const Status status =
        RunComponent(steps, first + k, stages[k].get(), &mapped);
    if (!status.ok()) return status;
  }
  return mapped;
}

Status CheckComponentCheckpoints(const std::string& output_path) {
  Status status = CheckCheckpointFolder(output_path + "/checkpoints");
  for (const size_t k : FindComponentFolders(output_path)) {
    if (!status.ok()) return status;
    status = CheckCheckpointFolder(ComponentOutputPath(output_path, k) +
                                   "/checkpoints");
  }
  return status;
}

Status RemoveSurplusCheckpoints(const std::string& output_path,
                                size_t num_components) {
  for (const size_t k : FindComponentFolders(output_path)) {
    if (k < num_components) continue;
    const fs::path folder = ComponentOutputPath(output_path, k);
    const fs::path checkpoints = folder / "checkpoints";
    const Status status = RemoveCheckpoints(checkpoints.string());
    if (!status.ok()) return status;
    // Folders with other content stay.
    std::error_code ignored;
    fs::remove(checkpoints, ignored);
    fs::remove(folder, ignored);
  }
  return Status::Ok();
}

}  // namespace adasfm
