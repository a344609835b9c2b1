// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/bags/ros_messages.h"

#include <limits>

namespace adasfm {
namespace {

// CDR pads a message's end to a multiple of four bytes; some writers to eight.
constexpr size_t kMaxPadding = 7;

// The fields of one message in order, in either serialisation.
class FieldReader {
 public:
  FieldReader(RosEncoding encoding, const ByteSpan& bytes)
      : reader_(bytes), is_cdr_(encoding == RosEncoding::kCdr) {
    if (!is_cdr_) return;
    // Two bytes say how the body is encoded, two are options. 0 and 1 are plain
    // CDR, big- and little-endian; ROS 2 has no other.
    reader_.Read<uint8_t>();
    const uint8_t kind = reader_.Read<uint8_t>();
    reader_.Read<uint16_t>();
    swap_ = kind == 0;
    is_known_ = kind <= 1;
    body_ = reader_.position();
  }

  template <typename T>
  T Read() {
    Align(sizeof(T));
    return reader_.Read<T>(swap_);
  }

  template <typename T>
  FieldReader& operator>>(T& value) {
    value = Read<T>();
    return *this;
  }

  FieldReader& operator>>(std::string& text) {
    ByteSpan span = reader_.Take(Read<uint32_t>());
    // CDR strings end in a zero, which is included in their length.
    if (is_cdr_ && span.size > 0) --span.size;
    text.assign(reinterpret_cast<const char*>(span.data), span.size);
    return *this;
  }

  FieldReader& operator>>(Eigen::Vector3d& vector) {
    for (int i = 0; i < 3; ++i) vector[i] = Read<double>();
    return *this;
  }

  // x, y, z, w.
  FieldReader& operator>>(Eigen::Quaterniond& rotation) {
    for (int i = 0; i < 4; ++i) rotation.coeffs()[i] = Read<double>();
    return *this;
  }

  template <size_t N>
  FieldReader& operator>>(std::array<double, N>& values) {
    for (double& value : values) value = Read<double>();
    return *this;
  }

  FieldReader& operator>>(std::vector<double>& values) {
    const uint32_t size = ReadCount(sizeof(double));
    values.resize(size);
    for (double& value : values) value = Read<double>();
    return *this;
  }

  FieldReader& operator>>(ByteSpan& bytes) {
    bytes = reader_.Take(Read<uint32_t>());
    return *this;
  }

  FieldReader& operator>>(RosHeader& header) {
    if (!is_cdr_) Read<uint32_t>();  // a number that ROS 2 does not have
    const int64_t seconds =
        is_cdr_ ? Read<int32_t>() : static_cast<int64_t>(Read<uint32_t>());
    const int64_t nanoseconds = Read<uint32_t>();
    header.stamp_ns = 1'000'000'000 * seconds + nanoseconds;
    return *this >> header.frame_id;
  }

  void SkipDoubles(int count) {
    for (int i = 0; i < count; ++i) Read<double>();
  }

  // The count of a sequence whose elements have at least min_bytes bytes each.
  // The reader fails when the bytes left cannot contain so many.
  uint32_t ReadCount(size_t min_bytes) {
    const uint32_t count = Read<uint32_t>();
    if (count <= reader_.num_left() / min_bytes) return count;
    is_known_ = false;
    return 0;
  }

  bool ok() const { return reader_.ok() && is_known_; }
  // All fields were there, and nothing but padding follows.
  bool IsComplete() const {
    return ok() && reader_.num_left() <= (is_cdr_ ? kMaxPadding : 0);
  }

 private:
  void Align(size_t size) {
    if (!is_cdr_) return;
    const size_t offset = (reader_.position() - body_) % size;
    if (offset > 0) reader_.Take(size - offset);
  }

  ByteReader reader_;
  bool is_cdr_;
  bool swap_ = false;
  bool is_known_ = true;
  size_t body_ = 0;
};

}  // namespace

bool ParseRosHeader(RosEncoding encoding, const ByteSpan& bytes,
                    RosHeader* message) {
  FieldReader fields(encoding, bytes);
  fields >> *message;
  return fields.ok();
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosImu* message) {
  FieldReader fields(encoding, bytes);
  fields >> message->header;
  fields.SkipDoubles(4 + 9);
  fields >> message->angular_velocity;
  fields.SkipDoubles(9);
  fields >> message->linear_acceleration;
  fields.SkipDoubles(9);
  return fields.IsComplete();
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosImage* message) {
  FieldReader fields(encoding, bytes);
  fields >> message->header >> message->height >> message->width >>
      message->encoding;
  message->is_big_endian = fields.Read<uint8_t>() != 0;
  fields >> message->row_bytes >> message->pixels;
  return fields.IsComplete();
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosCompressedImage* message) {
  FieldReader fields(encoding, bytes);
  fields >> message->header >> message->format >> message->file;
  return fields.IsComplete();
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosCameraInfo* message) {
  FieldReader fields(encoding, bytes);
  fields >> message->header >> message->height >> message->width >>
      message->distortion_model >> message->distortion >> message->k;
  fields.SkipDoubles(9);
  fields >> message->p >> message->binning_x >> message->binning_y;
  fields.Read<uint32_t>();
  fields.Read<uint32_t>();
  fields >> message->roi_height >> message->roi_width;
  fields.Read<uint8_t>();
  return fields.IsComplete();
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosNavSatFix* message) {
  FieldReader fields(encoding, bytes);
  fields >> message->header;
  message->status = fields.Read<int8_t>();
  fields.Read<uint16_t>();
  fields >> message->latitude >> message->longitude >> message->altitude >>
      message->position_covariance;
  message->covariance_type = fields.Read<uint8_t>();
  return fields.IsComplete();
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosJointState* message) {
  FieldReader fields(encoding, bytes);
  fields >> message->header;
  // An empty name is its length alone.
  message->names.resize(fields.ReadCount(sizeof(uint32_t)));
  for (std::string& name : message->names) fields >> name;
  std::vector<double> efforts;
  fields >> message->positions >> message->velocities >> efforts;
  return fields.IsComplete();
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosTwist* message) {
  for (const int num_covariances : {0, 36}) {
    FieldReader fields(encoding, bytes);
    fields >> message->header >> message->linear >> message->angular;
    fields.SkipDoubles(num_covariances);
    if (fields.IsComplete()) return true;
  }
  return false;
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     RosOdometry* message) {
  FieldReader fields(encoding, bytes);
  fields >> message->header >> message->child_frame_id >> message->position >>
      message->rotation;
  fields.SkipDoubles(36);
  fields >> message->linear >> message->angular;
  fields.SkipDoubles(36);
  return fields.IsComplete();
}

bool ParseRosMessage(RosEncoding encoding, const ByteSpan& bytes,
                     std::vector<RosTransform>* message) {
  FieldReader fields(encoding, bytes);
  // A transform has at least seven numbers of eight bytes.
  message->resize(fields.ReadCount(7 * sizeof(double)));
  for (RosTransform& transform : *message) {
    RosHeader header;
    fields >> header >> transform.child >> transform.translation >>
        transform.rotation;
    transform.parent = std::move(header.frame_id);
  }
  return fields.IsComplete();
}

}  // namespace adasfm
