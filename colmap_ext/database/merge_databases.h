// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// Joins COLMAP databases into one: shards of one list of images (features of
// some, or matches of some pairs), or sessions whose names a prefix keeps
// apart.

struct DatabaseToMerge {
  std::string path;
  // Put before the names of its images, as "monday/".
  std::string prefix;
};

struct MergeDatabasesOptions {
  // Equal cameras (model, size, parameters) of databases of the same prefix
  // become one, as those of shards whose photos one camera took.
  bool share_cameras = true;
};

// Of the lock (folder_lock.h) in the output's folder.
inline constexpr char kMergerLockName[] = ".adasfm_merger.lock";

struct MergedDatabase {
  // What the output has.
  int64_t num_cameras = 0;
  int64_t num_images = 0;
  int64_t num_keypoint_rows = 0;
  int64_t num_match_rows = 0;
  int64_t num_verified_pairs = 0;
  // What the inputs added.
  int64_t num_new_rows = 0;
};

// Writes all rows of the inputs, COLMAP's and the adasfm_ tables', with new ids
// (merge_ids.h); a pair whose images change their order is turned round. A new
// output gets the tables of the inputs and appears when it is complete; an
// existing one is joined into in one transaction, its ids stay, and joining the
// same again changes nothing. The result does not depend on the order of the
// inputs.
//
// Works by columns and without COLMAP's library, on databases of COLMAP 3.6 to
// 4.2 that all have the same columns. An error, and no change, for other
// columns or tables, for rows of the same image or pair that differ, and for
// databases that adasfm_global has rewritten. One run at a time writes into a
// folder; a second one is an error that names the first.
StatusOr<MergedDatabase> MergeDatabases(
    const MergeDatabasesOptions& options,
    const std::vector<DatabaseToMerge>& inputs, const std::string& output_path);

}  // namespace adasfm
