// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/host/features.h"

#include <feature/extraction.h>

#include <chrono>
#include <cstdlib>
#include <functional>
#include <thread>

#include "colmap_ext/host/database.h"
#include "colmap_ext/host/database_schema.h"
#include "colmap_ext/host/host_features.h"
#include "colmap_ext/io/capture_output.h"

#ifdef ADASFM_HOST_HAS_CUDA
#include <util/cuda.h>
#endif

namespace adasfm {
namespace {

constexpr std::chrono::milliseconds kThreadPollInterval(100);

// Waits for a thread of the host; when the progress callback throws, the thread
// is asked to stop and waited for.
void WaitFor(colmap::Thread* thread, const std::function<void()>& report) {
  try {
    while (!thread->IsFinished()) {
      std::this_thread::sleep_for(kThreadPollInterval);
      report();
    }
  } catch (...) {
    thread->Stop();
    thread->Wait();
    throw;
  }
  thread->Wait();
}

// Without CUDA the host's GPU code needs a display.
bool CanUseGpu() {
#ifdef ADASFM_HOST_HAS_CUDA
  return colmap::GetNumCudaDevices() > 0;
#else
  return std::getenv("DISPLAY") != nullptr;
#endif
}

}  // namespace

bool UsesGpu(const FeatureOptions& options) {
  if (options.use_gpu >= 0) return options.use_gpu == 1;
#ifdef ADASFM_HOST_HAS_CUDA
  return colmap::GetNumCudaDevices() > 0;
#else
  return false;
#endif
}

Status CheckGpu(const FeatureOptions& options) {
  if (options.use_gpu != 1 || CanUseGpu()) return Status::Ok();
  return Status::Error(
      "there is no GPU that the host can use; use --use_gpu 0");
}

Status ExtractFeatures(const FeatureOptions& options,
                       const std::string& image_path,
                       const std::string& database_path,
                       const std::string& log_path,
                       const ProgressCallback& progress) {
  if (UsesHostProgram()) {
    return ExtractFeaturesByHost(options, image_path, database_path, log_path,
                                 progress);
  }
  const Status opens = CheckLibraryOpens(database_path);
  if (!opens.ok()) return opens;
  colmap::ImageReaderOptions reader;
  reader.database_path = database_path;
  reader.image_path = image_path;
  int num_images = 0;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    num_images = static_cast<int>(ReadImages(&database).size());
    for (const DatabaseImage& image : ReadImagesWithoutFeatures(&database)) {
      reader.image_list.push_back(image.name);
    }
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  if (reader.image_list.empty()) return Status::Ok();
  const int num_done = num_images - static_cast<int>(reader.image_list.size());
  colmap::SiftExtractionOptions sift;
  sift.max_image_size = options.max_image_size;
  sift.max_num_features = options.max_num_features;
  sift.first_octave = options.first_octave;
  sift.num_threads = options.num_threads;
  sift.use_gpu = UsesGpu(options);

  const Status gpu = CheckGpu(options);
  if (!gpu.ok()) return gpu;
  // The host prints one such line for every photo.
  CaptureOutput capture(log_path, "Processed file");
  colmap::SiftFeatureExtractor extractor(reader, sift);
  extractor.Start();
  WaitFor(&extractor, [&] {
    const int count = num_done + capture.NumCountedLines();
    progress("features of image " + std::to_string(count) + " of " +
                 std::to_string(num_images),
             static_cast<double>(count) / num_images);
  });
  return Status::Ok();
}

}  // namespace adasfm
