// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace adasfm {

// Contents of a COLMAP database that determine its ids in a merged one.
struct DatabaseKeys {
  struct Image {
    // With the prefix of its database.
    std::string name;
    int64_t camera_id = 0;
  };
  std::string path;
  std::string prefix;
  // All columns of a camera except its id, as text.
  std::map<int64_t, std::string> cameras;
  std::map<int64_t, Image> images;
  // COLMAP 3.12 and later: the reference camera of each rig, the images of each
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

// Assigns the ids of all inputs in a merged database that already has the ids
// of `target` (empty for a new database). The result is in the order of the
// inputs; the ids do not depend on this order.
//
// Images of equal names become one image, and their cameras one camera. With
// share_cameras, equal cameras of inputs of the same prefix become one, too.
// The target's ids stay; new images get the following ids in order of their
// names, and new cameras, rigs and frames in order of their first image. Throws
// SqliteError when inputs contradict each other: two prefixes give one name, or
// one image has different cameras.
std::vector<MergedIds> AssignMergedIds(const DatabaseKeys& target,
                                       const std::vector<DatabaseKeys>& inputs,
                                       bool share_cameras);

}  // namespace adasfm
