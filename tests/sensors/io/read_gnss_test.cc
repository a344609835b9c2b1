// SPDX-License-Identifier: BSD-3-Clause
#include "sensors/io/read_gnss.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/testing/bag_writer.h"

namespace adasfm {
namespace {

constexpr char kHeader[] =
    "#timestamp [ns],latitude [deg],longitude [deg],altitude [m]";

class ReadGnssTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = testing::TempDir() + "adasfm_gnss_" + info->name();
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_ + "/data");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const std::string& text) {
    const std::string path = folder_ + "/" + name;
    std::ofstream(path) << text;
    return path;
  }
  StatusOr<GnssLog> Read(const std::string& path) {
    warnings_.clear();
    return ReadGnss(path, GnssNoise(), &warnings_);
  }
  void ExpectError(const std::string& text, const std::string& word) {
    const StatusOr<GnssLog> log = Read(Write("bad.csv", text));
    ASSERT_FALSE(log.ok());
    EXPECT_NE(log.status().message().find(word), std::string::npos)
        << "no '" << word << "' in: " << log.status().message();
    EXPECT_NE(log.status().message().find("bad.csv"), std::string::npos);
  }

  std::string folder_;
  std::vector<std::string> warnings_;
};

// "$" and the checksum around a sentence.
std::string Nmea(const std::string& text) {
  unsigned sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  char end[8];
  std::snprintf(end, sizeof(end), "*%02X\r\n", sum);
  return "$" + text + end;
}

TEST_F(ReadGnssTest, CsvColumnsGoByTheirNames) {
  const auto log = Read(
      Write("a.csv",
            "#lon [deg],lat [deg],note,time [ns],height [m],sigma_vertical "
            "[m],sigma_horizontal [m]\n"
            "11.5,48.1,x,1000000000,500,2,0.5\n"
            "348.4,48.2,y,2000000000,501,0,nan\n"));
  ASSERT_TRUE(log.ok()) << log.status().message();
  ASSERT_EQ(log->fixes.size(), 2u);
  const GnssFix& fix = log->fixes[0];
  EXPECT_EQ(fix.timestamp_ns, 1000000000);
  EXPECT_EQ(fix.position.latitude_deg, 48.1);
  EXPECT_EQ(fix.position.longitude_deg, 11.5);
  EXPECT_EQ(fix.position.height_m, 500.0);
  EXPECT_NEAR(fix.covariance(0, 0), 0.25, 1e-12);
  EXPECT_NEAR(fix.covariance(2, 2), 4.0, 1e-12);
  // Noise that is not stated is the receiver's usual one; longitudes wrap.
  EXPECT_NEAR(log->fixes[1].position.longitude_deg, -11.6, 1e-9);
  EXPECT_NEAR(log->fixes[1].covariance(0, 0), 4.0, 1e-12);
  EXPECT_NEAR(log->fixes[1].covariance(2, 2), 16.0, 1e-12);
}

TEST_F(ReadGnssTest, CsvCovarianceAndHdop) {
  auto log = Read(Write("a.csv", std::string(kHeader) +
                                     ",cov_ee,cov_en,cov_eu,cov_nn,cov_nu,"
                                     "cov_uu\n1,48,11,5,1,0.5,0,2,0,3\n"));
  ASSERT_TRUE(log.ok()) << log.status().message();
  EXPECT_NEAR(log->fixes[0].covariance(0, 1), 0.5, 1e-12);
  EXPECT_NEAR(log->fixes[0].covariance(2, 2), 3.0, 1e-5);
  log = Read(Write("b.csv", std::string(kHeader) + ",hdop\n1,48,11,5,1.5\n"));
  ASSERT_TRUE(log.ok()) << log.status().message();
  EXPECT_NEAR(log->fixes[0].covariance(0, 0), 9.0, 1e-12);
}

TEST_F(ReadGnssTest, LeavesOutWhatIsNoFixAndCountsIt) {
  const auto log =
      Read(Write("a.csv", std::string(kHeader) + "\n1,0,0,0\n2,nan,nan,nan\n"
                                                 "3,48,11,5\n4,,11,5\n"));
  ASSERT_TRUE(log.ok()) << log.status().message();
  EXPECT_EQ(log->fixes.size(), 1u);
  EXPECT_EQ(log->num_left_out.at("no fix (0, 0)"), 1);
  EXPECT_EQ(log->num_left_out.at("not a number"), 2);
}

TEST_F(ReadGnssTest, ErrorsSayWhatIsWrong) {
  const std::string header = std::string(kHeader) + "\n";
  ExpectError(header + "1,0,0,0\n2,0,0,0\n", "2 with no fix (0, 0)");
  ExpectError(header + "1,139.7,35.7,5\n", "swapped");
  ExpectError(header + "1,5400000,690000,5\n", "not metres");
  ExpectError(header + "1,48,11,545400\n", "an altitude of 545400 m");
  ExpectError(header + "1,48,11,-1e300\n", "metres are expected");
  ExpectError(header + "1.5,48,11,5\n", "whole nanoseconds");
  ExpectError(header + "1,48,11\n", "3 columns where 4");
  ExpectError(header + "1,48,eleven,5\n", "'eleven', not a number");
  ExpectError(header + "2,48,11,5\n1,48,11,5\n", "line 3");
  ExpectError("#timestamp [ns],x [m],y [m],z [m]\n1,2,3,4\n",
              "does not name time, latitude");
}

TEST_F(ReadGnssTest, NmeaJoinsTheSentencesOfAnEpoch) {
  const auto log = Read(Write(
      "a.nmea",
      Nmea("GNGGA,235959.50,4807.0380,N,01131.0000,E,1,08,0.9,545.4,M,46.9,M,"
           ",") +
          Nmea("GNRMC,235959.50,A,4807.0380,N,01131.0000,E,022.4,084.4,280224,"
               "003.1,W") +
          Nmea("GNGST,235959.50,1.0,,,,0.7,0.6,1.5") +
          Nmea("GNGGA,000000.50,4807.0400,S,01131.0000,W,1,08,2.0,545.4,M,46.9,"
               "M,,") +
          Nmea("GNGGA,000001.50,,,,,0,00,,,M,,M,,") +
          "$GNGGA,000002.50,4807.0400,N,01131.0000,E,1,08,2,545,M,46.9,M,,*"
          "00\n"));
  ASSERT_TRUE(log.ok()) << log.status().message();
  ASSERT_EQ(log->fixes.size(), 2u);
  const GnssFix& fix = log->fixes[0];
  // 2024-02-28 23:59:59.5 UTC.
  EXPECT_EQ(fix.timestamp_ns, 1709164799500000000);
  EXPECT_NEAR(fix.position.latitude_deg, 48.0 + 7.038 / 60.0, 1e-9);
  EXPECT_NEAR(fix.position.longitude_deg, 11.0 + 31.0 / 60.0, 1e-9);
  EXPECT_NEAR(fix.position.height_m, 545.4 + 46.9, 1e-9);
  EXPECT_NEAR(fix.covariance(0, 0), 0.36, 1e-9);
  EXPECT_NEAR(fix.covariance(1, 1), 0.49, 1e-9);
  // Midnight passes in the leap year's February.
  EXPECT_EQ(log->fixes[1].timestamp_ns - fix.timestamp_ns, 1000000000);
  EXPECT_LT(log->fixes[1].position.latitude_deg, 0.0);
  EXPECT_LT(log->fixes[1].position.longitude_deg, 0.0);
  EXPECT_NEAR(log->fixes[1].covariance(0, 0), 16.0, 1e-9);
  EXPECT_EQ(log->num_left_out.at("no fix"), 1);
  EXPECT_EQ(log->num_left_out.at("wrong checksum"), 1);
}

TEST_F(ReadGnssTest, NmeaWithoutADateIsAnError) {
  const auto log = Read(Write(
      "a.nmea", Nmea("GPGGA,120000.00,4807.0,N,01131.0,E,1,08,1,5,M,46,M,,")));
  ASSERT_FALSE(log.ok());
  EXPECT_NE(log.status().message().find("no date"), std::string::npos);
}

TEST_F(ReadGnssTest, ReadsKittiOxts) {
  Write("timestamps.txt", "2011-09-26 13:02:25.5\n2011-09-26 13:02:25.6\n");
  for (int i = 0; i < 2; ++i) {
    std::string text = "49.01 8.43 116.5";
    for (int k = 3; k < 30; ++k) text += k == 23 ? " 0.05" : " 0";
    Write("data/000000000" + std::to_string(i) + ".txt", text);
  }
  const auto log = Read(folder_);
  ASSERT_TRUE(log.ok()) << log.status().message();
  ASSERT_EQ(log->fixes.size(), 2u);
  EXPECT_EQ(log->fixes[1].timestamp_ns, 1317042145600000000);
  EXPECT_EQ(log->fixes[1].position.latitude_deg, 49.01);
  EXPECT_NEAR(log->fixes[0].covariance(1, 1), 0.0025, 1e-12);
}

TEST_F(ReadGnssTest, ReadsNavSatFixOfABag) {
  const std::string path = folder_ + "/drive.mcap";
  constexpr timestamp_t kStartNs = 1'600'000'000'000'000'000;
  {
    BagWriter bag(path, {});
    for (const int i : {1, 0, 2}) {
      bag.Write("/fix", "sensor_msgs/msg/NavSatFix", kStartNs,
                NavSatFixMessage({kStartNs + 1000 * i, "gnss"}, 48.0 + i, 11.5,
                                 500.0, 0.25));
    }
  }
  const auto log = Read(path);
  ASSERT_TRUE(log.ok()) << log.status().message();
  ASSERT_EQ(log->fixes.size(), 3u);
  EXPECT_EQ(log->fixes[2].timestamp_ns, kStartNs + 2000);
  EXPECT_EQ(log->fixes[2].position.latitude_deg, 50.0);
  EXPECT_NEAR(log->fixes[2].covariance(0, 0), 0.25, 1e-5);
  EXPECT_FALSE(Read(path + ":/other").ok());
}

}  // namespace
}  // namespace adasfm
