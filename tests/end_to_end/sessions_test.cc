// SPDX-License-Identifier: BSD-3-Clause
// Two drives of one place, each with its own database and logs, in one model.

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "core/sqlite.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

constexpr int kNumImagesPerSession = 80;

// One robot close behind the other: a synthetic drive whose images belong to
// the sessions in turn, ids 1, 3, ... to s0 and 2, 4, ... to s1.
class SessionsTest : public CommandLineTest {
 protected:
  std::string SessionPath(int session) const {
    return folder_.File("session" + std::to_string(session) + ".db");
  }

  // Keeps the images of the session only, and imports them by themselves.
  void MakeSession(int session) {
    std::filesystem::copy_file(world_, SessionPath(session));
    const std::string is_other = " % 2 = " + std::to_string(session);
    {
      SqliteConnection database(SessionPath(session),
                                SqliteConnection::Mode::kWrite);
      for (const std::string table : {"images", "keypoints"}) {
        database.Execute("DELETE FROM " + table + " WHERE image_id" + is_other);
      }
      for (const std::string table : {"matches", "two_view_geometries"}) {
        database.Execute("DELETE FROM " + table + " WHERE " + kId1 + is_other +
                         " OR " + kId2 + is_other);
      }
    }
    ExpectSuccess(
        "adasfm_prior_importer --database_path " + SessionPath(session) +
        " --image_times_path " + folder_.File("times.csv") + " --imu_path " +
        folder_.File("imu.csv") + " --wheel_path " + folder_.File("wheel.csv") +
        " --sensors_path " + folder_.File("sensors.yaml"));
  }

  void Merge() {
    MakeSession(0);
    MakeSession(1);
    ExpectSuccess("adasfm_database_merger --input_paths " + SessionPath(0) +
                  "," + SessionPath(1) + " --prefixes s0/,s1/ --output_path " +
                  merged_);
  }

  // All pairs of the world between images of s0 and s1.
  void MatchBetweenSessions() {
    const std::string between = folder_.File("between.db");
    std::filesystem::copy_file(world_, between);
    {
      SqliteConnection database(between, SqliteConnection::Mode::kWrite);
      for (const std::string table : {"matches", "two_view_geometries"}) {
        database.Execute("DELETE FROM " + table + " WHERE " + kId1 +
                         " % 2 = " + kId2 + " % 2");
      }
      database.Execute(
          "UPDATE images SET name = 's' || ((image_id + 1) % 2) || '/' || "
          "name");
      // As in the merged database, each session has its own camera.
      database.Execute(
          "INSERT INTO cameras SELECT camera_id + 1, model, width, height, "
          "params, prior_focal_length FROM cameras");
      database.Execute(
          "UPDATE images SET camera_id = camera_id + 1 WHERE image_id % 2 = "
          "0");
    }
    ExpectSuccess("adasfm_database_merger --input_paths " + between +
                  " --output_path " + merged_);
  }

  void DriveADayLater() {
    SqliteConnection(merged_, SqliteConnection::Mode::kWrite)
        .Execute(
            "UPDATE adasfm_image_times SET timestamp_ns = timestamp_ns + "
            "86400000000000 WHERE name LIKE 's1/%'");
  }

  void WriteGroundTruth() {
    std::ifstream file(folder_.File("gt.txt"));
    std::ofstream renamed(folder_.File("merged_gt.txt"));
    std::string line;
    for (int i = 0; std::getline(file, line);) {
      if (line.empty() || line[0] == '#') continue;
      renamed << "s" << i++ % 2 << "/" << line << "\n";
    }
  }

  void RunGlobalStage() {
    ExpectSuccess("adasfm_global --database_path " + merged_ +
                  " --output_path " + folder_.File("global"));
  }

  void ExpectOneGoodModel(const std::string& models) {
    EXPECT_FALSE(std::filesystem::exists(folder_.File(models + "/1")));
    const std::string json = folder_.File("evaluation.json");
    ExpectSuccess("adasfm_evaluator --input_path " +
                  folder_.File(models + "/0") + " --ground_truth_path " +
                  folder_.File("merged_gt.txt") + " --json_path " + json);
    const auto evaluation = nlohmann::json::parse(ReadBytes(json));
    EXPECT_EQ(evaluation["num_images"], 2 * kNumImagesPerSession);
    // The bounds of one drive with as many images (chain_test.cc).
    EXPECT_LT(evaluation["sim3_least_squares"]["translation_rmse_m"], 0.15);
    EXPECT_NEAR(evaluation["sim3"]["scale"], 1.0, 0.03);
  }

  const std::string kId1 = "(pair_id / 2147483647)";
  const std::string kId2 = "(pair_id % 2147483647)";
  const std::string world_ = folder_.File("database.db");
  const std::string merged_ = folder_.File("all.db");
};

// 4 % of the pairs are aliased, also between the drives, which no odometry
// connects.
TEST_F(SessionsTest, LookAlikesDoNotFoldTheMapOfTwoDrives) {
  ExpectSuccess("adasfm_synthesizer --output_path " + folder_.Path() +
                " --seed 2 --alias_ratio 0.04 --num_images " +
                std::to_string(2 * kNumImagesPerSession));
  Merge();
  MatchBetweenSessions();
  WriteGroundTruth();
  RunGlobalStage();
  ExpectSuccess("adasfm_mapper --database_path " + merged_ + " --input_path " +
                folder_.File("global") + " --output_path " +
                folder_.File("sparse"));
  ExpectOneGoodModel("sparse");
  DriveADayLater();
  RunGlobalStage();
  ExpectOneGoodModel("global");
}

}  // namespace
}  // namespace adasfm
