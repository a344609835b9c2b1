// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace adasfm {

// What of a COLMAP database decides about its ids in a merged one.
struct DatabaseKeys {
  struct Image {
    // With the prefix of its database.
    std::string name;
    int64_t camera_id = 0;
  };
  std::string path;
  std::string prefix;
  // All columns of a camera but its id, as text.
  std::map<int64_t, std::string> cameras;
  std::map<int64_t, Image> images;
  // COLMAP 3.12 and later: the reference camera of a rig, the images of a
  // frame.
  std::map<int64_t, int64_t> rigs;
  std::map<int64_t, std::vector<int64_t>> frames;
};

// Throws SqliteError, naming the database.
DatabaseKeys ReadDatabaseKeys(const std::string& path,
                              const std::string& prefix);

// The new id of every old one.
struct MergedIds {
  std::map<int64_t, int64_t> cameras;
  std::map<int64_t, int64_t> images;
  std::map<int64_t, int64_t> rigs;
  std::map<int64_t, int64_t> frames;
};

// The ids of every input in a database that has those of `target` already
// (empty for a new one) and all inputs; in the order of the inputs, on which
// the ids themselves do not depend.
//
// Images of equal names are one image, and their cameras one camera. With
// share_cameras, equal cameras of inputs of the same prefix are one too. The
// target's ids stay; new images are numbered behind them by name, and new
// cameras, rigs and frames by their first image. Throws SqliteError when inputs
// contradict each other: two prefixes give one name, or one image has cameras
// that differ.
std::vector<MergedIds> AssignMergedIds(const DatabaseKeys& target,
                                       const std::vector<DatabaseKeys>& inputs,
                                       bool share_cameras);

}  // namespace adasfm
