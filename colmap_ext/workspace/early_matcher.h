// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "colmap_ext/host/features.h"
#include "colmap_ext/pairs/select_pairs.h"
#include "core/status.h"

namespace adasfm {

struct EarlyMatchingRequest {
  FeatureOptions features;
  PairSelectionOptions pairs;
  bool guided_matching = false;
  std::string database_path;
  // Path of the early database, and the text of all that the matches depend on
  // (early_database.h).
  std::string early_path;
  std::string inputs;
  std::string log_path;
  // Imports priors of the motion logs into a database; empty: no logs.
  std::function<Status(const std::string& database_path)> import_priors;
  // Waits for more pairs below this number: starting the host's program takes a
  // second.
  size_t min_num_pairs = 100;
};

// Matches pairs whose images are ready while features of others are being
// extracted, on idle resources of the machine: the processor while a GPU
// extracts or photos come from a slow disk.
// Inputs: the pairs that are known without features: neighbours in time, and
// those that the odometry predicts. The later matching includes these pairs, so
// that the result is the same with and without this class.
// Method: a thread of low priority copies the features that are ready into the
// early database and matches there.
// On failure it ends without a message: the later matching does what is missing
// and reports the error.
class EarlyMatcher {
 public:
  explicit EarlyMatcher(EarlyMatchingRequest request)
      : request_(std::move(request)) {}
  // Stops the work; finished work stays in the early database.
  ~EarlyMatcher();
  EarlyMatcher(const EarlyMatcher&) = delete;
  EarlyMatcher& operator=(const EarlyMatcher&) = delete;

  // Call this when features have been written: the host then has the
  // workspace's database open, in its own form. Further calls do nothing.
  void Start();

  // Waits for the pairs in progress and starts no others.
  void Finish();

  // Number of pairs matched along their predicted epipolar lines; call after
  // Finish.
  int NumGuided() const { return num_guided_; }

 private:
  // kFinishing completes the pairs in progress, kStopping does not.
  enum class State { kRunning, kFinishing, kStopping };

  void Run();
  Status Work();
  // Waits until there is work; false when there will be none.
  bool WaitForPairs(std::vector<ImagePair>* remaining,
                    std::vector<ImagePair>* batch);
  bool IsRunning();

  const EarlyMatchingRequest request_;
  std::thread thread_;
  std::mutex mutex_;
  std::condition_variable changed_;
  State state_ = State::kRunning;
  int num_guided_ = 0;
};

}  // namespace adasfm
