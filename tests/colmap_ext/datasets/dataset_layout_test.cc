// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/datasets/dataset_layout.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <iomanip>
#include <sstream>

#include "core/random.h"
#include "core/so3.h"
#include "sensors/io/calibration.h"
#include "sensors/io/read_image_times.h"
#include "sensors/io/read_imu.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

class LayoutTest : public testing::Test {
 protected:
  // Writes a file below the folder, with its parents.
  std::string Write(const std::string& name, const std::string& text) {
    fs::create_directories(fs::path(folder_.File(name)).parent_path());
    return folder_.Write(name, text);
  }

  DatasetLayout Find(const std::string& format, const std::string& root) {
    const StatusOr<DatasetLayout> layout =
        FindDatasetLayout(format, folder_.File(root));
    EXPECT_TRUE(layout.ok()) << layout.status().message();
    return layout.ok() ? *layout : DatasetLayout();
  }

  void ExpectError(const std::string& format, const std::string& root,
                   const std::string& message) {
    const StatusOr<DatasetLayout> layout =
        FindDatasetLayout(format, folder_.File(root));
    ASSERT_FALSE(layout.ok());
    EXPECT_NE(layout.status().message().find(message), std::string::npos)
        << layout.status().message();
  }

  // Each of the files must be named when it is missing, and when it is empty.
  void ExpectErrorWithout(const std::string& format, const std::string& root,
                          const std::vector<std::string>& files) {
    for (const std::string& name : files) {
      const std::string path = folder_.File(name), kept = path + ".kept";
      const std::string last = fs::path(name).filename();
      fs::rename(path, kept);
      ExpectError(format, root, last + " is missing");
      if (fs::is_regular_file(kept)) {
        folder_.Write(name, "");
        ExpectError(format, root, last);
        fs::remove(path);
      }
      fs::rename(kept, path);
    }
    Find(format, root);
  }

  SensorCalibration ReadSensors(const DatasetLayout& layout) {
    const StatusOr<SensorCalibration> calibration = ReadSensorCalibration(
        folder_.Write("sensors.yaml", layout.sensors_text));
    EXPECT_TRUE(calibration.ok()) << calibration.status().message();
    return calibration.ok() ? *calibration : SensorCalibration();
  }

  TemporaryFolder folder_;
};

std::string Numbers(const Eigen::MatrixXd& matrix, const char* separator) {
  std::ostringstream text;
  text << std::setprecision(12);
  for (int i = 0; i < matrix.rows(); ++i) {
    for (int j = 0; j < matrix.cols(); ++j) {
      text << (i + j == 0 ? "" : separator) << matrix(i, j);
    }
  }
  return text.str();
}

Eigen::Matrix4d Homogeneous(const Rigid3d& transform) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topRows<3>() = transform.ToMatrix();
  return matrix;
}

Rigid3d RandomRigid(Random* random) {
  return Rigid3d(ExpSo3(random->GaussianVector(1.0)),
                 random->GaussianVector(1.0));
}

void ExpectNear(const Rigid3d& a, const Rigid3d& b) {
  EXPECT_LT((a.ToMatrix() - b.ToMatrix()).norm(), 1e-8)
      << a.ToMatrix() << "\n\n"
      << b.ToMatrix();
}

TEST_F(LayoutTest, Euroc) {
  Random random(1);
  const Rigid3d body_from_cam = RandomRigid(&random);
  const Rigid3d body_from_imu = RandomRigid(&random);
  Write("r/mav0/cam0/data/1403636579763555584.png", "");
  Write("r/mav0/cam0/data.csv",
        "#timestamp [ns],filename\n"
        "1403636579763555584,1403636579763555584.png\n");
  Write("r/mav0/cam0/sensor.yaml",
        "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [" +
            Numbers(Homogeneous(body_from_cam), ", ") +
            "]\nrate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\n"
            "intrinsics: [458.5, 457.25, 367, 248] #fu, fv, cu, cv\n"
            "distortion_model: radial-tangential\n"
            "distortion_coefficients: [-0.25, 0.125, 0.0625, -0.5]\n");
  Write("r/mav0/imu0/data.csv", "#header\n1,0,0,0,0,0,9.81\n");
  Write("r/mav0/imu0/sensor.yaml",
        "%YAML:1.0\nT_BS:\n  cols: 4\n  rows: 4\n  data: [" +
            Numbers(Homogeneous(body_from_imu), ", ") +
            "]\nrate_hz: 200\ngyroscope_noise_density: 1.5e-4\n"
            "gyroscope_random_walk: 2.0e-5\n"
            "accelerometer_noise_density: 2.0e-3\n"
            "accelerometer_random_walk: 3.0e-3\n");
  for (const char* root : {"r", "r/mav0"}) {
    const DatasetLayout layout = Find("euroc", root);
    EXPECT_TRUE(fs::is_directory(layout.image_path));
    EXPECT_TRUE(ReadImageTimes(layout.image_times_path).ok());
    EXPECT_TRUE(fs::is_regular_file(layout.imu_path));
    EXPECT_EQ(layout.camera_model, "OPENCV");
    EXPECT_EQ(layout.camera_params,
              "458.5,457.25,367.5,248.5,-0.25,0.125,0.0625,-0.5");
    const SensorCalibration sensors = ReadSensors(layout);
    ExpectNear(sensors.cam_from_imu, body_from_cam.Inverse() * body_from_imu);
    EXPECT_EQ(sensors.imu_rate_hz, 200.0);
    EXPECT_EQ(sensors.imu_noise.gyroscope_noise_density, 1.5e-4);
    EXPECT_EQ(sensors.imu_noise.accelerometer_random_walk, 3.0e-3);
  }
  ExpectErrorWithout("euroc", "r",
                     {"r/mav0/cam0/data", "r/mav0/cam0/data.csv",
                      "r/mav0/cam0/sensor.yaml", "r/mav0/imu0/sensor.yaml"});
  ExpectError("kitti", "r", "calib.txt is missing");
  ExpectError("euroc", "nowhere", "cam0/data is missing");
  ExpectError("rosbag", "r", "must be euroc, 4seasons, kitti or tum");
  Write("r/mav0/cam0/sensor.yaml",
        "distortion_model: fov\nintrinsics: [1, 1, 0, 0]\n"
        "distortion_coefficients: [1, 0, 0, 0]\n");
  ExpectError("euroc", "r", "distortion model 'fov'");
  Write("r/mav0/cam0/sensor.yaml", "T_BS: [1, 2\n");
  ExpectError("euroc", "r", "cam0/sensor.yaml");
}

TEST_F(LayoutTest, FourSeasons) {
  Random random(2);
  const Rigid3d cam_from_imu = RandomRigid(&random);
  std::string rows;
  for (int i = 0; i < 4; ++i) {
    rows += "  - [" + Numbers(Homogeneous(cam_from_imu).row(i), ", ") + "]\n";
  }
  Write("day/recording/undistorted_images/cam0/1586352000123456789.png", "");
  Write("day/recording/distorted_images/cam0/1586352000123456789.png", "");
  Write("day/recording/times.txt", "1586352000123456789 1586352000.123 1.5\n");
  Write("day/recording/imu.txt", "1586352000123456789 0 0 0 0 0 9.81\n");
  Write("day/calibration/camchain.yaml",
        "cam0:\n  T_cam_imu:\n" + rows + "  timeshift_cam_imu: 0.0125\n");
  Write("day/calibration/calib_0.txt",
        "EquiDistant 540 541 400 200 0.25 -0.5 0.125 0\n1000 500\n");
  Write("day/calibration/undistorted_calib_0.txt",
        "Pinhole 501 502 421 167 0.0\n800 400\ncrop\n800 400\n");
  DatasetLayout layout = Find("4seasons", "day/recording");
  EXPECT_EQ(layout.camera_model, "PINHOLE");
  EXPECT_EQ(layout.camera_params, "501,502,421.5,167.5");
  const SensorCalibration sensors = ReadSensors(layout);
  ExpectNear(sensors.cam_from_imu, cam_from_imu);
  EXPECT_EQ(sensors.timeshift_cam_imu_s, 0.0125);
  ExpectErrorWithout(
      "4seasons", "day/recording",
      {"day/recording/times.txt", "day/calibration/camchain.yaml",
       "day/calibration/undistorted_calib_0.txt"});
  // Without the undistorted images the distorted ones are used.
  fs::remove_all(folder_.File("day/recording/undistorted_images"));
  layout = Find("4seasons", "day/recording");
  EXPECT_EQ(layout.camera_model, "OPENCV_FISHEYE");
  EXPECT_EQ(layout.camera_params, "540,541,400.5,200.5,0.25,-0.5,0.125,0");
  Write("day/calibration/calib_0.txt", "FOV 1 2\n");
  ExpectError("4seasons", "day/recording", "calib_0.txt");
}

class KittiTest : public LayoutTest {
 protected:
  void WriteRigid(const std::string& name, const Rigid3d& transform) {
    Write(name, "calib_time: 25-May-2012 16:47:16\nR: " +
                    Numbers(transform.rotation.toRotationMatrix(), " ") +
                    "\nT: " + Numbers(transform.translation.transpose(), " ") +
                    "\n");
  }
};

TEST_F(KittiTest, RawDrive) {
  Random random(3);
  const Rigid3d velo_from_imu = RandomRigid(&random);
  const Rigid3d cam0_from_velo = RandomRigid(&random);
  const Eigen::Quaterniond rectified_from_cam0 =
      ExpSo3(random.GaussianVector(0.01));
  // P = K [I | t]: camera 2 lies 6 cm to the left of camera 0.
  const Eigen::Vector3d shift(0.06, 0.001, 0.002);
  Eigen::Matrix3d calibration;
  calibration << 721.5, 0, 609.5, 0, 720.5, 172.75, 0, 0, 1;
  Eigen::Matrix<double, 3, 4> projection;
  projection << calibration, calibration * shift;
  const std::string drive = "2011_09_26/2011_09_26_drive_0001_sync/";
  WriteRigid("2011_09_26/calib_imu_to_velo.txt", velo_from_imu);
  WriteRigid("2011_09_26/calib_velo_to_cam.txt", cam0_from_velo);
  Write("2011_09_26/calib_cam_to_cam.txt",
        "calib_time: 09-Jan-2012 13:57:47\nR_rect_00: " +
            Numbers(rectified_from_cam0.toRotationMatrix(), " ") +
            "\nP_rect_02: " + Numbers(projection, " ") + "\n");
  std::string imu_times;
  for (int i = 0; i < 4; ++i) {
    const std::string index = std::to_string(i);
    Write(drive + "image_02/data/000000000" + index + ".png", "");
    imu_times += "2011-09-26 13:02:25." + index + "50000000\n";
    std::string packet;
    for (int k = 0; k < 30; ++k) packet += k == 13 ? "9.81 " : "0.0 ";
    Write(drive + "oxts/data/000000000" + index + ".txt", packet + "\n");
  }
  Write(drive + "oxts/timestamps.txt", imu_times);
  Write(drive + "image_02/timestamps.txt",
        "2011-09-26 13:02:25.050000000\n2011-09-26 13:02:25.150000001\n"
        "2011-09-26 13:02:25.250000000\n2011-09-26 13:02:25.350000000\n");
  const DatasetLayout layout = Find("kitti", drive);
  EXPECT_TRUE(fs::is_directory(layout.image_path));
  EXPECT_EQ(layout.camera_model, "PINHOLE");
  EXPECT_EQ(layout.camera_params, "721.5,720.5,610,173.25");
  ExpectNear(
      ReadSensors(layout).cam_from_imu,
      Rigid3d(rectified_from_cam0, shift) * cam0_from_velo * velo_from_imu);
  EXPECT_NEAR(layout.imu_period_s, 0.1, 1e-9);
  // Images and IMU have the same clock.
  const StatusOr<std::vector<ImageTime>> times =
      ReadImageTimes(folder_.Write("times.csv", layout.image_times_text));
  ASSERT_TRUE(times.ok()) << times.status().message();
  ASSERT_EQ(times->size(), 4);
  const StatusOr<std::vector<ImuSample>> imu = ReadImu(layout.imu_path);
  ASSERT_TRUE(imu.ok()) << imu.status().message();
  EXPECT_EQ((*times)[0].timestamp_ns, (*imu)[0].timestamp_ns);
  EXPECT_EQ((*times)[1].timestamp_ns, (*imu)[1].timestamp_ns + 1);
  EXPECT_EQ((*times)[1].name, "0000000001.png");
  ExpectErrorWithout(
      "kitti", drive,
      {drive + "image_02/data", drive + "image_02/timestamps.txt",
       drive + "oxts/timestamps.txt", "2011_09_26/calib_cam_to_cam.txt",
       "2011_09_26/calib_velo_to_cam.txt", "2011_09_26/calib_imu_to_velo.txt"});
  Write("2011_09_26/calib_imu_to_velo.txt", "R: 0 0 0 0 0 0 0 0 0\nT: 0 0 0\n");
  ExpectError("kitti", drive, "calib_imu_to_velo.txt: a transform is not a");
  WriteRigid("2011_09_26/calib_imu_to_velo.txt", velo_from_imu);
  Write(drive + "image_02/data/0000000009.png", "");
  ExpectError("kitti", drive, "none for the photo 0000000009.png");
}

TEST_F(KittiTest, OdometrySequence) {
  Write("sequences/07/image_0/000000.png", "");
  Write("sequences/07/image_0/000001.png", "");
  Write("sequences/07/image_0/.DS_Store", "");
  Write("sequences/07/calib.txt",
        "P0: 707.5 0 601.5 0 0 707.25 183.25 0 0 0 1 0\n"
        "P2: 1 0 0 0 0 1 0 0 0 0 1 0\n");
  Write("sequences/07/times.txt", "0.000000e+00\n1.037500e-01\n");
  const DatasetLayout layout = Find("kitti", "sequences/07");
  EXPECT_EQ(layout.camera_params, "707.5,707.25,602,183.75");
  EXPECT_TRUE(layout.imu_path.empty());
  EXPECT_TRUE(layout.sensors_text.empty());
  const StatusOr<std::vector<ImageTime>> times =
      ReadImageTimes(folder_.Write("times.csv", layout.image_times_text));
  ASSERT_TRUE(times.ok()) << times.status().message();
  ASSERT_EQ(times->size(), 2);
  EXPECT_EQ(times->at(1).name, "000001.png");
  EXPECT_EQ(times->at(1).timestamp_ns, 103750000);
  ExpectErrorWithout("kitti", "sequences/07",
                     {"sequences/07/image_0", "sequences/07/calib.txt",
                      "sequences/07/times.txt"});
  Write("sequences/07/times.txt", "0.0 nan\n");
  ExpectError("kitti", "sequences/07", "'nan' is not a number");
  Write("sequences/07/calib.txt", "P0: 1 2 3\n");
  ExpectError("kitti", "sequences/07", "12 numbers");
}

TEST_F(LayoutTest, Tum) {
  Write("desk/rgb/1305031102.175304.png", "");
  Write("desk/rgb.txt",
        "# color images\n1305031102.175304 rgb/1305031102.175304.png\n");
  const DatasetLayout layout = Find("tum", "desk");
  EXPECT_TRUE(fs::is_directory(layout.image_path));
  EXPECT_TRUE(ReadImageTimes(layout.image_times_path).ok());
  EXPECT_TRUE(layout.camera_params.empty());
  ExpectErrorWithout("tum", "desk", {"desk/rgb", "desk/rgb.txt"});
}

}  // namespace
}  // namespace adasfm
