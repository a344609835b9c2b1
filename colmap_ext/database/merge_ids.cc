// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/database/merge_ids.h"

#include <algorithm>
#include <limits>
#include <set>
#include <tuple>

#include "core/disjoint_sets.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

// COLMAP's number for sensors that are cameras.
constexpr int64_t kCameraSensor = 0;

void ReadCameraKeys(SqliteConnection* database, DatabaseKeys* keys) {
  std::vector<std::string> columns = database->Columns("cameras");
  std::sort(columns.begin(), columns.end());
  std::string content = "''";
  for (const std::string& column : columns) {
    if (column != "camera_id") content += " || quote(" + column + ") || ' '";
  }
  SqliteStatement statement(database,
                            "SELECT camera_id, " + content + " FROM cameras");
  while (statement.Step()) keys->cameras[statement.Int(0)] = statement.Text(1);
}

void RequireCamera(int64_t sensor_type, const std::string& table) {
  if (sensor_type == kCameraSensor) return;
  throw SqliteError("table " + table +
                    " has sensors that are no cameras, which this program "
                    "cannot merge");
}

void ReadFrameKeys(SqliteConnection* database, DatabaseKeys* keys) {
  if (!database->HasTable("rigs")) return;
  SqliteStatement rigs(
      database, "SELECT rig_id, ref_sensor_id, ref_sensor_type FROM rigs");
  while (rigs.Step()) {
    RequireCamera(rigs.Int(2), "rigs");
    keys->rigs[rigs.Int(0)] = rigs.Int(1);
  }
  SqliteStatement frames(
      database, "SELECT frame_id, data_id, sensor_type FROM frame_data");
  while (frames.Step()) {
    RequireCamera(frames.Int(2), "frame_data");
    keys->frames[frames.Int(0)].push_back(frames.Int(1));
  }
}

// Gives ids to the images of all databases by name.
class ImageIds {
 public:
  ImageIds(const DatabaseKeys& target,
           const std::vector<DatabaseKeys>& inputs) {
    int64_t last = 0;
    for (const auto& [id, image] : target.images) {
      ids_[image.name] = id;
      last = std::max(last, id);
    }
    std::map<std::string, std::string> prefix_of_name;
    for (const DatabaseKeys& input : inputs) {
      for (const auto& [id, image] : input.images) {
        const auto [found, is_new] =
            prefix_of_name.emplace(image.name, input.prefix);
        if (is_new || found->second == input.prefix) continue;
        throw SqliteError("the prefixes '" + found->second + "' and '" +
                          input.prefix + "' both give the image name " +
                          image.name);
      }
    }
    for (const auto& [name, prefix] : prefix_of_name) {
      if (ids_.count(name) == 0) ids_[name] = ++last;
    }
  }
  int64_t operator()(const std::string& name) const { return ids_.at(name); }

 private:
  std::map<std::string, int64_t> ids_;
};

// A camera of an input.
struct CameraEntry {
  size_t input = 0;
  int64_t old_id = 0;
  // Smallest id of its images in the merged database; the maximum without
  // images.
  int64_t first_image = std::numeric_limits<int64_t>::max();
  // Id of the camera that its images have in the target; 0 for none.
  int64_t target_id = 0;
};

// Gives ids to the cameras of all inputs.
class CameraIds {
 public:
  CameraIds(const DatabaseKeys& target, const std::vector<DatabaseKeys>& inputs,
            const std::vector<MergedIds>& images, bool share_cameras)
      : target_(target), inputs_(inputs) {
    for (const auto& [id, image] : target.images) {
      target_by_content_[target.cameras.at(image.camera_id)][image.name] =
          image.camera_id;
    }
    for (size_t i = 0; i < inputs.size(); ++i) AddEntries(i, images[i]);
    DisjointSets sets = JoinEntries(images, share_cameras);
    std::map<int, std::vector<const CameraEntry*>> groups;
    for (size_t i = 0; i < entries_.size(); ++i) {
      groups[sets.Find(i)].push_back(&entries_[i]);
    }
    std::vector<std::vector<const CameraEntry*>> sorted;
    for (auto& [root, group] : groups) sorted.push_back(std::move(group));
    const auto first_image = [this](const auto& group) {
      int64_t first = group.front()->first_image;
      for (const CameraEntry* entry : group) {
        first = std::min(first, entry->first_image);
      }
      return std::make_tuple(first, Content(*group.front()));
    };
    std::sort(sorted.begin(), sorted.end(), [&](const auto& a, const auto& b) {
      return first_image(a) < first_image(b);
    });
    int64_t last = target.cameras.empty() ? 0 : target.cameras.rbegin()->first;
    for (const auto& group : sorted) AssignGroup(group, share_cameras, &last);
  }

  const std::map<int64_t, int64_t>& OfInput(size_t input) const {
    return ids_.at(input);
  }

 private:
  const std::string& Content(const CameraEntry& entry) const {
    return inputs_[entry.input].cameras.at(entry.old_id);
  }

  void AddEntries(size_t input, const MergedIds& images) {
    ids_[input];
    std::map<int64_t, CameraEntry> entries;
    for (const auto& [old_id, content] : inputs_[input].cameras) {
      entries[old_id].input = input;
      entries[old_id].old_id = old_id;
    }
    for (const auto& [image_id, image] : inputs_[input].images) {
      const auto entry = entries.find(image.camera_id);
      if (entry == entries.end()) {
        throw SqliteError(inputs_[input].path + ": image " + image.name +
                          " has no camera");
      }
      const int64_t new_id = images.images.at(image_id);
      entry->second.first_image = std::min(entry->second.first_image, new_id);
      const auto known = target_.images.find(new_id);
      if (known == target_.images.end()) continue;
      const int64_t camera_id = known->second.camera_id;
      CheckSameCamera(image.name, target_.cameras.at(camera_id),
                      Content(entry->second), target_.path,
                      inputs_[input].path);
      entry->second.target_id = camera_id;
    }
    for (const auto& [old_id, entry] : entries) entries_.push_back(entry);
  }

  static void CheckSameCamera(const std::string& image, const std::string& a,
                              const std::string& b, const std::string& path_a,
                              const std::string& path_b) {
    if (a == b) return;
    throw SqliteError("image " + image + " has another camera in " + path_a +
                      " than in " + path_b);
  }

  // Joins the entries that are one camera.
  DisjointSets JoinEntries(const std::vector<MergedIds>& images,
                           bool share_cameras) const {
    DisjointSets sets(entries_.size());
    std::map<std::pair<std::string, std::string>, int> by_content;
    std::map<std::pair<size_t, int64_t>, int> by_old_id;
    for (size_t i = 0; i < entries_.size(); ++i) {
      by_old_id[{entries_[i].input, entries_[i].old_id}] = i;
      if (!share_cameras) continue;
      const auto [found, is_new] =
          by_content.emplace(std::make_pair(inputs_[entries_[i].input].prefix,
                                            Content(entries_[i])),
                             i);
      if (!is_new) sets.Join(i, found->second);
    }
    std::map<int64_t, int> by_image;
    for (size_t input = 0; input < inputs_.size(); ++input) {
      for (const auto& [image_id, image] : inputs_[input].images) {
        const int entry = by_old_id.at({input, image.camera_id});
        const auto [found, is_new] =
            by_image.emplace(images[input].images.at(image_id), entry);
        if (is_new) continue;
        CheckSameCamera(image.name, Content(entries_[found->second]),
                        Content(entries_[entry]),
                        inputs_[entries_[found->second].input].path,
                        inputs_[input].path);
        sets.Join(entry, found->second);
      }
    }
    return sets;
  }

  // The equal camera of the target's images with this prefix; 0 for none.
  int64_t FindShared(const CameraEntry& entry) const {
    const auto equal = target_by_content_.find(Content(entry));
    if (equal == target_by_content_.end()) return 0;
    const std::string& prefix = inputs_[entry.input].prefix;
    const auto image = equal->second.lower_bound(prefix);
    return image != equal->second.end() && image->first.rfind(prefix, 0) == 0
               ? image->second
               : 0;
  }

  void AssignGroup(const std::vector<const CameraEntry*>& group,
                   bool share_cameras, int64_t* last) {
    int64_t id = 0;
    for (const CameraEntry* entry : group) {
      if (entry->target_id == 0) continue;
      id = id == 0 ? entry->target_id : std::min(id, entry->target_id);
    }
    if (id == 0 && share_cameras) id = FindShared(*group.front());
    if (id == 0) id = ++*last;
    for (const CameraEntry* entry : group) {
      ids_[entry->input][entry->old_id] =
          entry->target_id != 0 ? entry->target_id : id;
    }
  }

  const DatabaseKeys& target_;
  const std::vector<DatabaseKeys>& inputs_;
  // The camera of every image of the target, by the camera's content and the
  // image's name.
  std::map<std::string, std::map<std::string, int64_t>> target_by_content_;
  std::vector<CameraEntry> entries_;
  std::map<size_t, std::map<int64_t, int64_t>> ids_;
};

// Assigns new ids to rigs and frames, which are identified by a key. The
// target's keep their ids; the others follow in the order of their keys.
class KeyedIds {
 public:
  void AddKnown(int64_t key, int64_t id) {
    ids_[key] = id;
    last_ = std::max(last_, id);
  }
  void AddNew(const std::set<int64_t>& keys) {
    for (const int64_t key : keys) {
      if (ids_.count(key) == 0) ids_[key] = ++last_;
    }
  }
  bool Has(int64_t key) const { return ids_.count(key) > 0; }
  int64_t operator()(int64_t key) const { return ids_.at(key); }

 private:
  std::map<int64_t, int64_t> ids_;
  int64_t last_ = 0;
};

// A rig is identified by its reference camera.
void AssignRigs(const DatabaseKeys& target,
                const std::vector<DatabaseKeys>& inputs,
                std::vector<MergedIds>* merged) {
  KeyedIds new_ids;
  for (const auto& [id, camera] : target.rigs) new_ids.AddKnown(camera, id);
  std::set<int64_t> cameras;
  for (size_t i = 0; i < inputs.size(); ++i) {
    for (const auto& [id, camera] : inputs[i].rigs) {
      cameras.insert((*merged)[i].cameras.at(camera));
    }
  }
  new_ids.AddNew(cameras);
  for (size_t i = 0; i < inputs.size(); ++i) {
    MergedIds& ids = (*merged)[i];
    for (const auto& [id, camera] : inputs[i].rigs) {
      ids.rigs[id] = new_ids(ids.cameras.at(camera));
    }
  }
}

// The image that identifies a frame: one that is in a frame of the target or,
// for a new frame, its first image.
int64_t FrameKey(const std::vector<int64_t>& images, const MergedIds& ids,
                 const KeyedIds& known) {
  int64_t first = std::numeric_limits<int64_t>::max();
  for (const int64_t image : images) {
    const auto id = ids.images.find(image);
    if (id == ids.images.end()) {
      throw SqliteError("table frame_data names an image that is missing");
    }
    if (known.Has(id->second)) return id->second;
    first = std::min(first, id->second);
  }
  return first;
}

void AssignFrames(const DatabaseKeys& target,
                  const std::vector<DatabaseKeys>& inputs,
                  std::vector<MergedIds>* merged) {
  KeyedIds known;
  for (const auto& [id, images] : target.frames) {
    for (const int64_t image : images) known.AddKnown(image, id);
  }
  std::set<int64_t> keys;
  for (size_t i = 0; i < inputs.size(); ++i) {
    for (const auto& [id, images] : inputs[i].frames) {
      keys.insert(FrameKey(images, (*merged)[i], known));
    }
  }
  KeyedIds new_ids = known;
  new_ids.AddNew(keys);
  for (size_t i = 0; i < inputs.size(); ++i) {
    MergedIds& ids = (*merged)[i];
    for (const auto& [id, images] : inputs[i].frames) {
      ids.frames[id] = new_ids(FrameKey(images, ids, known));
    }
  }
}

}  // namespace

DatabaseKeys ReadDatabaseKeys(const std::string& path,
                              const std::string& prefix) {
  try {
    DatabaseKeys keys;
    keys.path = path;
    keys.prefix = prefix;
    SqliteConnection database(path, SqliteConnection::Mode::kRead);
    ReadCameraKeys(&database, &keys);
    SqliteStatement images(&database,
                           "SELECT image_id, name, camera_id FROM images");
    while (images.Step()) {
      keys.images[images.Int(0)] = {prefix + images.Text(1), images.Int(2)};
    }
    ReadFrameKeys(&database, &keys);
    return keys;
  } catch (const SqliteError& error) {
    throw SqliteError(path + ": " + error.what());
  }
}

std::vector<MergedIds> AssignMergedIds(const DatabaseKeys& target,
                                       const std::vector<DatabaseKeys>& inputs,
                                       bool share_cameras) {
  std::vector<MergedIds> merged(inputs.size());
  const ImageIds image_ids(target, inputs);
  for (size_t i = 0; i < inputs.size(); ++i) {
    for (const auto& [id, image] : inputs[i].images) {
      merged[i].images[id] = image_ids(image.name);
    }
  }
  const CameraIds camera_ids(target, inputs, merged, share_cameras);
  for (size_t i = 0; i < inputs.size(); ++i) {
    merged[i].cameras = camera_ids.OfInput(i);
  }
  AssignRigs(target, inputs, &merged);
  AssignFrames(target, inputs, &merged);
  return merged;
}

}  // namespace adasfm
