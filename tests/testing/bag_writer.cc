// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/bag_writer.h"

#include <lz4frame.h>
#include <zstd.h>

#include <fstream>
#include <stdexcept>

namespace adasfm {
namespace {

constexpr char kMagic[] = "\x89MCAP0\r\n";

template <typename T>
std::string Pack(T value) {
  return std::string(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string PackText(const std::string& text) {
  return Pack<uint32_t>(text.size()) + text;
}

std::string Compress(const std::string& compression, const std::string& data) {
  if (compression.empty()) return data;
  std::string out;
  size_t size = 0;
  if (compression == "lz4") {
    out.resize(LZ4F_compressFrameBound(data.size(), nullptr));
    size = LZ4F_compressFrame(out.data(), out.size(), data.data(), data.size(),
                              nullptr);
  } else {
    out.resize(ZSTD_compressBound(data.size()));
    size = ZSTD_compress(out.data(), out.size(), data.data(), data.size(), 1);
  }
  out.resize(size);
  return out;
}

// Computes the CRC bit by bit, unlike the reader.
uint32_t Crc32(const std::string& data) {
  uint32_t crc = ~0u;
  for (const char c : data) {
    crc ^= static_cast<uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) {
      crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
    }
  }
  return ~crc;
}

CdrWriter Begin(const MessageFrame& frame) {
  CdrWriter writer(frame.is_big_endian);
  writer.AddHeader(frame.stamp_ns, frame.frame_id);
  return writer;
}

std::vector<double> List(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

std::vector<double> List(const Eigen::Quaterniond& q) {
  return {q.x(), q.y(), q.z(), q.w()};
}

const std::vector<double> kNine(9, 0.0);
const std::vector<double> kThirtySix(36, 0.0);

}  // namespace

CdrWriter& CdrWriter::AddText(const std::string& text) {
  Add<uint32_t>(text.size() + 1);
  bytes_ += text + '\0';
  return *this;
}

CdrWriter& CdrWriter::AddBytes(const std::string& bytes) {
  Add<uint32_t>(bytes.size());
  bytes_ += bytes;
  return *this;
}

CdrWriter& CdrWriter::AddDoubles(const std::vector<double>& values) {
  for (const double value : values) Add(value);
  return *this;
}

CdrWriter& CdrWriter::AddHeader(timestamp_t stamp_ns,
                                const std::string& frame_id) {
  Add<int32_t>(stamp_ns / 1'000'000'000);
  Add<uint32_t>(stamp_ns % 1'000'000'000);
  return AddText(frame_id);
}

std::string ImuMessage(const MessageFrame& frame, const Eigen::Vector3d& rate,
                       const Eigen::Vector3d& force) {
  return Begin(frame)
      .AddDoubles({0, 0, 0, 1})
      .AddDoubles(kNine)
      .AddDoubles(List(rate))
      .AddDoubles(kNine)
      .AddDoubles(List(force))
      .AddDoubles(kNine)
      .bytes();
}

std::string OdometryMessage(const MessageFrame& frame,
                            const std::string& child_frame_id,
                            const Eigen::Vector3d& position,
                            const Eigen::Quaterniond& rotation,
                            const Eigen::Vector3d& linear,
                            const Eigen::Vector3d& angular) {
  return Begin(frame)
      .AddText(child_frame_id)
      .AddDoubles(List(position))
      .AddDoubles(List(rotation))
      .AddDoubles(kThirtySix)
      .AddDoubles(List(linear))
      .AddDoubles(List(angular))
      .AddDoubles(kThirtySix)
      .bytes();
}

std::string TwistMessage(const MessageFrame& frame,
                         const Eigen::Vector3d& linear,
                         const Eigen::Vector3d& angular, bool has_covariance) {
  CdrWriter writer = Begin(frame);
  writer.AddDoubles(List(linear)).AddDoubles(List(angular));
  if (has_covariance) writer.AddDoubles(kThirtySix);
  return writer.bytes();
}

std::string ImageMessage(const MessageFrame& frame, uint32_t height,
                         uint32_t width, const std::string& encoding,
                         uint32_t row_bytes, const std::string& pixels) {
  return Begin(frame)
      .Add(height)
      .Add(width)
      .AddText(encoding)
      .Add<uint8_t>(frame.is_big_endian)
      .Add(row_bytes)
      .AddBytes(pixels)
      .bytes();
}

std::string CompressedImageMessage(const MessageFrame& frame,
                                   const std::string& format,
                                   const std::string& file) {
  return Begin(frame).AddText(format).AddBytes(file).bytes();
}

std::string CameraInfoMessage(const MessageFrame& frame, uint32_t height,
                              uint32_t width, const std::string& model,
                              const std::vector<double>& distortion,
                              const std::vector<double>& k) {
  const std::vector<double> p = {k[0], k[1], k[2], 0,    k[3], k[4],
                                 k[5], 0,    k[6], k[7], k[8], 0};
  return Begin(frame)
      .Add(height)
      .Add(width)
      .AddText(model)
      .Add<uint32_t>(distortion.size())
      .AddDoubles(distortion)
      .AddDoubles(k)
      .AddDoubles({1, 0, 0, 0, 1, 0, 0, 0, 1})
      .AddDoubles(p)
      .Add<uint32_t>(0)
      .Add<uint32_t>(0)
      .Add<uint32_t>(0)
      .Add<uint32_t>(0)
      .Add<uint32_t>(0)
      .Add<uint32_t>(0)
      .Add<uint8_t>(0)
      .bytes();
}

std::string JointStateMessage(const MessageFrame& frame,
                              const std::vector<std::string>& names,
                              const std::vector<double>& positions) {
  CdrWriter writer = Begin(frame);
  writer.Add<uint32_t>(names.size());
  for (const std::string& name : names) writer.AddText(name);
  return writer.Add<uint32_t>(positions.size())
      .AddDoubles(positions)
      .Add<uint32_t>(0)
      .Add<uint32_t>(0)
      .bytes();
}

std::string NavSatFixMessage(const MessageFrame& frame, double latitude,
                             double longitude, double altitude,
                             double variance) {
  return Begin(frame)
      .Add<int8_t>(0)
      .Add<uint16_t>(1)
      .AddDoubles({latitude, longitude, altitude})
      .AddDoubles({variance, 0, 0, 0, variance, 0, 0, 0, 4 * variance})
      .Add<uint8_t>(2)
      .bytes();
}

std::string TransformMessage(const MessageFrame& frame,
                             const std::string& child_frame_id,
                             const Eigen::Vector3d& translation,
                             const Eigen::Quaterniond& rotation) {
  return CdrWriter(frame.is_big_endian)
      .Add<uint32_t>(1)
      .AddHeader(frame.stamp_ns, frame.frame_id)
      .AddText(child_frame_id)
      .AddDoubles(List(translation))
      .AddDoubles(List(rotation))
      .bytes();
}

BagWriter::BagWriter(const std::string& path, const BagWriterOptions& options)
    : path_(path), options_(options) {
  if (path.size() > 4 && path.substr(path.size() - 4) == ".db3") {
    std::ofstream(path, std::ios::trunc);
    database_ = std::make_unique<SqliteConnection>(
        path, SqliteConnection::Mode::kWrite);
    database_->Execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type "
        "TEXT NOT NULL, serialization_format TEXT NOT NULL, "
        "offered_qos_profiles TEXT NOT NULL)");
    database_->Execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT "
        "NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)");
    database_->Execute("BEGIN");
    return;
  }
  file_.assign(kMagic, sizeof(kMagic) - 1);
  AddRecord(0x01, PackText("ros2") + PackText("test"), &file_);
}

BagWriter::~BagWriter() { Close(); }

void BagWriter::AddRecord(uint8_t opcode, const std::string& content,
                          std::string* out) {
  *out += Pack(opcode) + Pack<uint64_t>(content.size()) + content;
}

uint16_t BagWriter::AddChannel(const std::string& topic,
                               const std::string& type) {
  const auto [entry, is_new] =
      channels_.emplace(topic + " " + type, channels_.size() + 1);
  const uint16_t id = entry->second;
  if (!is_new) return id;
  if (database_ != nullptr) {
    SqliteStatement insert(database_.get(),
                           "INSERT INTO topics VALUES (?, ?, ?, ?, '')");
    insert.BindInt(1, id);
    insert.BindText(2, topic);
    insert.BindText(3, type);
    insert.BindText(4, options_.message_encoding);
    insert.Step();
    return id;
  }
  std::string text;
  AddRecord(0x03,
            Pack(id) + PackText(type) + PackText("ros2msg") + PackText(""),
            &text);
  AddRecord(0x04,
            Pack(id) + Pack(id) + PackText(topic) +
                PackText(options_.message_encoding) + Pack<uint32_t>(0),
            &text);
  definitions_ += text;
  (options_.compression == "none" ? file_ : chunk_) += text;
  return id;
}

void BagWriter::Write(const std::string& topic, const std::string& type,
                      timestamp_t time_ns, const std::string& bytes) {
  const uint16_t id = AddChannel(topic, type);
  ++counts_[id];
  if (database_ != nullptr) {
    SqliteStatement insert(database_.get(),
                           "INSERT INTO messages(topic_id, timestamp, data) "
                           "VALUES (?, ?, ?)");
    insert.BindInt(1, id);
    insert.BindInt(2, time_ns);
    insert.BindBlob(3, bytes.data(), bytes.size());
    insert.Step();
    return;
  }
  AddRecord(0x05,
            Pack(id) + Pack<uint32_t>(0) + Pack<uint64_t>(time_ns) +
                Pack<uint64_t>(time_ns) + bytes,
            options_.compression == "none" ? &file_ : &chunk_);
  if (chunk_.size() > options_.chunk_bytes) FlushChunk();
}

void BagWriter::FlushChunk() {
  if (chunk_.empty()) return;
  const std::string stored = Compress(options_.compression, chunk_);
  AddRecord(0x06,
            Pack<uint64_t>(0) + Pack<uint64_t>(0) +
                Pack<uint64_t>(chunk_.size()) + Pack(Crc32(chunk_)) +
                PackText(options_.compression) + Pack<uint64_t>(stored.size()) +
                stored,
            &file_);
  chunk_.clear();
}

void BagWriter::Close() {
  if (!is_open_) return;
  is_open_ = false;
  if (database_ != nullptr) {
    database_->Execute("COMMIT");
    database_.reset();
    return;
  }
  FlushChunk();
  AddRecord(0x0f, Pack<uint32_t>(0), &file_);
  uint64_t summary_start = 0;
  if (options_.has_summary) {
    summary_start = file_.size();
    file_ += definitions_;
    std::string counts;
    for (const auto& [id, count] : counts_) counts += Pack(id) + Pack(count);
    AddRecord(0x0b, std::string(8 + 2 + 4 * 4 + 16, '\0') + PackText(counts),
              &file_);
  }
  AddRecord(0x02, Pack(summary_start) + Pack<uint64_t>(0) + Pack<uint32_t>(0),
            &file_);
  file_.append(kMagic, sizeof(kMagic) - 1);
  std::ofstream(path_, std::ios::binary) << file_;
}

}  // namespace adasfm
