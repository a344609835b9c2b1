// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/global_descriptors.h"

#include <algorithm>
#include <utility>

#include "colmap_ext/host/database.h"
#include "colmap_ext/host/descriptors.h"
#include "core/parallel.h"
#include "core/random.h"

namespace adasfm {
namespace {

// Images per block that all threads process together.
constexpr size_t kBlockSize = 64;
// Number of cells of the descriptor space. More words distinguish places better
// but make the vectors longer: 64 x 128 numbers for SIFT.
constexpr int kNumWords = 64;
constexpr uint64_t kSeed = 1;
// Number of local descriptors that the vocabulary is trained on, drawn equally
// from all images; bounds the memory at 512 bytes each.
constexpr int kMaxNumTrainingDescriptors = 100000;
// VLAD vectors are reduced to this many principal components, which are learned
// from at most kMaxNumPcaImages vectors: their Gram matrix takes 8 MB.
constexpr int kNumDimensions = 512;
constexpr int kMaxNumPcaImages = 1000;

int CountImages(SqliteConnection* database) {
  SqliteStatement statement(database,
                            "SELECT COUNT(*) FROM descriptors WHERE rows > 0 "
                            "AND image_id IN (SELECT image_id FROM images)");
  return statement.Step() ? statement.Int(0) : 0;
}

// Draws equally many descriptors of every image at random.
RowMatrixXf SampleDescriptors(int num_images, SqliteConnection* database) {
  const int num_per_image =
      std::max(1, kMaxNumTrainingDescriptors / num_images);
  // With more images than descriptors, every k-th image gives one descriptor.
  const int stride = std::max(1, (num_images + kMaxNumTrainingDescriptors - 1) /
                                     kMaxNumTrainingDescriptors);
  Random random(kSeed);
  std::vector<RowMatrixXf> samples;
  Eigen::Index num_rows = 0;
  int index = 0;
  ReadDescriptors(database, [&](image_t, const DescriptorMatrix& descriptors) {
    if (index++ % stride != 0) return;
    if (!samples.empty() && descriptors.cols() != samples[0].cols()) {
      throw SqliteError("descriptors of different lengths");
    }
    const std::vector<int> rows = random.Sample(
        std::min<int>(num_per_image, descriptors.rows()), descriptors.rows());
    RowMatrixXf sample(rows.size(), descriptors.cols());
    for (size_t i = 0; i < rows.size(); ++i) {
      sample.row(i) = descriptors.row(rows[i]);
    }
    num_rows += sample.rows();
    samples.push_back(std::move(sample));
  });
  RowMatrixXf all(num_rows, samples[0].cols());
  Eigen::Index row = 0;
  for (const RowMatrixXf& sample : samples) {
    all.middleRows(row, sample.rows()) = sample;
    row += sample.rows();
  }
  return all;
}

// Calls function(index, image_id, vlad) for every stride-th image, in order;
// the vectors are computed on all threads.
void ForEachVlad(
    const RowMatrixXf& vocabulary, int stride, int num_threads,
    SqliteConnection* database,
    const std::function<void(int, image_t, const Eigen::RowVectorXf&)>&
        function) {
  std::vector<std::pair<image_t, DescriptorMatrix>> block;
  std::vector<Eigen::RowVectorXf> vlads;
  int num_done = 0;
  const auto flush = [&] {
    vlads.resize(block.size());
    ParallelFor(num_threads, block.size(), [&](size_t i) {
      vlads[i] = ComputeVlad(vocabulary, block[i].second);
    });
    for (size_t i = 0; i < block.size(); ++i) {
      function(num_done++, block[i].first, vlads[i]);
    }
    block.clear();
  };
  int index = 0;
  ReadDescriptors(database,
                  [&](image_t image_id, const DescriptorMatrix& descriptors) {
                    if (index++ % stride != 0) return;
                    block.emplace_back(image_id, descriptors);
                    if (block.size() == kBlockSize) flush();
                  });
  flush();
}

PcaBasis LearnPca(const RowMatrixXf& vocabulary, int num_images,
                  int num_threads, SqliteConnection* database) {
  const int stride = (num_images + kMaxNumPcaImages - 1) / kMaxNumPcaImages;
  RowMatrixXf rows((num_images + stride - 1) / stride, vocabulary.size());
  ForEachVlad(vocabulary, stride, num_threads, database,
              [&rows](int index, image_t, const Eigen::RowVectorXf& vlad) {
                rows.row(index) = vlad;
              });
  return ComputePca(rows, kNumDimensions);
}

GlobalDescriptors DescribeImages(int num_images, int num_threads,
                                 SqliteConnection* database,
                                 const ProgressCallback& progress) {
  if (progress) progress("training the vocabulary", 0.0);
  const RowMatrixXf vocabulary = TrainVocabulary(
      kNumWords, kSeed, SampleDescriptors(num_images, database));
  const bool reduce = kNumDimensions < vocabulary.size() && num_images > 2;
  PcaBasis basis;
  if (reduce) {
    if (progress) progress("learning the principal components", 0.3);
    basis = LearnPca(vocabulary, num_images, num_threads, database);
  }
  GlobalDescriptors result;
  result.vectors.resize(num_images,
                        reduce ? basis.axes.cols() : vocabulary.size());
  ForEachVlad(vocabulary, 1, num_threads, database,
              [&](int index, image_t image_id, const Eigen::RowVectorXf& vlad) {
                result.image_ids.push_back(image_id);
                result.vectors.row(index) =
                    reduce ? ReduceByPca(basis, vlad) : vlad;
                if (!progress) return;
                progress("describing image " + std::to_string(index + 1) +
                             " of " + std::to_string(num_images),
                         0.5 + 0.5 * (index + 1) / num_images);
              });
  return result;
}

}  // namespace

StatusOr<GlobalDescriptors> ComputeGlobalDescriptors(
    const std::string& database_path, int num_threads,
    const ProgressCallback& progress) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    const int num_images = CountImages(&database);
    if (num_images == 0) {
      return Status::Error("the database " + database_path +
                           " has no local descriptors; run COLMAP's "
                           "feature_extractor, or give --descriptors_path");
    }
    GlobalDescriptors result =
        DescribeImages(num_images, num_threads, &database, progress);
    if (result.vectors.cols() == 0) {
      result.warnings.push_back(
          "the local descriptors of all images are the same: no images are "
          "similar, only neighbours are paired");
    }
    const int num_missing =
        static_cast<int>(ReadImages(&database).size()) - num_images;
    if (num_missing > 0) {
      result.warnings.push_back(std::to_string(num_missing) +
                                " images have no local descriptors, and so no "
                                "similar images");
    }
    return result;
  } catch (const SqliteError& sqlite_error) {
    return Status::Error(database_path + ": " + sqlite_error.what());
  }
}

}  // namespace adasfm
