// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/status.h"

namespace adasfm {

// Merges COLMAP databases: shards of one list of images (features of some, or
// matches of some pairs), or sessions whose names are distinguished by
// prefixes.

struct DatabaseToMerge {
  std::string path;
  // Prepended to the names of its images, for example "monday/".
  std::string prefix;
};

struct MergeDatabasesOptions {
  // Merges equal cameras (model, size, parameters) of databases with the same
  // prefix, for example of shards whose photos one camera took.
  bool share_cameras = true;
};

// Name of the lock (folder_lock.h) in the output's folder.
inline constexpr char kMergerLockName[] = ".adasfm_merger.lock";

struct MergedDatabase {
  // Contents of the output.
  int64_t num_cameras = 0;
  int64_t num_images = 0;
  int64_t num_keypoint_rows = 0;
  int64_t num_match_rows = 0;
  int64_t num_verified_pairs = 0;
  // Rows that the inputs added.
  int64_t num_new_rows = 0;
};

// Writes all rows of the inputs' COLMAP and adasfm_ tables with new ids
// (merge_ids.h); where the images of a pair change their order, the row's
// values are swapped. A new output gets the tables of the inputs and appears
// when it is complete. Merging into an existing output is one transaction and
// keeps its ids; merging the same inputs again changes nothing. The result does
// not depend on the order of the inputs.
//
// Works on columns, without COLMAP's library, on databases of COLMAP 3.6 to 4.2
// that all have the same columns. An error, and no change, for other columns or
// tables, for differing rows of the same image or pair, and for databases that
// adasfm_global has rewritten. Only one run at a time may write into a folder;
// the error of a second run names the first.
StatusOr<MergedDatabase> MergeDatabases(
    const MergeDatabasesOptions& options,
    const std::vector<DatabaseToMerge>& inputs, const std::string& output_path);

}  // namespace adasfm
