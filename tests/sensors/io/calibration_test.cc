// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/calibration.h"

#include <gtest/gtest.h>

#include "tests/testing/sensors/readers_fixture.h"

namespace adasfm {
namespace {

using CalibrationTest = Readers;

std::string Replaced(std::string text, const std::string& from,
                     const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

TEST_F(CalibrationTest, CalibrationOfARig) {
  const std::string second =
      "cam1:\n  T_cam_imu: [[0, -1, 0, -0.4], [0, 0, -1, 0.2], "
      "[1, 0, 0, 0.3], [0, 0, 0, 1]]\n";
  const auto rig = ReadSensorCalibration(
      Write("rig.yaml", kCalibration + second +
                            "  timeshift_cam_imu: 0.0625\n"
                            "cam2:\n  resolution: [800, 500]\n"));
  ASSERT_TRUE(rig.ok()) << rig.status().message();
  // cam2 has no extrinsics.
  ASSERT_EQ(rig->other_cams_from_imu.size(), 1u);
  EXPECT_EQ(rig->other_cams_from_imu[0].translation.x(), -0.4);
  EXPECT_TRUE(ReadSensorCalibration(Write("one.yaml", kCalibration))
                  ->other_cams_from_imu.empty());
  const std::string path =
      Write("apart.yaml", kCalibration + second + "  timeshift_cam_imu: 0.1\n");
  ExpectError(ReadSensorCalibration(path).status(), path,
              {"cam1/timeshift_cam_imu", "millisecond"});
}

TEST_F(CalibrationTest, Calibration) {
  const auto calibration =
      ReadSensorCalibration(Write("sensors.yaml", kCalibration));
  ASSERT_TRUE(calibration.ok()) << calibration.status().message();
  EXPECT_EQ(calibration->timeshift_cam_imu_s, 0.0623);
  EXPECT_TRUE(calibration->has_imu && calibration->has_wheel);
  EXPECT_EQ(calibration->imu_noise.gyroscope_noise_density, 5e-4);
  EXPECT_EQ(calibration->imu_from_wheel.translation.y(), 0.5);
  EXPECT_LT((calibration->cam_from_imu * Eigen::Vector3d(1, 0, 0) -
             Eigen::Vector3d(0.1, 0.2, 1.3))
                .norm(),
            1e-12);
}

TEST_F(CalibrationTest, CalibrationErrors) {
  const std::string good = kCalibration;
  struct Case {
    std::string text;
    std::vector<std::string> words;
  };
  const Case cases[] = {
      {"cam0: [1, 2\n", {"line", "YAML"}},
      {"", {"no YAML keys"}},
      {Replaced(good, "T_cam_imu", "T_imu_cam"), {"T_cam_imu", "missing"}},
      {Replaced(good, "[1, 0, 0, 0.3]", "[2, 0, 0, 0.3]"),
       {"T_cam_imu", "not a rotation"}},
      {Replaced(good, "[1, 0, 0, 0.3]", "[-1, 0, 0, 0.3]"),
       {"T_cam_imu", "mirrors"}},
      {Replaced(good, "[1, 0, 0, 0.3]", "[1, 0, 0]"), {"T_cam_imu", "row 3"}},
      {Replaced(good, "update_rate: 200.0", "update_rate: fast"),
       {"update_rate", "not a number"}},
      {Replaced(good, "5.0e-4", "-5.0e-4"),
       {"gyroscope_noise_density", "positive"}},
      {Replaced(good, "5.0e-4", "1e-40"),
       {"gyroscope_noise_density is 1e-40", "between 1e-08 and 1 "}},
      {Replaced(good, "speed_noise: 0.05", "speed_noise: 1e200"),
       {"speed_noise is 1e+200 m/s", "possible"}},
      {Replaced(good, "2.0e-5", "1e-20"), {"gyroscope_random_walk is 1e-20"}},
      {Replaced(good, "  track_width: 1.2\n", ""), {"track_width", "missing"}},
      {Replaced(good, "type: differential", "type: tracked"),
       {"wheel0/type", "tracked"}}};
  int number = 0;
  for (const Case& c : cases) {
    const std::string path =
        Write("s" + std::to_string(number++) + ".yaml", c.text);
    ExpectError(ReadSensorCalibration(path).status(), path, c.words);
  }
  ExpectError(ReadSensorCalibration(folder_ + "/none.yaml").status(),
              "none.yaml", {"no such file"});
}

TEST_F(CalibrationTest, CalibrationOfAReceiver) {
  const std::string camera =
      "cam0:\n  T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, "
      "0, 1]]\n";
  auto read = ReadSensorCalibration(Write("none.yaml", camera));
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_FALSE(read->has_gnss);
  read = ReadSensorCalibration(
      Write("point.yaml", camera + "gnss0:\n  p_imu_antenna: [0.1, -0.2, 1.5]\n"
                                   "  timeshift_gnss_imu: 0.25\n"
                                   "  horizontal_noise: 0.5\n"));
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_TRUE(read->has_gnss);
  EXPECT_EQ(read->antenna_in_imu, Eigen::Vector3d(0.1, -0.2, 1.5));
  EXPECT_EQ(read->timeshift_gnss_imu_s, 0.25);
  EXPECT_EQ(read->gnss_noise.horizontal_m, 0.5);
  EXPECT_EQ(read->gnss_noise.vertical_m, 1.0);
  read = ReadSensorCalibration(Write(
      "transform.yaml",
      camera + "gnss0:\n  T_imu_gnss: [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, "
               "3], [0, 0, 0, 1]]\n"));
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_EQ(read->antenna_in_imu, Eigen::Vector3d(1.0, 2.0, 3.0));
  const struct {
    std::string text;
    std::string word;
  } cases[] = {{"gnss0:\n  horizontal_noise: 1\n", "p_imu_antenna"},
               {"gnss0:\n  p_imu_antenna: [1, 2]\n", "3 numbers"},
               {"gnss0:\n  p_imu_antenna: [1, 2, up]\n", "not a number"},
               {"gnss0:\n  p_imu_antenna: [0, 0, 0]\n  horizontal_noise: 0\n",
                "horizontal_noise"}};
  for (const auto& c : cases) {
    const std::string path = Write("bad.yaml", camera + c.text);
    ExpectError(ReadSensorCalibration(path).status(), path, {c.word});
  }
}

}  // namespace
}  // namespace adasfm
