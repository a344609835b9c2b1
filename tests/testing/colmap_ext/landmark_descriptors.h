// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/random.h"
#include "core/sqlite.h"
#include "synthetic/synthetic_world.h"

namespace adasfm {

inline constexpr int kNumDimensions = 128;

// A descriptor like SIFT's: a unit vector of positive numbers.
inline Eigen::RowVectorXd RandomDescriptor(Random* random) {
  Eigen::RowVectorXd descriptor(kNumDimensions);
  for (int i = 0; i < kNumDimensions; ++i) {
    descriptor(i) = std::abs(random->Gaussian(1.0));
  }
  return descriptor.normalized();
}

// The descriptor of each keypoint is its landmark's with noise, which rotates
// it by about 20 degrees (SIFT's nearest neighbours accept 30 to 40).
class LandmarkDescriptors {
 public:
  LandmarkDescriptors(const SyntheticWorld& world, uint64_t seed)
      : random_(seed) {
    for (size_t i = 0; i < world.landmarks.size(); ++i) {
      descriptors_.push_back(RandomDescriptor(&random_));
    }
  }

  std::vector<uint8_t> Draw(int landmark_id) {
    Eigen::RowVectorXd descriptor = landmark_id < 0 ? RandomDescriptor(&random_)
                                                    : descriptors_[landmark_id];
    for (int i = 0; i < kNumDimensions; ++i) {
      descriptor(i) = std::max(
          0.0, descriptor(i) +
                   random_.Gaussian(0.36 / std::sqrt(1.0 * kNumDimensions)));
    }
    descriptor.normalize();
    std::vector<uint8_t> bytes(kNumDimensions);
    for (int i = 0; i < kNumDimensions; ++i) {
      bytes[i] = std::min(255.0, std::round(512.0 * descriptor(i)));
    }
    return bytes;
  }

 private:
  Random random_;
  std::vector<Eigen::RowVectorXd> descriptors_;
};

// Writes descriptors of all keypoints into the world's database.
inline void WriteLandmarkDescriptors(const SyntheticWorld& world, uint64_t seed,
                                     const std::string& database_path) {
  LandmarkDescriptors descriptors(world, seed);
  SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
  SqliteTransaction transaction(&database);
  SqliteStatement insert(&database,
                         "INSERT OR REPLACE INTO descriptors(image_id, rows, "
                         "cols, data) VALUES(?, ?, ?, ?)");
  for (const SyntheticImage& image : world.images) {
    std::vector<uint8_t> blob;
    for (const int landmark_id : image.landmark_ids) {
      const std::vector<uint8_t> bytes = descriptors.Draw(landmark_id);
      blob.insert(blob.end(), bytes.begin(), bytes.end());
    }
    insert.Reset();
    insert.BindInt(1, image.image_id);
    insert.BindInt(2, image.landmark_ids.size());
    insert.BindInt(3, kNumDimensions);
    insert.BindBlob(4, blob.data(), blob.size());
    insert.Step();
  }
  transaction.Commit();
}

}  // namespace adasfm
