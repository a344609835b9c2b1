// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/bags/mcap_bag.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <utility>

#include "sensors/bags/decompress.h"

namespace adasfm {
namespace {

constexpr uint8_t kMagic[] = {0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
constexpr size_t kRecordHeaderBytes = 9;  // opcode and length
constexpr size_t kFooterBytes = 20;
// Far above the size of any chunk; a larger one is damaged.
constexpr uint64_t kMaxChunkBytes = 256u << 20;

enum Opcode : uint8_t {
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kStatistics = 0x0b,
  kDataEnd = 0x0f,
};

struct Record {
  uint8_t opcode = 0;
  ByteSpan content;
};

// The channels defined by the records read so far; only channels with ROS
// messages.
class Channels {
 public:
  void AddSchema(const ByteSpan& content) {
    ByteReader reader(content);
    const uint16_t id = reader.Read<uint16_t>();
    const std::string name = reader.ReadString();
    if (reader.ok()) types_[id] = NormalizeRosType(name);
  }

  void AddChannel(const ByteSpan& content) {
    ByteReader reader(content);
    const uint16_t id = reader.Read<uint16_t>();
    const auto type = types_.find(reader.Read<uint16_t>());
    const std::string name = reader.ReadString();
    const std::string encoding = reader.ReadString();
    if (!reader.ok() || type == types_.end()) return;
    if (encoding != "cdr" && encoding != "ros1") return;
    topics_[id] = {name, type->second,
                   encoding == "cdr" ? RosEncoding::kCdr : RosEncoding::kRos1};
  }

  // Null for a channel that is unknown.
  const BagTopic* Find(uint16_t id) const {
    const auto topic = topics_.find(id);
    return topic == topics_.end() ? nullptr : &topic->second;
  }

  const std::map<uint16_t, BagTopic>& topics() const { return topics_; }

 private:
  std::map<uint16_t, std::string> types_;
  std::map<uint16_t, BagTopic> topics_;
};

// The next record of a chunk; nothing at its end, or where it is damaged.
std::optional<Record> NextRecord(ByteReader* reader) {
  Record record;
  record.opcode = reader->Read<uint8_t>();
  record.content = reader->Take(reader->Read<uint64_t>());
  if (!reader->ok()) return std::nullopt;
  return record;
}

class McapBag : public BagReader {
 public:
  explicit McapBag(const std::string& path) : path_(path) {}

  Status Open();
  const std::vector<BagTopic>& Topics() const override { return topics_; }
  Status Read(const std::set<std::string>& topics, const BagVisitor& visit,
              std::vector<std::string>* warnings) override;

 private:
  struct Damage {
    bool is_cut_short = false;
    uint64_t position = 0;  // of the record where reading ended
    int num_bad_chunks = 0;
    std::string first_cause;
  };
  using MessageVisitor = std::function<Status(uint16_t, const ByteSpan&)>;

  bool ReadSummary();
  bool ReadBytes(uint64_t position, uint64_t size);
  bool ReadRecordHeader(uint64_t position, uint8_t* opcode, uint64_t* length);
  Status Scan(const MessageVisitor& visit, Damage* damage);
  Status VisitRecord(const Record& record, const MessageVisitor& visit,
                     Damage* damage);
  Status VisitChunk(const ByteSpan& content, const MessageVisitor& visit,
                    Damage* damage);

  std::string path_;
  std::ifstream file_;
  uint64_t file_size_ = 0;
  std::vector<uint8_t> buffer_;  // of the record that is read
  std::vector<uint8_t> chunk_;   // decompressed
  Channels channels_;
  std::vector<BagTopic> topics_;
};

// Fills buffer_ with bytes of the file; false when there are fewer.
bool McapBag::ReadBytes(uint64_t position, uint64_t size) {
  if (position > file_size_ || size > file_size_ - position) return false;
  buffer_.resize(size);
  file_.clear();
  file_.seekg(static_cast<std::streamoff>(position));
  file_.read(reinterpret_cast<char*>(buffer_.data()),
             static_cast<std::streamsize>(size));
  return static_cast<uint64_t>(file_.gcount()) == size;
}

bool McapBag::ReadRecordHeader(uint64_t position, uint8_t* opcode,
                               uint64_t* length) {
  if (!ReadBytes(position, kRecordHeaderBytes)) return false;
  ByteReader reader({buffer_.data(), buffer_.size()});
  *opcode = reader.Read<uint8_t>();
  *length = reader.Read<uint64_t>();
  return true;
}

Status McapBag::Open() {
  file_.open(path_, std::ios::binary | std::ios::ate);
  if (!file_) return Status::Error(path_ + ": cannot be read; check the path");
  file_size_ = static_cast<uint64_t>(file_.tellg());
  if (!ReadBytes(0, sizeof(kMagic)) ||
      !std::equal(buffer_.begin(), buffer_.end(), kMagic)) {
    return Status::Error(path_ +
                         ": not an MCAP file (it does not begin as one)");
  }
  std::set<uint16_t> used;
  if (!ReadSummary()) {
    Damage damage;
    const Status status = Scan(
        [&](uint16_t channel, const ByteSpan&) {
          used.insert(channel);
          return Status::Ok();
        },
        &damage);
    if (!status.ok()) return status;
    for (const auto& [id, topic] : channels_.topics()) {
      if (used.count(id) > 0) topics_.push_back(topic);
    }
  }
  SortTopics(&topics_);
  return Status::Ok();
}

// Topics from the records between data and footer. False when there are none.
bool McapBag::ReadSummary() {
  const uint64_t tail = kRecordHeaderBytes + kFooterBytes + sizeof(kMagic);
  if (file_size_ < sizeof(kMagic) + tail) return false;
  const uint64_t footer_position = file_size_ - tail;
  uint8_t opcode = 0;
  uint64_t length = 0;
  if (!ReadRecordHeader(footer_position, &opcode, &length)) return false;
  if (opcode != kFooter || length != kFooterBytes) return false;
  if (!ReadBytes(footer_position + kRecordHeaderBytes, sizeof(uint64_t))) {
    return false;
  }
  const uint64_t start =
      ByteReader({buffer_.data(), buffer_.size()}).Read<uint64_t>();
  if (start == 0 || start >= footer_position) return false;
  if (footer_position - start > kMaxChunkBytes) return false;
  if (!ReadBytes(start, footer_position - start)) return false;
  std::map<uint16_t, uint64_t> counts;
  bool has_counts = false;
  ByteReader records({buffer_.data(), buffer_.size()});
  while (const std::optional<Record> record = NextRecord(&records)) {
    if (record->opcode == kSchema) channels_.AddSchema(record->content);
    if (record->opcode == kChannel) channels_.AddChannel(record->content);
    if (record->opcode == kStatistics) {
      ByteReader reader(record->content);
      // Counts of messages, schemas, channels, attachments, metadata and
      // chunks, and two times.
      reader.Take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8);
      ByteReader entries(reader.Take(reader.Read<uint32_t>()));
      has_counts = reader.ok();
      while (entries.num_left() > 0 && entries.ok()) {
        const uint16_t channel = entries.Read<uint16_t>();
        counts[channel] = entries.Read<uint64_t>();
      }
    }
  }
  for (const auto& [id, topic] : channels_.topics()) {
    if (!has_counts || counts[id] > 0) topics_.push_back(topic);
  }
  return !channels_.topics().empty();
}

Status McapBag::VisitRecord(const Record& record, const MessageVisitor& visit,
                            Damage* damage) {
  switch (record.opcode) {
    case kSchema:
      channels_.AddSchema(record.content);
      break;
    case kChannel:
      channels_.AddChannel(record.content);
      break;
    case kChunk:
      return VisitChunk(record.content, visit, damage);
    case kMessage: {
      ByteReader reader(record.content);
      const uint16_t channel = reader.Read<uint16_t>();
      // Number and two times.
      reader.Take(sizeof(uint32_t) + 2 * sizeof(uint64_t));
      if (reader.ok()) return visit(channel, reader.Take(reader.num_left()));
      break;
    }
    default:
      break;
  }
  return Status::Ok();
}

Status McapBag::VisitChunk(const ByteSpan& content, const MessageVisitor& visit,
                           Damage* damage) {
  ByteReader reader(content);
  reader.Take(2 * sizeof(uint64_t));  // times
  const uint64_t size = reader.Read<uint64_t>();
  const uint32_t crc = reader.Read<uint32_t>();
  const std::string compression = reader.ReadString();
  const uint64_t stored_size = reader.Read<uint64_t>();
  // A chunk that is cut short has fewer bytes than it states; the bytes that
  // exist are read.
  const bool is_cut = stored_size > reader.num_left();
  ByteSpan records =
      reader.Take(std::min<uint64_t>(stored_size, reader.num_left()));
  std::string cause;
  if (!reader.ok()) {
    cause = "its header is cut short";
  } else if (size > kMaxChunkBytes) {
    cause = "it claims " + std::to_string(size) + " bytes";
  } else if (!compression.empty()) {
    // One byte more detects data that are longer than the chunk states.
    cause = Decompress(compression, records, size + 1, &chunk_);
    records = {chunk_.data(), chunk_.size()};
  }
  if (cause.empty() && !is_cut && crc != 0 && ComputeCrc32(records) != crc) {
    cause = "its checksum is another one";
    records = ByteSpan();
  }
  if (!cause.empty() && !is_cut) {
    if (damage->num_bad_chunks++ == 0) damage->first_cause = cause;
    records = ByteSpan();
  }
  ByteReader nested(records);
  while (const std::optional<Record> record = NextRecord(&nested)) {
    if (record->opcode == kChunk) continue;  // chunks hold no chunks
    const Status status = VisitRecord(*record, visit, damage);
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

Status McapBag::Scan(const MessageVisitor& visit, Damage* damage) {
  uint64_t position = sizeof(kMagic);
  while (true) {
    damage->position = position;
    uint8_t opcode = 0;
    uint64_t length = 0;
    if (!ReadRecordHeader(position, &opcode, &length) || opcode == 0) {
      damage->is_cut_short = true;
      return Status::Ok();
    }
    if (opcode == kDataEnd || opcode == kFooter) return Status::Ok();
    position += kRecordHeaderBytes;
    const uint64_t num_left = file_size_ - position;
    const bool is_needed = opcode >= kSchema && opcode <= kChunk;
    if (length > num_left && opcode != kChunk) {
      damage->is_cut_short = true;
      return Status::Ok();
    }
    const uint64_t num_stored = std::min(length, num_left);
    if (is_needed && num_stored > kMaxChunkBytes) {
      if (damage->num_bad_chunks++ == 0) {
        damage->first_cause =
            "a record of " + std::to_string(num_stored) + " bytes";
      }
    } else if (is_needed && ReadBytes(position, num_stored)) {
      // The buffer must not change before the record has been visited.
      const Status status = VisitRecord(
          {opcode, {buffer_.data(), buffer_.size()}}, visit, damage);
      if (!status.ok()) return status;
    }
    position += num_stored;
  }
}

Status McapBag::Read(const std::set<std::string>& topics,
                     const BagVisitor& visit,
                     std::vector<std::string>* warnings) {
  Damage damage;
  const Status status = Scan(
      [&](uint16_t channel, const ByteSpan& bytes) {
        const BagTopic* topic = channels_.Find(channel);
        if (topic == nullptr || topics.count(topic->name) == 0) {
          return Status::Ok();
        }
        return visit({topic, bytes});
      },
      &damage);
  if (!status.ok()) return status;
  if (damage.is_cut_short) {
    warnings->push_back(path_ + ": cut short or damaged at byte " +
                        std::to_string(damage.position) + " of " +
                        std::to_string(file_size_) +
                        "; what stands before is used");
  }
  if (damage.num_bad_chunks > 0) {
    warnings->push_back(path_ + ": " + std::to_string(damage.num_bad_chunks) +
                        " damaged chunks are left out (the first one: " +
                        damage.first_cause + ")");
  }
  return Status::Ok();
}

}  // namespace

StatusOr<std::unique_ptr<BagReader>> OpenMcapBag(const std::string& path) {
  auto bag = std::make_unique<McapBag>(path);
  const Status status = bag->Open();
  if (!status.ok()) return status;
  return std::unique_ptr<BagReader>(std::move(bag));
}

}  // namespace adasfm
