// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/features/extract_sift.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "colmap_ext/host/features.h"
#include "core/interruption.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

using testing::HasSubstr;

void NoProgress(const std::string&, double) {}

class ExtractSift : public testing::Test {
 protected:
  // Photos of noise, registered in the database.
  void SetUp() override {
    cv::RNG random(1);
    for (int i = 0; i < kNumImages; ++i) {
      names_.push_back("photo" + std::to_string(i) + ".png");
      cv::Mat image(120, 160, CV_8UC1);
      random.fill(image, cv::RNG::UNIFORM, 0, 255);
      cv::imwrite(folder_.File(names_.back()), image);
    }
    ASSERT_TRUE(RegisterImages(FeatureOptions(), folder_.Path(), names_,
                               database_path_, NoProgress)
                    .ok());
  }

  Status Extract(int num_threads,
                 const ProgressCallback& progress = NoProgress) {
    return ExtractSiftOfDatabase(SiftFeatureOptions(), num_threads,
                                 folder_.Path(), database_path_, progress);
  }

  // All that was written.
  std::string Features() {
    SqliteConnection database(database_path_, SqliteConnection::Mode::kRead);
    SqliteStatement statement(
        &database,
        "SELECT image_id, keypoints.rows || ' ' || keypoints.cols || ' ' || "
        "descriptors.rows || ' ' || descriptors.cols || "
        "hex(keypoints.data) || hex(descriptors.data) FROM keypoints JOIN "
        "descriptors USING (image_id) ORDER BY image_id");
    std::string features;
    while (statement.Step()) features += statement.Text(1) + "\n";
    return features;
  }

  static constexpr int kNumImages = 11;
  const TemporaryFolder folder_;
  const std::string database_path_ = folder_.File("database.db");
  std::vector<std::string> names_;
};

TEST_F(ExtractSift, ThreadsAndInterruptionsChangeNothing) {
  const auto interrupt = [](const std::string&, double) {
    throw Interruption();
  };
  EXPECT_THROW((void)Extract(1, interrupt), Interruption);
  EXPECT_THAT(CheckFeatures(database_path_).message(),
              HasSubstr("7 of 11 images are missing"));
  ASSERT_TRUE(Extract(1).ok());
  EXPECT_TRUE(CheckFeatures(database_path_).ok());
  const std::string features = Features();
  SqliteConnection(database_path_, SqliteConnection::Mode::kWrite)
      .Execute("DELETE FROM keypoints");
  ASSERT_TRUE(Extract(2).ok());
  EXPECT_EQ(Features(), features);
}

TEST_F(ExtractSift, APhotoThatCannotBeReadIsNamed) {
  std::ofstream(folder_.File(names_[3])) << "no picture";
  EXPECT_THAT(Extract(1).message(), HasSubstr(names_[3]));
}

}  // namespace
}  // namespace adasfm
