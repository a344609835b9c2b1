// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <set>
#include <string>

#include "core/sqlite.h"
#include "core/status.h"
#include "core/types.h"

namespace adasfm {

// A database beside that of the workspace, in which pairs are matched while
// features are still being written to the other one: COLMAP's classes and
// programs do not wait for each other's transactions. It holds the same cameras
// and images, in the form that the host gave them, the features of the images
// at hand, and the matches so far.

inline std::string EarlyDatabasePath(const std::string& workspace_path) {
  return workspace_path + "/early.db";
}

// Makes it, unless it is there with the same inputs: a text that tells what the
// matches depend on. Whole, or not at all. Throws SqliteError, also when
// reading would keep the host from writing.
void OpenEarlyDatabase(const std::string& database_path,
                       const std::string& inputs,
                       const std::string& early_path);

// A connection to the early database that also reads the workspace's.
class EarlyFeatures {
 public:
  // Throws SqliteError, as all methods do.
  EarlyFeatures(const std::string& early_path,
                const std::string& database_path);

  // The images with keypoints and descriptors in the workspace's database.
  std::set<image_t> FindReady();
  // Has the early one hold the features of these images and no others.
  void Hold(const std::set<image_t>& image_ids);

 private:
  SqliteConnection early_;
};

// Moves the matches and two-view geometries into the workspace's database and
// removes the early one. Returns the number of pairs: 0 if there is no early
// database, or one of other inputs or another COLMAP's. What is in the
// workspace's database already stays.
StatusOr<int> TakeEarlyMatches(const std::string& early_path,
                               const std::string& inputs,
                               const std::string& database_path);

Status RemoveEarlyDatabase(const std::string& early_path);

}  // namespace adasfm
