// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/io/run_manifest.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "colmap_ext/io/output_files.h"
#include "core/stopwatch.h"

namespace adasfm {

StatusOr<RunManifest> RunManifest::Read(const std::string& path) {
  RunManifest manifest;
  manifest.path_ = path;
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return manifest;
  try {
    std::ifstream file(path);
    // Throws for anything but a list.
    const auto entries =
        nlohmann::json::parse(file).get<nlohmann::json::array_t>();
    for (const nlohmann::json& entry : entries) {
      Step step;
      step.name = entry.at("name");
      step.inputs = entry.at("inputs").get<StepInputs>();
      step.is_done = entry.at("is_done");
      step.seconds = entry.at("seconds");
      manifest.steps_.push_back(std::move(step));
    }
  } catch (const nlohmann::json::exception&) {
    return Status::Error(path +
                         " is damaged; remove it to do all steps again, or "
                         "choose another workspace");
  }
  return manifest;
}

const RunManifest::Step* RunManifest::Find(const std::string& name) const {
  const auto step =
      std::find_if(steps_.begin(), steps_.end(),
                   [&name](const Step& entry) { return entry.name == name; });
  return step == steps_.end() ? nullptr : &*step;
}

RunManifest::State RunManifest::GetState(const std::string& name,
                                         const StepInputs& inputs) const {
  const Step* step = Find(name);
  if (step == nullptr) return State::kNew;
  if (step->inputs != inputs) return State::kChanged;
  return step->is_done ? State::kDone : State::kBegun;
}

std::string RunManifest::DescribeChange(const std::string& name,
                                        const StepInputs& inputs) const {
  const Step* step = Find(name);
  if (step == nullptr) return "";
  std::string text;
  for (const auto& [key, value] : inputs) {
    const auto old = step->inputs.find(key);
    const std::string old_value = old == step->inputs.end() ? "" : old->second;
    if (old_value == value) continue;
    text += (text.empty() ? "" : ", ") + key + " is '" + value + "', was '" +
            old_value + "'";
  }
  return text;
}

Status RunManifest::Begin(const std::string& name, const StepInputs& inputs) {
  const Step* old = Find(name);
  if (old != nullptr) steps_.resize(old - steps_.data());
  steps_.push_back({name, inputs, false, 0.0});
  return Write();
}

Status RunManifest::Finish(const std::string& name, double seconds) {
  if (Find(name) == nullptr) {
    throw std::logic_error("RunManifest: " + name + " has not begun");
  }
  Step& step = steps_[Find(name) - steps_.data()];
  step.is_done = true;
  step.seconds = seconds;
  return Write();
}

Status RunManifest::KeepOnly(const std::string& name) {
  steps_.erase(
      std::remove_if(steps_.begin(), steps_.end(),
                     [&name](const Step& step) { return step.name != name; }),
      steps_.end());
  return Write();
}

StatusOr<double> RunManifest::Run(const std::string& name,
                                  const StepInputs& inputs,
                                  const StepActions& actions,
                                  const MessageCallback& message) {
  State state = GetState(name, inputs);
  if (state == State::kDone) {
    const Status found = actions.check();
    if (found.ok()) {
      message(name + ": done before");
      return Find(name)->seconds;
    }
    message(name + ": done before, but " + found.message() +
            "; doing this and all that follows again");
    state = State::kBegun;
  }
  if (state == State::kChanged) {
    message(name + ": " + DescribeChange(name, inputs) +
            "; doing this and all that follows anew");
  }
  const Stopwatch watch;
  Status status;
  if (state != State::kBegun) {
    // If the run crashes in reset, the step's inputs then match none.
    status = Begin(name, {{"removing", "old results"}});
    if (status.ok()) status = actions.reset();
  }
  if (status.ok()) status = Begin(name, inputs);
  if (status.ok()) status = actions.work();
  if (status.ok()) status = actions.check();
  if (!status.ok()) return status;
  const double seconds = watch.Seconds();
  status = Finish(name, seconds);
  if (!status.ok()) return status;
  return seconds;
}

Status RunManifest::Write() const {
  nlohmann::json json = nlohmann::json::array();
  for (const Step& step : steps_) {
    json.push_back({{"name", step.name},
                    {"inputs", step.inputs},
                    {"is_done", step.is_done},
                    {"seconds", step.seconds}});
  }
  return WriteTextFile(path_, json.dump(2) + "\n");
}

}  // namespace adasfm
