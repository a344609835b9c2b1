// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// What a step's result depends on, by name.
using StepInputs = std::map<std::string, std::string>;

// Receives a step's messages for the user: lines of text.
using MessageCallback = std::function<void(const std::string&)>;

// Records in a file which steps of a run are done, so that an interrupted run
// continues, and a run with other inputs restarts at the first step that they
// affect. A step depends on all steps before it.
class RunManifest {
 public:
  enum class State {
    kDone,     // with these inputs: nothing to do
    kBegun,    // with these inputs, and not finished: continue
    kChanged,  // done or begun with other inputs: results are outdated
    kNew,
  };

  struct Step {
    std::string name;
    StepInputs inputs;
    bool is_done = false;
    double seconds = 0.0;  // of the run that finished it
  };

  // No file: no steps. An error for a file that is not a manifest.
  static StatusOr<RunManifest> Read(const std::string& path);

  State GetState(const std::string& name, const StepInputs& inputs) const;
  // For a changed step, for example "max_num_features is '2000', was '1000'".
  std::string DescribeChange(const std::string& name,
                             const StepInputs& inputs) const;
  // Both write the file immediately. Begin removes the steps after this one.
  Status Begin(const std::string& name, const StepInputs& inputs);
  Status Finish(const std::string& name, double seconds);
  // Removes all steps but this one.
  Status KeepOnly(const std::string& name);

  struct StepActions {
    // Removes results of other inputs; not called if the step was begun with
    // these.
    std::function<Status()> reset;
    // Does the step, continuing from existing results.
    std::function<Status()> work;
    // Checks that the result exists and is complete; the error names what is
    // missing.
    std::function<Status()> check;
  };

  // Does the step, unless it is done with these inputs and `check` succeeds. An
  // error when `check` fails after the work; the step is then not done. Returns
  // the duration of the step in seconds, in this run or an earlier one.
  StatusOr<double> Run(const std::string& name, const StepInputs& inputs,
                       const StepActions& actions,
                       const MessageCallback& message);

  const std::vector<Step>& Steps() const { return steps_; }

 private:
  const Step* Find(const std::string& name) const;
  Status Write() const;

  std::string path_;
  std::vector<Step> steps_;  // in the order of their first beginning
};

}  // namespace adasfm
