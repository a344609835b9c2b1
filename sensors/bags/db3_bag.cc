// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/bags/db3_bag.h"

#include <map>
#include <utility>

#include "core/sqlite.h"
#include "sensors/bags/decompress.h"

namespace adasfm {
namespace {

// Far above the size of any message; a larger one is damaged.
constexpr uint64_t kMaxMessageBytes = 256u << 20;

class Db3Bag : public BagReader {
 public:
  explicit Db3Bag(const std::string& path)
      : path_(path), database_(path, SqliteConnection::Mode::kRead) {}

  Status Open();
  const std::vector<BagTopic>& Topics() const override { return topics_; }
  Status Read(const std::set<std::string>& topics, const BagVisitor& visit,
              std::vector<std::string>* warnings) override;

 private:
  std::string path_;
  SqliteConnection database_;
  std::map<int64_t, BagTopic> topics_by_id_;
  std::vector<BagTopic> topics_;
};

Status Db3Bag::Open() {
  if (!database_.HasTable("topics") || !database_.HasTable("messages")) {
    return Status::Error(path_ +
                         ": an SQLite file, but no rosbag2 recording (it has "
                         "no tables topics and messages)");
  }
  SqliteStatement statement(
      &database_,
      "SELECT id, name, type, serialization_format FROM topics WHERE EXISTS "
      "(SELECT 1 FROM messages WHERE topic_id = topics.id)");
  while (statement.Step()) {
    if (statement.Text(3) != "cdr") continue;
    const BagTopic topic{statement.Text(1), NormalizeRosType(statement.Text(2)),
                         RosEncoding::kCdr};
    topics_by_id_[statement.Int(0)] = topic;
    topics_.push_back(topic);
  }
  SortTopics(&topics_);
  return Status::Ok();
}

Status Db3Bag::Read(const std::set<std::string>& topics,
                    const BagVisitor& visit,
                    std::vector<std::string>* warnings) {
  std::vector<uint8_t> decompressed;
  int num_bad = 0;
  // Without ORDER BY, so that a damaged file is read as far as possible.
  try {
    SqliteStatement statement(&database_,
                              "SELECT topic_id, data FROM messages");
    while (statement.Step()) {
      const auto topic = topics_by_id_.find(statement.Int(0));
      if (topic == topics_by_id_.end()) continue;
      if (topics.count(topic->second.name) == 0) continue;
      ByteSpan bytes{static_cast<const uint8_t*>(statement.Blob(1)),
                     statement.NumBytes(1)};
      if (IsZstd(bytes)) {
        if (!Decompress("zstd", bytes, kMaxMessageBytes, &decompressed)
                 .empty()) {
          ++num_bad;
          continue;
        }
        bytes = {decompressed.data(), decompressed.size()};
      }
      const Status status = visit({&topic->second, bytes});
      if (!status.ok()) return status;
    }
  } catch (const SqliteError& error) {
    warnings->push_back(path_ + ": cut short or damaged (" + error.what() +
                        "); what could be read before is used");
  }
  if (num_bad > 0) {
    warnings->push_back(path_ + ": " + std::to_string(num_bad) +
                        " damaged messages are left out");
  }
  return Status::Ok();
}

}  // namespace

StatusOr<std::unique_ptr<BagReader>> OpenDb3Bag(const std::string& path) {
  try {
    auto bag = std::make_unique<Db3Bag>(path);
    const Status status = bag->Open();
    if (!status.ok()) return status;
    return std::unique_ptr<BagReader>(std::move(bag));
  } catch (const SqliteError& error) {
    return Status::Error(path + ": cannot be read as a rosbag2 recording (" +
                         error.what() + ")");
  }
}

}  // namespace adasfm
