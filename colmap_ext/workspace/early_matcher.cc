// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/early_matcher.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <set>
#include <system_error>

#include "colmap_ext/pairs/predict_motions.h"
#include "colmap_ext/workspace/early_database.h"
#include "core/interruption.h"

namespace adasfm {
namespace {

// Bounds the time until the pairs in progress are done when extraction ends.
constexpr size_t kMaxNumPairs = 500;
constexpr std::chrono::milliseconds kPollInterval(500);

// The extraction has priority, since the matching depends on it: the threads
// and programs that this thread starts get a third of the time of the
// extraction's threads, and all idle time. With a lower priority the pairs in
// progress would delay the end on a machine that does other work.
void LowerPriorityOfThread() {
#ifdef __linux__
  // Affects the calling thread only.
  if (nice(5) == -1) return;
#endif
}

// Moves pairs whose images are both ready from `remaining` to `batch`.
void TakeReady(const std::set<image_t>& ready,
               std::vector<ImagePair>* remaining,
               std::vector<ImagePair>* batch) {
  std::vector<ImagePair> others;
  for (const ImagePair& pair : *remaining) {
    const bool is_taken = batch->size() < kMaxNumPairs &&
                          ready.count(pair.image_id1) > 0 &&
                          ready.count(pair.image_id2) > 0;
    (is_taken ? *batch : others).push_back(pair);
  }
  *remaining = std::move(others);
}

}  // namespace

EarlyMatcher::~EarlyMatcher() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_ = State::kStopping;
  }
  changed_.notify_all();
  thread_.join();
}

void EarlyMatcher::Start() {
  if (thread_.joinable() || !IsRunning()) return;
  try {
    thread_ = std::thread([this] { Run(); });
  } catch (const std::system_error&) {
    // The system has no thread left; the next call may succeed.
  }
}

void EarlyMatcher::Finish() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    state_ = State::kFinishing;
  }
  changed_.notify_all();
  thread_.join();
}

bool EarlyMatcher::IsRunning() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return state_ == State::kRunning;
}

void EarlyMatcher::Run() {
  LowerPriorityOfThread();
  try {
    Work();
  } catch (const Interruption&) {
  } catch (const std::exception&) {
  }
}

Status EarlyMatcher::Work() {
  const std::string& path = request_.early_path;
  OpenEarlyDatabase(request_.database_path, request_.inputs, path);
  MotionPredictor predictor;
  if (request_.import_priors) {
    const Status imported = request_.import_priors(path);
    if (!imported.ok()) return imported;
    if (request_.guided_matching) {
      StatusOr<MotionPredictor> read = ReadMotionPredictor(path);
      if (!read.ok()) return read.status();
      predictor = std::move(read).value();
    }
  }
  PairSelectionOptions options = request_.pairs;
  options.use_similarity = false;
  const StatusOr<PairSelection> selection = SelectPairs(options, path);
  if (!selection.ok()) return selection.status();
  std::vector<ImagePair> remaining = selection->pairs;
  // The host's program may finish the pairs that it was given.
  const auto stop_if_told = [this](const std::string&, double share_done) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (state_ == State::kStopping) throw Interruption();
    if (state_ == State::kFinishing && share_done > 0.0) throw Interruption();
    ThrowIfInterrupted();
  };
  std::vector<ImagePair> batch;
  while (WaitForPairs(&remaining, &batch)) {
    int num_guided = 0;
    const Status status =
        MatchPairs(request_.features, batch, path, request_.log_path,
                   stop_if_told, predictor, &num_guided);
    num_guided_ += num_guided;
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

bool EarlyMatcher::WaitForPairs(std::vector<ImagePair>* remaining,
                                std::vector<ImagePair>* batch) {
  while (!remaining->empty() && IsRunning()) {
    {
      EarlyFeatures features(request_.early_path, request_.database_path);
      const std::set<image_t> ready = features.FindReady();
      batch->clear();
      std::vector<ImagePair> others = *remaining;
      TakeReady(ready, &others, batch);
      if (batch->size() >=
          std::min(request_.min_num_pairs, remaining->size())) {
        *remaining = std::move(others);
        std::set<image_t> image_ids;
        for (const ImagePair& pair : *batch) {
          image_ids.insert({pair.image_id1, pair.image_id2});
        }
        features.Hold(image_ids);
        return true;
      }
    }
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, kPollInterval,
                      [this] { return state_ != State::kRunning; });
  }
  return false;
}

}  // namespace adasfm
