// SPDX-License-Identifier: BSD-3-Clause
// A drive that goes on after it was mapped: adasfm_mapper --existing_path.
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "colmap_ext/host/model.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 160;
constexpr int kNumMappedBefore = 100;

class ExistingModelTest : public CommandLineTest {
 protected:
  void SetUp() override {
    ExpectSuccess("adasfm_synthesizer --output_path " + folder_.Path() +
                  " --seed 2 --alias_ratio 0.04 --num_images " +
                  std::to_string(kNumImages));
    std::filesystem::copy_file(folder_.File("database.db"),
                               folder_.File("before.db"));
    const std::string last = std::to_string(kNumMappedBefore);
    SqliteConnection database(folder_.File("before.db"),
                              SqliteConnection::Mode::kWrite);
    for (const std::string table : {"images", "keypoints"}) {
      database.Execute("DELETE FROM " + table + " WHERE image_id > " + last);
    }
    for (const std::string table : {"matches", "two_view_geometries"}) {
      database.Execute("DELETE FROM " + table +
                       " WHERE pair_id / 2147483647 > " + last +
                       " OR pair_id % 2147483647 > " + last);
    }
  }

  void ImportAndRunGlobalStage(const std::string& name) {
    ExpectSuccess(
        "adasfm_prior_importer --database_path " + folder_.File(name + ".db") +
        " --image_times_path " + folder_.File("times.csv") + " --imu_path " +
        folder_.File("imu.csv") + " --wheel_path " + folder_.File("wheel.csv") +
        " --sensors_path " + folder_.File("sensors.yaml"));
    ExpectSuccess("adasfm_global --database_path " +
                  folder_.File(name + ".db") + " --output_path " +
                  folder_.File(name + "_global"));
  }

  std::string MapperCall(const std::string& name) const {
    return "adasfm_mapper --database_path " + folder_.File(name + ".db") +
           " --input_path " + folder_.File(name + "_global") +
           " --output_path " + folder_.File(name + "_sparse");
  }

  double Error(const std::string& model) {
    const std::string json = folder_.File("evaluation.json");
    ExpectSuccess("adasfm_evaluator --input_path " + model +
                  " --ground_truth_path " + folder_.File("gt.txt") +
                  " --json_path " + json);
    return nlohmann::json::parse(
        ReadBytes(json))["sim3_least_squares"]["translation_rmse_m"];
  }
};

TEST_F(ExistingModelTest, KeepsItsPosesAndTakesTheOtherImages) {
  ImportAndRunGlobalStage("before");
  ExpectSuccess(MapperCall("before"));
  ImportAndRunGlobalStage("database");
  const std::string existing = folder_.File("before_sparse/0");
  ExpectSuccess(MapperCall("database") + " --existing_path " + existing);
  const auto before = ReadModel(existing);
  const auto after = ReadModel(folder_.File("database_sparse/0"));
  ASSERT_TRUE(before.ok() && after.ok());
  EXPECT_EQ(before->NumRegImages(), kNumMappedBefore);
  EXPECT_EQ(after->NumRegImages(), kNumImages);
  const std::map<image_t, Rigid3d> poses = CamsFromWorld(*after);
  for (const auto& [image_id, pose] : CamsFromWorld(*before)) {
    const Rigid3d& found = poses.at(image_id);
    EXPECT_LT((found.translation - pose.translation).norm(), 1e-12);
    EXPECT_LT((found.rotation.coeffs() - pose.rotation.coeffs()).norm(), 1e-12);
  }
  // The bound of one drive with as many images (chain_test.cc).
  EXPECT_LT(Error(folder_.File("database_sparse/0")), 0.15);

  ExpectError(
      MapperCall("database") + " --existing_path " + folder_.File("nowhere"),
      "no model in " + folder_.File("nowhere"));
  ExpectError(MapperCall("database") + " --existing_path " +
                  folder_.File("database_sparse/0"),
              "would be replaced");
  SqliteConnection(folder_.File("database.db"), SqliteConnection::Mode::kWrite)
      .Execute("UPDATE images SET name = 'new_' || name");
  ExpectSuccess("adasfm_global --database_path " + folder_.File("database.db") +
                " --output_path " + folder_.File("database_global"));
  ExpectError(MapperCall("database") + " --existing_path " + existing,
              "recognised by their names");
}

}  // namespace
}  // namespace adasfm
