// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <clocale>
#include <cstdlib>

#include "core/random.h"
#include "sensors/io/calibration.h"
#include "sensors/io/read_image_times.h"
#include "sensors/io/read_imu.h"
#include "sensors/io/read_wheel.h"
#include "tests/testing/sensors/readers_fixture.h"

namespace adasfm {
namespace {

const char kImuHeader[] =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad "
    "s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";

// A machine at rest, sampled at 100 Hz.
std::string RestingImu(int num, double rate, double force) {
  Random random(1);
  std::string text = kImuHeader;
  for (int i = 0; i < num; ++i) {
    text += std::to_string(1'000'000'000'000 + 10'000'000LL * i);
    for (int k = 0; k < 3; ++k) {
      text += "," + std::to_string(rate * random.Uniform(-1.0, 1.0));
    }
    text += ",0.01,0.02," + std::to_string(force) + "\n";
  }
  return text;
}

TEST_F(Readers, ImageTimesOfAllFormats) {
  auto euroc = ReadImageTimes(Write(
      "data.csv", "#timestamp [ns],filename\r\n10,a.png\r\n20,b.png\r\n"));
  ASSERT_TRUE(euroc.ok()) << euroc.status().message();
  ASSERT_EQ(euroc->size(), 2u);
  EXPECT_EQ((*euroc)[1].timestamp_ns, 20);
  EXPECT_EQ((*euroc)[1].name, "b.png");
  auto tum = ReadImageTimes(
      Write("rgb.txt", "# color images\n1305031452.791720123 rgb/1305.png\n"));
  ASSERT_TRUE(tum.ok()) << tum.status().message();
  EXPECT_EQ((*tum)[0].timestamp_ns, 1305031452791720123);
  EXPECT_EQ((*tum)[0].name, "1305.png");
  auto seasons =
      ReadImageTimes(Write("times.txt", "1610 1610.5 0.3\n1611 1610.6 0.3"));
  ASSERT_TRUE(seasons.ok()) << seasons.status().message();
  EXPECT_EQ((*seasons)[1].timestamp_ns, 1610600000000);
  EXPECT_EQ((*seasons)[1].name, "1611.png");
}

TEST_F(Readers, ImagesOfARigHaveEqualTimes) {
  const auto times =
      ReadImageTimes(Write("data.csv", "10,cam0/a.png\n10,cam1/a.png\n"));
  ASSERT_TRUE(times.ok()) << times.status().message();
  EXPECT_EQ((*times)[1].timestamp_ns, 10);
  EXPECT_EQ((*times)[1].name, "cam1/a.png");
}

TEST_F(Readers, ImageTimesErrors) {
  std::string path = folder_ + "/absent.csv";
  ExpectError(ReadImageTimes(path).status(), path, {"no such file"});
  path = Write("empty.csv", "");
  ExpectError(ReadImageTimes(path).status(), path, {"no data lines"});
  ExpectError(ReadImageTimes(folder_).status(), folder_, {"folder"});
  path = Write("a.csv", "1,a.png\n2,a.png\n");
  ExpectError(ReadImageTimes(path).status(), path, {"line 2", "'a.png'"});
  path = Write("b.csv", "2,a.png\n1,b.png\n");
  ExpectError(ReadImageTimes(path).status(), path, {"line 2", "increase"});
  path = Write("c.csv", "1,a.png\n2.5,b.png\n");
  ExpectError(ReadImageTimes(path).status(), path, {"line 2", "nanoseconds"});
  path = Write("d.csv", "1,a.png\n2,b.png,c\n");
  ExpectError(ReadImageTimes(path).status(), path, {"line 2", "3 columns"});
}

TEST(ParseImageNameTime, TakesNanosecondsOnly) {
  timestamp_t time;
  EXPECT_TRUE(ParseImageNameTime("cam0/1600000003200000000.png", &time));
  EXPECT_EQ(time, 1600000003200000000);
  EXPECT_FALSE(ParseImageNameTime("000123.png", &time));
  EXPECT_FALSE(ParseImageNameTime("frame1600000003200000000.png", &time));
  EXPECT_FALSE(ParseImageNameTime("", &time));
}

TEST_F(Readers, ImuWithCommasAndSpaces) {
  auto euroc = ReadImu(Write("imu.csv", RestingImu(300, 0.001, 9.8)));
  ASSERT_TRUE(euroc.ok()) << euroc.status().message();
  EXPECT_EQ(euroc->size(), 300u);
  EXPECT_NEAR((*euroc)[7].specific_force.z(), 9.8, 1e-9);
  auto seasons = ReadImu(Write(
      "imu.txt", "100 0.1 -0.2 3e-1 0 0 9.81\n200 0.1 -0.2 0.3 0 0 9.81\n"));
  ASSERT_TRUE(seasons.ok()) << seasons.status().message();
  EXPECT_EQ((*seasons)[0].angular_velocity, Eigen::Vector3d(0.1, -0.2, 0.3));
}

// With a locale whose decimal separator is a comma, which localedef compiles
// for the test.
TEST_F(Readers, NumbersDoNotDependOnTheLocale) {
  const std::string path = Write("imu.csv", "100,0.5,0,0,0,0,9.81\n");
  const std::string compile = "localedef -i de_DE -f UTF-8 '" + folder_ +
                              "/de_DE.UTF-8' > /dev/null 2>&1";
  if (std::system(compile.c_str()) != 0) {
    GTEST_SKIP() << "no German locale here; install Debian's locales";
  }
  const std::string old = std::setlocale(LC_ALL, nullptr);
  setenv("LOCPATH", folder_.c_str(), 1);
  const bool is_set = std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr;
  const std::string separator = std::localeconv()->decimal_point;
  const auto imu = ReadImu(path);
  std::setlocale(LC_ALL, old.c_str());
  unsetenv("LOCPATH");
  ASSERT_TRUE(is_set);
  EXPECT_EQ(separator, ",");
  ASSERT_TRUE(imu.ok()) << imu.status().message();
  EXPECT_EQ((*imu)[0].angular_velocity.x(), 0.5);
}

TEST_F(Readers, ImuErrors) {
  const std::string good = "10,0,0,0,0,0,9.81\n";
  struct Case {
    std::string text;
    std::vector<std::string> words;
  };
  const Case cases[] = {
      {good + "20,0,0,0,0,0,9.81\n15,0,0,0,0,0,9.81\n", {"line 3", "back"}},
      {good + good, {"line 2", "repeats"}},
      {good + "20,0,nan,0,0,0,9.81\n", {"line 2", "column 3", "nan"}},
      {good + "20,0,inf,0,0,0,9.81\n", {"line 2", "column 3", "inf"}},
      {good + "20,0,0,0,0,9.81\n", {"line 2", "6 columns", "7"}},
      {good + "x,0,0,0,0,0,9.81\n", {"line 2", "column 1"}},
      {good + "20,0,0,0,0,0,9.81abc\n", {"line 2", "column 7"}},
      {RestingImu(300, 0.001, 1.0), {"line 2", "look like g", "9.81"}},
      {RestingImu(300, 20.0, 9.81), {"deg/s", "pi / 180"}},
      {RestingImu(300, 0.001, 9.0), {"line 2", "at rest", "9.0"}},
      {RestingImu(300, 0.001, 0.0), {"contain gravity"}},
      {kImuHeader, {"no data lines"}}};
  int number = 0;
  for (const Case& c : cases) {
    const std::string path =
        Write("imu" + std::to_string(number++) + ".csv", c.text);
    ExpectError(ReadImu(path).status(), path, c.words);
  }
}

TEST_F(Readers, GapsAreWarnings) {
  std::string text = RestingImu(300, 0.001, 9.81);
  text += "1000005000000000,0,0,0,0,0,9.81\n";
  const std::string path = Write("imu.csv", text);
  std::vector<std::string> warnings;
  ASSERT_TRUE(ReadImu(path, &warnings).ok());
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("line 302"), std::string::npos) << warnings[0];
}

// Windows editors write a byte order mark.
TEST_F(Readers, TakeAByteOrderMark) {
  const std::string mark = "\xEF\xBB\xBF";
  const auto imu =
      ReadImu(Write("imu.csv", mark + RestingImu(300, 0.001, 9.81)));
  ASSERT_TRUE(imu.ok()) << imu.status().message();
  EXPECT_EQ(imu->size(), 300u);
  const auto wheel =
      ReadWheel(Write("wheel.csv", mark + "#timestamp [ns],v [m s^-1]\n10,1\n"),
                WheelType::kSpeed);
  EXPECT_TRUE(wheel.ok()) << wheel.status().message();
}

TEST_F(Readers, RefuseAPipe) {
  const std::string path = folder_ + "/pipe";
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  ExpectError(ReadImu(path).status(), path, {"no regular file"});
}

TEST_F(Readers, KittiOxts) {
  Write("oxts/timestamps.txt",
        "2011-09-26 13:02:25.594360375\n2011-09-26 13:02:25.604360375\n");
  // ax ay az and wx wy wz are the fields from 11 and 17.
  const auto imu_text = [](const std::string& wz) {
    std::string text;
    for (int i = 0; i < 30; ++i) {
      const bool is_up = i == 13;
      text += is_up ? "9.81 " : i == 19 ? wz + " " : "0 ";
    }
    return text;
  };
  Write("oxts/data/0000000000.txt", imu_text("0.25"));
  Write("oxts/data/0000000001.txt", imu_text("0.50"));
  const auto imu = ReadImu(folder_ + "/oxts");
  ASSERT_TRUE(imu.ok()) << imu.status().message();
  ASSERT_EQ(imu->size(), 2u);
  EXPECT_EQ((*imu)[0].timestamp_ns, 1317042145594360375);
  EXPECT_EQ((*imu)[1].angular_velocity, Eigen::Vector3d(0, 0, 0.5));
  EXPECT_EQ((*imu)[1].specific_force, Eigen::Vector3d(0, 0, 9.81));
  std::filesystem::remove(folder_ + "/oxts/data/0000000001.txt");
  ExpectError(ReadImu(folder_ + "/oxts").status(), "0000000001.txt",
              {"no such file"});
  // These seconds and the year in nanoseconds would exceed 64 bits.
  Write("oxts/timestamps.txt", "2200-12-31 23:59:8999999999\n");
  ExpectError(ReadImu(folder_ + "/oxts").status(), "timestamps.txt",
              {"line 1", "hh:mm:ss"});
}

TEST_F(Readers, WheelTypesByHeader) {
  const std::pair<std::string, WheelType> cases[] = {
      {"#timestamp [ns],v_left [m s^-1],v_right [m s^-1]\n1,2,3\n",
       WheelType::kDifferential},
      {"#timestamp [ns],v [m s^-1],omega [rad s^-1]\n1,2,3\n",
       WheelType::kVelocity},
      {"#timestamp [ns],v [m s^-1]\n1,2\n", WheelType::kSpeed},
      {"#timestamp [ns],ticks_left,ticks_right\n1,2,3\n", WheelType::kTicks},
      {"#timestamp [ns],v [m s^-1],steering [rad]\n1,2,0.3\n",
       WheelType::kSteering},
      {"#timestamp [ns],ticks\n1,2\n", WheelType::kEncoder},
      {"timestamp,v_left,v_right\n1,2,3\n", WheelType::kDifferential}};
  for (const auto& [text, type] : cases) {
    const std::string path = Write("wheel.csv", text);
    const auto found = ReadWheelType(path);
    ASSERT_TRUE(found.ok()) << found.status().message();
    EXPECT_EQ(*found, type);
    const auto samples = ReadWheel(path, type);
    ASSERT_TRUE(samples.ok()) << samples.status().message();
    EXPECT_EQ((*samples)[0].first, 2.0);
    EXPECT_EQ((*samples)[0].second,
              type == WheelType::kSteering                               ? 0.3
              : type == WheelType::kSpeed || type == WheelType::kEncoder ? 0.0
                                                                         : 3.0);
  }
}

TEST_F(Readers, WheelErrors) {
  std::string path = Write("a.csv", "#timestamp [ns],rpm\n1,2\n");
  ExpectError(ReadWheelType(path).status(), path, {"header", "v_left"});
  path = Write("b.csv", "#timestamp [ns],v [m s^-1]\n1,2\n");
  ExpectError(ReadWheel(path, WheelType::kDifferential).status(), path,
              {"speed", "differential", "wheel0/type"});
  path = Write("c.csv", "#timestamp [ns],v [m s^-1]\n1,2\n2,900\n");
  ExpectError(ReadWheel(path, WheelType::kSpeed).status(), path,
              {"line 3", "km/h"});
  path = Write("d.csv", "#timestamp [ns],v [m s^-1]\n1,2\n1,3\n");
  ExpectError(ReadWheel(path, WheelType::kSpeed).status(), path,
              {"line 3", "repeats"});
}

TEST_F(Readers, OdometryInSecondsAndNanoseconds) {
  auto tum = ReadOdometry(Write("tum.txt", "1.5 1 2 3 0 0 0 1\n"));
  ASSERT_TRUE(tum.ok()) << tum.status().message();
  EXPECT_EQ((*tum)[0].timestamp_ns, 1500000000);
  EXPECT_EQ((*tum)[0].world_from_body.translation, Eigen::Vector3d(1, 2, 3));
  auto seasons =
      ReadOdometry(Write("result.txt", "1600000000000000000 1 2 3 0 0 0 1\n"));
  ASSERT_TRUE(seasons.ok()) << seasons.status().message();
  EXPECT_EQ((*seasons)[0].timestamp_ns, 1600000000000000000);
  const std::string path = Write("bad.txt", "1.5 1 2 3 0 0 0 2\n");
  ExpectError(ReadOdometry(path).status(), path, {"line 1", "quaternion"});
}

// Whatever the bytes: a value or an error, never a crash.
TEST_F(Readers, DamagedFilesGiveAnErrorOrAValue) {
  const std::string texts[] = {
      RestingImu(20, 0.001, 9.81), kCalibration,
      "#timestamp [ns],v [m s^-1],omega [rad s^-1]\n1,2,3\n20,3,4\n",
      "1.5 1 2 3 0 0 0 1\n2.5 1 2 3 0 0 0 1\n", "10,a.png\n20,b.png\n"};
  Random random(3);
  const std::string alphabet = ",.-+e#\n\r\t 0123456789nai[]{}:\xff";
  for (int run = 0; run < 1000; ++run) {
    std::string text = texts[run % 5];
    for (int i = 0; i < 5; ++i) {
      const size_t position = random.UniformInt(0, text.size() - 1);
      const char letter = alphabet[random.UniformInt(0, alphabet.size() - 1)];
      if (random.Uniform(0.0, 1.0) < 0.3) {
        text.resize(position + 1);
      } else if (random.Uniform(0.0, 1.0) < 0.5) {
        text.insert(position, 1, letter);
      } else {
        text[position] = letter;
      }
    }
    const std::string path = Write("damaged", text);
    const auto one_line = [](const Status& status) {
      return status.ok() || !status.message().empty();
    };
    EXPECT_TRUE(one_line(ReadImu(path).status()));
    EXPECT_TRUE(one_line(ReadSensorCalibration(path).status()));
    EXPECT_TRUE(one_line(ReadImageTimes(path).status()));
    EXPECT_TRUE(one_line(ReadWheel(path, WheelType::kVelocity).status()));
    EXPECT_TRUE(one_line(ReadOdometry(path).status()));
  }
}

}  // namespace
}  // namespace adasfm
