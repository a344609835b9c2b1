// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/priors/import_positions.h"

#include <cmath>
#include <optional>
#include <utility>

#include "colmap_ext/host/pose_prior_table.h"
#include "core/sqlite.h"
#include "sensors/io/read_gnss.h"

namespace adasfm {
namespace {

// Positions of photos that COLMAP stores in the database.
StatusOr<std::vector<HostPosition>> ReadStoredPositions(
    const std::string& database_path) {
  try {
    SqliteConnection database(database_path, SqliteConnection::Mode::kRead);
    std::vector<HostPosition> positions = ReadHostPositions(&database);
    if (!positions.empty()) return positions;
  } catch (const SqliteError& error) {
    return Status::Error(database_path + ": " + error.what());
  }
  return Status::Error(database_path +
                       ": no image has a position, neither in pose_priors nor "
                       "from EXIF; give a log as --gnss_path");
}

Eigen::Matrix3d CovarianceOf(const GnssNoise& noise) {
  const double horizontal = noise.horizontal_m * noise.horizontal_m;
  return Eigen::Vector3d(horizontal, horizontal,
                         noise.vertical_m * noise.vertical_m)
      .asDiagonal();
}

// Transforms geodetic positions into the ENU frame of the first one. Positions
// in another coordinate system than the first are skipped.
Status ImportStoredPositions(const PriorImportPaths& paths,
                             const SensorCalibration& calibration,
                             const SceneData& scene, PriorImport* import) {
  const StatusOr<std::vector<HostPosition>> positions =
      ReadStoredPositions(paths.database_path);
  if (!positions.ok()) return positions.status();
  const bool is_geodetic = positions->front().is_geodetic;
  std::optional<EnuFrame> frame;
  for (const HostPosition& stored : *positions) {
    ++import->num_fixes;
    const Eigen::Vector3d& values = stored.position;
    const bool is_known = scene.images.count(stored.image_id) > 0 &&
                          stored.is_geodetic == is_geodetic;
    if (!is_known || (is_geodetic && values.head<2>().norm() < 1e-6)) {
      ++import->num_fixes_left_out[is_known ? "no fix (0, 0)"
                                            : "another coordinate system"];
      continue;
    }
    PositionPrior prior;
    prior.image_id1 = prior.image_id2 = stored.image_id;
    prior.position = values;
    prior.covariance =
        stored.covariance.value_or(CovarianceOf(calibration.gnss_noise));
    if (is_geodetic) {
      if (std::abs(values.x()) > 90.0 || std::abs(values.y()) > 360.0) {
        return Status::Error(
            paths.database_path + ": image " +
            scene.images.at(stored.image_id).name +
            " has a latitude beyond 90 degrees or a longitude beyond "
            "360");
      }
      const GeodeticPosition position{values.x(), values.y(), values.z()};
      if (!frame.has_value()) {
        frame.emplace(position);
        import->tables.position_origin = position;
      }
      prior.position = frame->EnuFromGeodetic(position);
    }
    import->tables.positions.push_back(prior);
  }
  return Status::Ok();
}

}  // namespace

Status ImportPositions(const PriorImportPaths& paths,
                       const PositionPriorOptions& options,
                       const SensorCalibration& calibration,
                       const SceneData& scene,
                       const std::vector<ImageStamp>& stamps,
                       PriorImport* import) {
  if (paths.gnss_path.empty()) return Status::Ok();
  if (paths.gnss_path == kStoredPositionsPath) {
    return ImportStoredPositions(paths, calibration, scene, import);
  }
  const StatusOr<GnssLog> log =
      ReadGnss(paths.gnss_path, calibration.gnss_noise, &import->warnings);
  if (!log.ok()) return log.status();
  StatusOr<PositionPriors> positions =
      ComputePositionPriors(options, calibration, stamps, log->fixes);
  if (!positions.ok()) {
    return Status::Error(paths.gnss_path + ": " + positions.status().message());
  }
  if (!calibration.has_gnss) {
    import->warnings.push_back(
        "the calibration has no gnss0, so the antenna is taken to be at the "
        "camera, and the noise of positions that state none to be 2 m");
  }
  import->num_fixes = positions->num_fixes;
  import->num_fixes_outside = positions->num_fixes_outside;
  import->num_fixes_left_out = log->num_left_out;
  import->tables.positions = std::move(positions->priors);
  import->tables.position_origin = positions->origin;
  return Status::Ok();
}

}  // namespace adasfm
