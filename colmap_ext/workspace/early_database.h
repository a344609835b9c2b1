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
// programs do not wait for each other's transactions. It contains the same
// cameras and images, in the host's form, the features of the images in
// progress, and the matches so far.

inline std::string EarlyDatabasePath(const std::string& workspace_path) {
  return workspace_path + "/early.db";
}

// Creates the early database, unless it exists with the same inputs: a text of
// all that the matches depend on. Creates it completely or not at all. Throws
// SqliteError, also when reading would block the host's writing.
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
  // Makes the early database contain the features of exactly these images.
  void Hold(const std::set<image_t>& image_ids);

 private:
  SqliteConnection early_;
};

// Moves the matches and two-view geometries into the workspace's database and
// removes the early one. Returns the number of pairs: 0 without an early
// database, and for one with other inputs or of another COLMAP. Existing rows
// of the workspace's database stay.
StatusOr<int> TakeEarlyMatches(const std::string& early_path,
                               const std::string& inputs,
                               const std::string& database_path);

Status RemoveEarlyDatabase(const std::string& early_path);

}  // namespace adasfm
