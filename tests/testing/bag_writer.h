// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/sqlite.h"
#include "core/types.h"

namespace adasfm {

// Serialises values as CDR, aligned to their size from the body on.
class CdrWriter {
 public:
  explicit CdrWriter(bool is_big_endian = false)
      : bytes_(4, '\0'), swap_(is_big_endian) {
    bytes_[1] = is_big_endian ? 0 : 1;
  }

  template <typename T>
  CdrWriter& Add(T value) {
    while ((bytes_.size() - 4) % sizeof(T) != 0) bytes_ += '\0';
    char buffer[sizeof(T)];
    std::memcpy(buffer, &value, sizeof(T));
    if (swap_) std::reverse(buffer, buffer + sizeof(T));
    bytes_.append(buffer, sizeof(T));
    return *this;
  }
  CdrWriter& AddText(const std::string& text);
  CdrWriter& AddBytes(const std::string& bytes);
  CdrWriter& AddDoubles(const std::vector<double>& values);  // no count
  CdrWriter& AddHeader(timestamp_t stamp_ns, const std::string& frame_id);

  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  bool swap_;
};

// Messages of the types that are read, in CDR.
struct MessageFrame {
  timestamp_t stamp_ns = 0;
  std::string frame_id;
  bool is_big_endian = false;
};
std::string ImuMessage(const MessageFrame& frame, const Eigen::Vector3d& rate,
                       const Eigen::Vector3d& force);
std::string OdometryMessage(const MessageFrame& frame,
                            const std::string& child_frame_id,
                            const Eigen::Vector3d& position,
                            const Eigen::Quaterniond& rotation,
                            const Eigen::Vector3d& linear,
                            const Eigen::Vector3d& angular);
std::string TwistMessage(const MessageFrame& frame,
                         const Eigen::Vector3d& linear,
                         const Eigen::Vector3d& angular, bool has_covariance);
std::string ImageMessage(const MessageFrame& frame, uint32_t height,
                         uint32_t width, const std::string& encoding,
                         uint32_t row_bytes, const std::string& pixels);
std::string CompressedImageMessage(const MessageFrame& frame,
                                   const std::string& format,
                                   const std::string& file);
std::string CameraInfoMessage(const MessageFrame& frame, uint32_t height,
                              uint32_t width, const std::string& model,
                              const std::vector<double>& distortion,
                              const std::vector<double>& k);
std::string JointStateMessage(const MessageFrame& frame,
                              const std::vector<std::string>& names,
                              const std::vector<double>& positions);
std::string NavSatFixMessage(const MessageFrame& frame, double latitude,
                             double longitude, double altitude,
                             double variance);
// One transform parent_from_child.
std::string TransformMessage(const MessageFrame& frame,
                             const std::string& child_frame_id,
                             const Eigen::Vector3d& translation,
                             const Eigen::Quaterniond& rotation);

struct BagWriterOptions {
  // Of MCAP: "none" (no chunks), "" (plain chunks), "lz4" or "zstd".
  std::string compression;
  // Whether MCAP gets a summary with channels and counts.
  bool has_summary = true;
  size_t chunk_bytes = 1 << 16;
  std::string message_encoding = "cdr";
};

// Writes an MCAP file or, for a name that ends in .db3, rosbag2's SQLite file;
// complete after Close() or destruction.
class BagWriter {
 public:
  BagWriter(const std::string& path, const BagWriterOptions& options);
  ~BagWriter();

  // type as ROS 2 names it: "sensor_msgs/msg/Imu".
  void Write(const std::string& topic, const std::string& type,
             timestamp_t time_ns, const std::string& bytes);
  void Close();

 private:
  uint16_t AddChannel(const std::string& topic, const std::string& type);
  void AddRecord(uint8_t opcode, const std::string& content, std::string* out);
  void FlushChunk();

  std::string path_;
  BagWriterOptions options_;
  bool is_open_ = true;
  std::map<std::string, uint16_t> channels_;
  std::map<uint16_t, uint64_t> counts_;
  std::string file_;
  std::string chunk_;
  std::string definitions_;
  std::unique_ptr<SqliteConnection> database_;
};

}  // namespace adasfm
