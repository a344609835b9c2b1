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

// What a step has to say, for the user: lines of text.
using MessageCallback = std::function<void(const std::string&)>;

// Which steps of a run are done, in a file, so that a run that was interrupted
// continues and one with other inputs starts at the first step that they
// change. A step depends on all steps before it.
class StepJournal {
 public:
  enum class State {
    kDone,     // with these inputs: nothing to do
    kBegun,    // with these inputs, and not finished: continue
    kChanged,  // done or begun with other inputs: what it left is outdated
    kNew,
  };

  struct Step {
    std::string name;
    StepInputs inputs;
    bool is_done = false;
    double seconds = 0.0;  // of the run that finished it
  };

  // No file: no steps. An error for a file that is not a journal.
  static StatusOr<StepJournal> Read(const std::string& path);

  State GetState(const std::string& name, const StepInputs& inputs) const;
  // "max_num_features is 2000, was 1000", for a changed step.
  std::string DescribeChange(const std::string& name,
                             const StepInputs& inputs) const;
  // Written at once. Begin forgets the steps after this one.
  Status Begin(const std::string& name, const StepInputs& inputs);
  Status Finish(const std::string& name, double seconds);
  // Forgets all steps but this one.
  Status KeepOnly(const std::string& name);

  struct StepActions {
    // Removes what other inputs left, unless the step was begun with these.
    std::function<Status()> reset;
    // Does the step, continuing from what is there.
    std::function<Status()> work;
    // Whether the result is there and whole; an error says what is missing.
    std::function<Status()> check;
  };

  // Does the step, unless it is done with these inputs and its result is there.
  // What `check` misses after the work is an error, and the step is not done.
  // Returns the seconds that it took, now or then.
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
