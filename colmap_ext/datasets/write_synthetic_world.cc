// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/datasets/write_synthetic_world.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <iomanip>
#include <limits>
#include <sstream>
#include <system_error>
#include <vector>

#include "colmap_ext/host/camera_models.h"
#include "colmap_ext/host/database_writer.h"
#include "colmap_ext/io/output_files.h"
#include "core/sqlite.h"
#include "synthetic/world_summary.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

colmap::Camera ConvertCamera(camera_t camera_id,
                             const SyntheticCamera& synthetic) {
  std::vector<double> params = {synthetic.focal_px, synthetic.focal_px,
                                synthetic.principal_x_px,
                                synthetic.principal_y_px};
  const bool is_fisheye = synthetic.model == SyntheticCameraModel::kFisheye;
  if (is_fisheye) {
    for (int i = 0; i < 4; ++i) params.push_back(synthetic.fisheye_coeffs[i]);
  }
  return MakeCamera(camera_id,
                    *CameraModelId(is_fisheye ? "OPENCV_FISHEYE" : "PINHOLE"),
                    synthetic.width, synthetic.height, params,
                    /*has_prior_focal_length=*/true);
}

void WriteImages(const SyntheticWorld& world, DatabaseWriter* database) {
  for (const SyntheticImage& synthetic : world.images) {
    DatabaseImage image;
    image.image_id = synthetic.image_id;
    image.camera_id = 1 + synthetic.camera_index;
    image.name = synthetic.name;
    database->WriteImage(image);
    database->WriteKeypoints(synthetic.image_id, synthetic.keypoints);
  }
}

void WritePairs(const SyntheticWorld& world, DatabaseWriter* database) {
  for (const SyntheticPair& pair : world.pairs) {
    const ImagePair images(pair.image_id1, pair.image_id2);
    database->WriteMatches(images, pair.raw_matches);
    database->WriteTwoViewGeometry(images, pair.inlier_matches,
                                   pair.cam2_from_cam1);
  }
}

Status WriteText(const fs::path& path,
                 const std::function<void(std::ostream*)>& write) {
  std::ostringstream text;
  text << std::setprecision(9);
  write(&text);
  return WriteTextFile(path.string(), text.str());
}

size_t NumCameras(const SyntheticWorld& world) {
  return 1 + world.images.back().camera_index;
}

// COLMAP's class prints a message about a failed write and continues.
bool HasAllRows(const SyntheticWorld& world, const std::string& path) {
  const std::pair<const char*, size_t> tables[] = {
      {"cameras", NumCameras(world)},
      {"images", world.images.size()},
      {"keypoints", world.images.size()},
      {"matches", world.pairs.size()},
      {"two_view_geometries", world.pairs.size()}};
  // Rows that COLMAP's class could not move from the -wal file on closing would
  // be lost.
  if (fs::exists(path + "-wal")) return false;
  try {
    SqliteConnection database(path, SqliteConnection::Mode::kRead);
    SqliteStatement check(&database, "PRAGMA quick_check");
    bool is_whole = check.Step() && check.Text(0) == "ok";
    for (const auto& [table, num_rows] : tables) {
      SqliteStatement count(&database,
                            std::string("SELECT COUNT(*) FROM ") + table);
      is_whole &=
          count.Step() && count.Int(0) == static_cast<int64_t>(num_rows);
    }
    return is_whole;
  } catch (const SqliteError&) {
    return false;
  }
}

void RemoveDatabase(const std::string& path) {
  std::error_code ignored;
  for (const char* suffix : {"", "-wal", "-shm", "-journal"}) {
    fs::remove(path + suffix, ignored);
  }
}

void WriteImu(const SyntheticWorld& world, std::ostream* file) {
  *file << "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],"
           "w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],"
           "a_RS_S_z [m s^-2]\n";
  for (const ImuSample& sample : world.imu_samples) {
    *file << sample.timestamp_ns;
    for (int k = 0; k < 3; ++k) *file << "," << sample.angular_velocity[k];
    for (int k = 0; k < 3; ++k) *file << "," << sample.specific_force[k];
    *file << "\n";
  }
}

void WriteWheels(const SyntheticWorld& world, std::ostream* file) {
  *file << "#timestamp [ns],v_left [m s^-1],v_right [m s^-1]\n"
        << std::fixed << std::setprecision(6);
  for (const WheelSample& sample : world.wheel_samples) {
    *file << sample.timestamp_ns << "," << sample.first << "," << sample.second
          << "\n";
  }
}

void WriteTimes(const SyntheticWorld& world, std::ostream* file) {
  *file << "#timestamp [ns],filename\n";
  std::vector<std::pair<timestamp_t, std::string>> times;
  for (const SyntheticImage& image : world.images) {
    times.emplace_back(image.timestamp_ns, image.name);
  }
  std::sort(times.begin(), times.end());
  for (const auto& [time_ns, name] : times) {
    *file << time_ns << "," << name << "\n";
  }
}

void WriteGroundTruth(const SyntheticWorld& world, std::ostream* file) {
  *file << std::fixed << std::setprecision(9);
  for (const SyntheticImage& image : world.images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    const Eigen::Vector3d& t = image.cam_from_world.translation;
    *file << image.name << " " << q.w() << " " << q.x() << " " << q.y() << " "
          << q.z() << " " << t.x() << " " << t.y() << " " << t.z() << "\n";
  }
}

void WriteLandmarks(const SyntheticWorld& world, std::ostream* file) {
  for (const SyntheticImage& image : world.images) {
    *file << image.name;
    for (const int id : image.landmark_ids) *file << " " << id;
    *file << "\n";
  }
}

void WriteTransform(const char* key, const Rigid3d& transform,
                    std::ostream* file) {
  const Eigen::Matrix<double, 3, 4> matrix = transform.ToMatrix();
  *file << "  " << key << ":\n";
  for (int row = 0; row < 3; ++row) {
    *file << "    - [";
    for (int column = 0; column < 4; ++column) {
      *file << (column > 0 ? ", " : "") << matrix(row, column);
    }
    *file << "]\n";
  }
  *file << "    - [0.0, 0.0, 0.0, 1.0]\n";
}

void WriteCamera(const SyntheticWorld& world, int index,
                 const Rigid3d& cam_from_imu, std::ostream* file) {
  const SyntheticCamera& camera = world.camera;
  const bool is_fisheye = camera.model == SyntheticCameraModel::kFisheye;
  const Eigen::Vector4d& k = camera.fisheye_coeffs;
  // Calibration tools have pixel centres at whole numbers, COLMAP at .5.
  *file << "cam" << index << ":\n  camera_model: pinhole\n"
        << "  intrinsics: [" << camera.focal_px << ", " << camera.focal_px
        << ", " << camera.principal_x_px - 0.5 << ", "
        << camera.principal_y_px - 0.5
        << "]\n  distortion_model: " << (is_fisheye ? "equidistant" : "radtan")
        << "\n  distortion_coeffs: [" << k[0] << ", " << k[1] << ", " << k[2]
        << ", " << k[3] << "]\n  resolution: [" << camera.width << ", "
        << camera.height << "]\n";
  WriteTransform("T_cam_imu", cam_from_imu, file);
  *file << "  timeshift_cam_imu: " << world.options.timeshift_cam_imu_s << "\n";
}

void WriteSensors(const SyntheticWorld& world, std::ostream* file) {
  const SyntheticWorldOptions& options = world.options;
  *file << std::setprecision(12);
  WriteCamera(world, 0, world.cam_from_imu, file);
  if (NumCameras(world) > 1) {
    WriteCamera(world, 1, world.cam1_from_cam0 * world.cam_from_imu, file);
  }
  const ImuNoise& noise = options.imu_noise;
  *file << "imu0:\n  update_rate: " << options.imu_rate_hz
        << "\n  gyroscope_noise_density: " << noise.gyroscope_noise_density
        << "\n  gyroscope_random_walk: " << noise.gyroscope_random_walk
        << "\n  accelerometer_noise_density: "
        << noise.accelerometer_noise_density
        << "\n  accelerometer_random_walk: " << noise.accelerometer_random_walk
        << "\nwheel0:\n  type: differential\n  update_rate: "
        << kSyntheticWheelRateHz << "\n  track_width: " << world.track_width_m
        << "\n  speed_noise: " << options.wheel_speed_noise << "\n";
  WriteTransform("T_imu_wheel", world.imu_from_wheel, file);
  if (world.gnss_fixes.empty()) return;
  const Eigen::Vector3d& antenna = world.antenna_in_imu;
  *file << "gnss0:\n  p_imu_antenna: [" << antenna.x() << ", " << antenna.y()
        << ", " << antenna.z() << "]\n";
}

void WriteGnss(const SyntheticWorld& world, std::ostream* file) {
  *file << "#timestamp [ns],latitude [deg],longitude [deg],altitude [m],"
           "sigma_horizontal [m],sigma_vertical [m]\n"
        << std::setprecision(17);
  const EnuFrame frame(kSyntheticWorldOrigin);
  // No receiver states an error of zero.
  const double sigma_m = std::max(0.01, world.options.gnss_noise_m);
  for (const SyntheticFix& fix : world.gnss_fixes) {
    const GeodeticPosition position =
        frame.GeodeticFromEnu(fix.position_in_world);
    *file << fix.timestamp_ns << "," << position.latitude_deg << ","
          << position.longitude_deg << "," << position.height_m << ","
          << sigma_m << "," << sigma_m << "\n";
  }
}

void WriteSummary(const SyntheticWorld& world, std::ostream* file) {
  const char* separator = "{";
  for (const auto& [name, value] : ListFigures(SummarizeWorld(world))) {
    *file << separator << "\n  \"" << name << "\": " << value;
    separator = ",";
  }
  *file << "\n}\n";
}

}  // namespace

Status WriteSyntheticDatabase(const SyntheticWorld& world,
                              const std::string& path) {
  // COLMAP ends the process when it cannot open a file, so this is tested
  // first.
  const std::string temporary = path + ".tmp";
  RemoveDatabase(temporary);
  Status status = WriteTextFile(temporary, "");
  if (!status.ok()) return status;
  {
    DatabaseWriter database(temporary);
    for (size_t i = 0; i < NumCameras(world); ++i) {
      database.WriteCamera(ConvertCamera(1 + i, world.camera));
    }
    WriteImages(world, &database);
    WritePairs(world, &database);
  }
  if (!HasAllRows(world, temporary)) {
    status = Status::Error("cannot write " + path + ": " +
                           DescribeWriteFailure(temporary));
    RemoveDatabase(temporary);
    return status;
  }
  status = SyncToDisk(temporary);
  if (!status.ok()) return status;
  std::error_code error;
  fs::rename(temporary, path, error);
  if (!error) return Status::Ok();
  return Status::Error("cannot write " + path + ": " + error.message());
}

Status WriteSyntheticLogs(const SyntheticWorld& world,
                          const std::string& folder) {
  using Writer = void (*)(const SyntheticWorld&, std::ostream*);
  // landmarks.txt comes first: it marks a world of ours, so that a later run
  // may replace it when this run is interrupted.
  std::vector<std::pair<const char*, Writer>> files = {
      {"landmarks.txt", WriteLandmarks}, {"imu.csv", WriteImu},
      {"wheel.csv", WriteWheels},        {"times.csv", WriteTimes},
      {"sensors.yaml", WriteSensors},    {"gt.txt", WriteGroundTruth},
      {"world.json", WriteSummary}};
  if (!world.gnss_fixes.empty()) files.emplace_back("gnss.csv", WriteGnss);
  for (const auto& [name, write] : files) {
    const Status status = WriteText(
        fs::path(folder) / name,
        [&world, write = write](std::ostream* file) { write(world, file); });
    if (!status.ok()) return status;
  }
  return Status::Ok();
}

}  // namespace adasfm
