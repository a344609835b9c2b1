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
  // Of the database beside it, and the text that tells what the matches depend
  // on (early_database.h).
  std::string early_path;
  std::string inputs;
  std::string log_path;
  // Writes what the logs tell of the motion into a database; empty: no logs.
  std::function<Status(const std::string& database_path)> import_priors;
  // Fewer pairs are left until more are ready: starting the host's program
  // takes a second.
  size_t min_num_pairs = 100;
};

// Matches pairs whose images are ready while features of others are being
// extracted, on what the extraction leaves idle of the machine: the processor
// while a GPU extracts or photos come from a slow disk.
// Inputs: the pairs that are known without features: neighbours in time, and
// those that the odometry predicts. They are among those that are matched
// afterwards, so that the result is the same with and without.
// Method: a thread of low priority, which copies the features that are ready
// into the early database and matches there.
// On failure it ends and says nothing: the matching afterwards does what is
// missing, and says what is wrong.
class EarlyMatcher {
 public:
  explicit EarlyMatcher(EarlyMatchingRequest request)
      : request_(std::move(request)) {}
  // Ends the work; what is finished stays in the early database.
  ~EarlyMatcher();
  EarlyMatcher(const EarlyMatcher&) = delete;
  EarlyMatcher& operator=(const EarlyMatcher&) = delete;

  // To be called when features have been written: from then on the host has the
  // workspace's database open, and in its own form. Further calls do nothing.
  void Start();

  // Waits for the pairs at hand, and begins no others.
  void Finish();

  // Pairs matched along their predicted epipolar lines; after Finish.
  int NumGuided() const { return num_guided_; }

 private:
  // Finishing lets the pairs at hand be finished, stopping does not.
  enum class State { kRunning, kFinishing, kStopping };

  void Run();
  Status Work();
  // Until there is something to do; false when it is over.
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
