// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/bags/decompress.h"

#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <memory>

namespace adasfm {
namespace {

// Memory is allocated in such steps, so that a false size costs no memory.
constexpr size_t kStepBytes = 1 << 18;

// Calls decode(input position, output, output capacity) until the frame ends.
// decode advances the position and returns the number of bytes written; it sets
// *is_done at the end of the frame and *error when the data are bad.
template <typename Decode>
std::string DecodeAll(uint64_t max_size, const Decode& decode,
                      std::vector<uint8_t>* output) {
  output->clear();
  size_t position = 0;
  while (true) {
    const size_t size = output->size();
    if (size >= max_size) {
      return "its data are longer than it says";
    }
    const size_t step =
        std::min<uint64_t>(std::max(kStepBytes, size / 2), max_size - size);
    output->resize(size + step);
    bool is_done = false;
    std::string error;
    const size_t before = position;
    const size_t written =
        decode(&position, output->data() + size, step, &is_done, &error);
    output->resize(size + written);
    if (!error.empty()) return error;
    if (is_done) return "";
    if (written == 0 && position == before) return "its data are cut short";
  }
}

std::string DecompressLz4(const ByteSpan& input, uint64_t max_size,
                          std::vector<uint8_t>* output) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) {
    return "no memory for lz4";
  }
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)>
      owner(context, &LZ4F_freeDecompressionContext);
  return DecodeAll(
      max_size,
      [&](size_t* position, uint8_t* out, size_t capacity, bool* is_done,
          std::string* error) {
        size_t num_out = capacity;
        size_t num_in = input.size - *position;
        const size_t hint = LZ4F_decompress(
            context, out, &num_out, input.data + *position, &num_in, nullptr);
        if (LZ4F_isError(hint)) {
          *error =
              std::string("bad lz4 data (") + LZ4F_getErrorName(hint) + ")";
          return size_t{0};
        }
        *position += num_in;
        *is_done = hint == 0;
        return num_out;
      },
      output);
}

std::string DecompressZstd(const ByteSpan& input, uint64_t max_size,
                           std::vector<uint8_t>* output) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(
      ZSTD_createDStream(), &ZSTD_freeDStream);
  if (stream == nullptr) return "no memory for zstd";
  return DecodeAll(
      max_size,
      [&](size_t* position, uint8_t* out, size_t capacity, bool* is_done,
          std::string* error) {
        ZSTD_inBuffer in{input.data, input.size, *position};
        ZSTD_outBuffer buffer{out, capacity, 0};
        const size_t hint = ZSTD_decompressStream(stream.get(), &buffer, &in);
        if (ZSTD_isError(hint)) {
          *error =
              std::string("bad zstd data (") + ZSTD_getErrorName(hint) + ")";
          return size_t{0};
        }
        *position = in.pos;
        *is_done = hint == 0;
        return buffer.pos;
      },
      output);
}

}  // namespace

std::string Decompress(const std::string& compression, const ByteSpan& input,
                       uint64_t max_size, std::vector<uint8_t>* output) {
  output->clear();
  if (compression == "lz4") return DecompressLz4(input, max_size, output);
  if (compression == "zstd") return DecompressZstd(input, max_size, output);
  return "a compression that is neither lz4 nor zstd";
}

bool IsZstd(const ByteSpan& bytes) {
  static constexpr uint8_t kMagic[] = {0x28, 0xb5, 0x2f, 0xfd};
  return bytes.size >= sizeof(kMagic) &&
         std::equal(std::begin(kMagic), std::end(kMagic), bytes.data);
}

uint32_t ComputeCrc32(const ByteSpan& bytes) {
  static const std::array<uint32_t, 256> kTable = [] {
    std::array<uint32_t, 256> table{};
    for (uint32_t i = 0; i < 256; ++i) {
      uint32_t value = i;
      for (int bit = 0; bit < 8; ++bit) {
        value = (value >> 1) ^ ((value & 1) != 0 ? 0xedb88320u : 0u);
      }
      table[i] = value;
    }
    return table;
  }();
  uint32_t crc = 0xffffffffu;
  for (size_t i = 0; i < bytes.size; ++i) {
    crc = kTable[(crc ^ bytes.data[i]) & 0xff] ^ (crc >> 8);
  }
  return ~crc;
}

}  // namespace adasfm
