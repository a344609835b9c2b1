// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/features/extract_sift.h"

#include <algorithm>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <vector>

#include "colmap_ext/host/database.h"
#include "colmap_ext/host/database_schema.h"
#include "colmap_ext/io/image_codecs.h"
#include "core/parallel.h"
#include "core/sqlite.h"
#include "core/types.h"

namespace adasfm {
namespace {

// Images per transaction and thread; a kill loses one transaction.
constexpr size_t kNumImagesPerThread = 4;

template <typename Rows>
void BindRows(image_t image_id, const Rows& rows, SqliteStatement* statement) {
  statement->BindInt(1, image_id);
  statement->BindInt(2, rows.rows());
  statement->BindInt(3, rows.cols());
  statement->BindBlob(4, rows.data(),
                      rows.size() * sizeof(typename Rows::Scalar));
}

void WriteFeatures(image_t image_id, const SiftFeatures& features,
                   SqliteConnection* database) {
  SqliteStatement keypoints(database,
                            "INSERT OR REPLACE INTO keypoints"
                            "(image_id, rows, cols, data) VALUES(?, ?, ?, ?)");
  BindRows(image_id, features.keypoints, &keypoints);
  keypoints.Step();
  // COLMAP 4 distinguishes types of descriptors; SIFT is type 0.
  const bool has_type = HasColumn(database, "descriptors", "type");
  SqliteStatement descriptors(
      database,
      std::string("INSERT OR REPLACE INTO descriptors(image_id, rows, cols, "
                  "data") +
          (has_type ? ", type) VALUES(?, ?, ?, ?, 0)"
                    : ") VALUES(?, ?, ?, ?)"));
  BindRows(image_id, features.descriptors, &descriptors);
  descriptors.Step();
}

SiftFeatures ExtractFromFile(const SiftFeatureOptions& options,
                             const std::string& path) {
  // Ignores the orientation of EXIF, as COLMAP does.
  const cv::Mat image =
      ReadImageFile(path, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  if (image.empty()) {
    throw std::runtime_error("OpenCV cannot read the image " + path +
                             "; use --extractor colmap");
  }
  return ExtractSiftFeatures(options, image);
}

void ExtractAll(const SiftFeatureOptions& options, int num_threads,
                const std::string& image_path, SqliteConnection* database,
                const ProgressCallback& progress) {
  const size_t num_images = ReadImages(database).size();
  const std::vector<DatabaseImage> images = ReadImagesWithoutFeatures(database);
  const size_t num_done = num_images - images.size();
  const size_t block_size =
      kNumImagesPerThread * EffectiveNumThreads(num_threads);
  for (size_t begin = 0; begin < images.size(); begin += block_size) {
    const size_t count = std::min(block_size, images.size() - begin);
    std::vector<SiftFeatures> features(count);
    ParallelFor(num_threads, count, [&](size_t i) {
      features[i] =
          ExtractFromFile(options, image_path + "/" + images[begin + i].name);
    });
    SqliteTransaction transaction(database);
    for (size_t i = 0; i < count; ++i) {
      WriteFeatures(images[begin + i].image_id, features[i], database);
    }
    transaction.Commit();
    const size_t num_finished = num_done + begin + count;
    progress("features of image " + std::to_string(num_finished) + " of " +
                 std::to_string(num_images),
             static_cast<double>(num_finished) / num_images);
  }
}

// Every image has its own thread, so OpenCV uses one.
class SingleThreadedOpenCv {
 public:
  SingleThreadedOpenCv() : num_threads_(cv::getNumThreads()) {
    cv::setNumThreads(1);
  }
  ~SingleThreadedOpenCv() { cv::setNumThreads(num_threads_); }
  SingleThreadedOpenCv(const SingleThreadedOpenCv&) = delete;
  SingleThreadedOpenCv& operator=(const SingleThreadedOpenCv&) = delete;

 private:
  int num_threads_;
};

}  // namespace

Status ExtractSiftOfDatabase(const SiftFeatureOptions& options, int num_threads,
                             const std::string& image_path,
                             const std::string& database_path,
                             const ProgressCallback& progress) {
  std::string error;
  if (!options.IsValid(&error)) throw std::invalid_argument(error);
  const SingleThreadedOpenCv single_threaded;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kWrite);
    ExtractAll(options, num_threads, image_path, &database, progress);
  } catch (const SqliteError& sqlite_error) {
    return Status::Error(database_path + ": " + sqlite_error.what());
  } catch (const std::runtime_error& runtime_error) {
    return Status::Error(runtime_error.what());
  }
  return Status::Ok();
}

}  // namespace adasfm
