// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/stage_memory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "colmap_ext/adasfm_pipeline.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

using testing::HasSubstr;

constexpr double kTooLittleGb = 0.01;
constexpr double kEnoughGb = 2.0;

class StageMemoryTest : public testing::Test {
 protected:
  StageMemoryTest() {
    SyntheticWorldOptions options;
    options.num_images = 16;
    options.num_keypoints_per_image = 100;
    const Status status =
        WriteSyntheticDatabase(BuildSyntheticWorld(options), database_);
    EXPECT_TRUE(status.ok()) << status.message();
  }

  const TemporaryFolder folder_;
  const std::string database_ = folder_.File("world.db");
};

TEST_F(StageMemoryTest, MeasuresTheDatabase) {
  const StatusOr<SceneSize> size = MeasureScene(database_);
  ASSERT_TRUE(size.ok());
  EXPECT_EQ(size->num_images, 16);
  EXPECT_GT(size->num_keypoints, 16 * 50);
  EXPECT_LE(size->num_keypoints, 16 * 100);
  EXPECT_GT(size->num_matches, 16 * 15);
}

TEST_F(StageMemoryTest, LogsCountByTheirSize) {
  PriorImportPaths paths;
  const double none = EstimateImportMemoryBytes(paths);
  paths.imu_path = folder_.Write("imu.csv", std::string(1000000, '0'));
  const double some = EstimateImportMemoryBytes(paths);
  EXPECT_GT(some, none + 5e6);
  EXPECT_LT(some, none + 20e6);
}

// Measured peaks (docs/results/growth.md): no peak exceeds its estimate, and no
// estimate exceeds twice the peak.
TEST(EstimateMemoryTest, CoversWhatWasMeasured) {
  // The larger figures of the C library's allocator and tcmalloc.
  struct Peak {
    SceneSize size;
    double global_bytes, mapper_bytes;
  };
  for (const Peak& peak :
       {Peak{{300, 101050, 218941}, 130e6, 108e6},         // world-clean-300
        Peak{{400, 124250, 281891}, 131e6, 118e6},         // world-hard-400
        Peak{{160, 460401, 1580071}, 205e6, 203e6},        // kitti07-160
        Peak{{1000, 285426, 1485449}, 214e6, 256e6},       // clean-1000
        Peak{{10000, 2881995, 17562966}, 1743e6, 1816e6},  // clean-10000
        // clean-30000 with a budget of 6 GB.
        Peak{{30000, 8642345, 57342318}, 5155e6, 5691e6}}) {
    const double bytes = EstimateStageMemoryBytes(peak.size);
    for (const double measured : {peak.global_bytes, peak.mapper_bytes}) {
      EXPECT_GT(bytes, measured) << peak.size.num_images;
      EXPECT_LT(bytes, 2.0 * measured) << peak.size.num_images;
    }
  }
}

TEST_F(StageMemoryTest, NoStageBeginsWhatTakesMoreThanItsBudget) {
  PriorImportOptions priors;
  priors.max_memory_gb = kTooLittleGb;
  PriorImportPaths paths;
  paths.database_path = database_;
  const auto import = ImportPriors(priors, paths, folder_.File("priors.json"));
  ASSERT_FALSE(import.ok());
  EXPECT_THAT(import.status().message(),
              HasSubstr("--AdaSfmPriors.max_memory_gb"));
  EXPECT_FALSE(std::filesystem::exists(folder_.File("priors.json")));

  const std::string coarse_path = folder_.File("global");
  GlobalStageOptions global;
  global.max_memory_gb = kTooLittleGb;
  const auto refused = EstimateCoarseModel(global, database_, coarse_path);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.status().message(),
              HasSubstr("--AdaSfmGlobal.max_memory_gb"));
  EXPECT_FALSE(std::filesystem::exists(coarse_path + "/0"));
  global.max_memory_gb = kEnoughGb;
  const auto coarse = EstimateCoarseModel(global, database_, coarse_path);
  ASSERT_TRUE(coarse.ok()) << coarse.status().message();

  const MapRequest request = {database_, coarse_path + "/0",
                              folder_.File("sparse")};
  MapOptions map;
  map.stage.max_memory_gb = kTooLittleGb;
  const auto not_mapped = MapParts(map, request);
  ASSERT_FALSE(not_mapped.ok());
  EXPECT_THAT(not_mapped.status().message(),
              HasSubstr("--AdaSfmMapper.max_memory_gb"));
  map.stage.max_memory_gb = kEnoughGb;
  const auto mapped = MapParts(map, request);
  EXPECT_TRUE(mapped.ok()) << mapped.status().message();
}

TEST(CheckMemoryTest, WarnsWithoutABudget) {
  std::vector<std::string> warnings;
  EXPECT_TRUE(CheckMemory(1e6, -1.0, "max_memory_gb", &warnings).ok());
  EXPECT_TRUE(warnings.empty());
  EXPECT_TRUE(CheckMemory(1e18, -1.0, "max_memory_gb", &warnings).ok());
  EXPECT_EQ(warnings.size(), 1);
}

}  // namespace
}  // namespace adasfm
