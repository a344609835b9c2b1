// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/stage_memory.h"

#include <filesystem>
#include <iomanip>
#include <sstream>

#include "colmap_ext/mapper_stage/part_memory.h"
#include "core/sqlite.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

// The program and its libraries.
constexpr double kBytesOfProgram = 65e6;
// Memory for a log as text; measured (docs/results/growth.md), rounded up.
constexpr double kImportBytesPerLogByte = 12.0;
// For adasfm_global and adasfm_mapper. Both peak with the scene and their data
// on every keypoint and match, and again when the whole is adjusted, within the
// remaining budget. Measured on 51 to 30,000 images (docs/reference/mapper.md),
// rounded up.
constexpr double kBytesOfStage = 40e6;
constexpr double kBytesPerImage = 5e4;
constexpr double kBytesPerKeypoint = 180.0;
constexpr double kBytesPerMatch = 45.0;

// Size of a file, or of all files below a folder; 0 where there is none.
double SizeOnDisk(const std::string& path) {
  std::error_code error;
  if (fs::is_regular_file(path, error)) {
    return static_cast<double>(fs::file_size(path, error));
  }
  double size = 0.0;
  for (const fs::directory_entry& entry :
       fs::recursive_directory_iterator(path, error)) {
    if (entry.is_regular_file(error)) {
      size += static_cast<double>(entry.file_size(error));
    }
  }
  return size;
}

// `what`: an expression of SQL.
int64_t Query(const std::string& what, const std::string& table,
              SqliteConnection* database) {
  if (!database->HasTable(table)) return 0;
  SqliteStatement statement(database, "SELECT " + what + " FROM " + table);
  return statement.Step() && !statement.IsNull(0) ? statement.Int(0) : 0;
}

}  // namespace

StatusOr<SceneSize> MeasureScene(const std::string& database_path) {
  SceneSize size;
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    size.num_images = Query("COUNT(*)", "keypoints", &database);
    size.num_keypoints = Query("SUM(rows)", "keypoints", &database);
    size.num_matches = Query("SUM(rows)", "two_view_geometries", &database);
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return size;
}

double EstimateImportMemoryBytes(const PriorImportPaths& paths) {
  double log_bytes = 0.0;
  for (const std::string& path :
       {paths.image_times_path, paths.imu_path, paths.wheel_path,
        paths.gnss_path, paths.trajectory_path}) {
    if (!path.empty()) log_bytes += SizeOnDisk(path);
  }
  return kBytesOfProgram + kImportBytesPerLogByte * log_bytes;
}

double EstimateStageMemoryBytes(const SceneSize& size) {
  return kBytesOfProgram + kBytesOfStage + kBytesPerImage * size.num_images +
         kBytesPerKeypoint * size.num_keypoints +
         kBytesPerMatch * size.num_matches;
}

Status CheckMemory(double bytes, double max_memory_gb,
                   const std::string& option,
                   std::vector<std::string>* warnings) {
  std::ostringstream text;
  text << std::setprecision(2) << "this may take " << bytes / 1e9
       << " GB of memory, more than the ";
  if (max_memory_gb > 0.0) {
    if (bytes <= 1e9 * max_memory_gb) return Status::Ok();
    text << max_memory_gb << " GB of --" << option
         << "; nothing was done. Give it more, extract fewer features, or map "
            "pieces of the drive";
    return Status::Error(text.str());
  }
  const double available = AvailableMemoryBytes();
  if (bytes > available) {
    text << available / 1e9 << " GB that are free";
    warnings->push_back(text.str());
  }
  return Status::Ok();
}

}  // namespace adasfm
