// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/database.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 6;

class DatabaseMergerTest : public CommandLineTest {
 protected:
  DatabaseMergerTest() {
    SyntheticWorldOptions options;
    options.num_images = kNumImages;
    options.num_keypoints_per_image = 30;
    EXPECT_TRUE(
        WriteSyntheticDatabase(BuildSyntheticWorld(options), database_).ok());
  }

  size_t NumImages() {
    SqliteConnection database(output_, SqliteConnection::Mode::kRead);
    return ReadImages(&database).size();
  }

  const std::string database_ = folder_.File("drive.db");
  const std::string output_ = folder_.File("both.db");
  const std::string command_ =
      "adasfm_database_merger --output_path " + output_ + " ";
};

TEST_F(DatabaseMergerTest, TakesPathsOrAList) {
  const Run run = Call(command_ + "--prefixes a/,b/ --input_paths " +
                       database_ + "," + database_);
  EXPECT_EQ(run.ExitCode(), 0) << run.err;
  EXPECT_NE(run.out.find("2 databases joined"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find(std::to_string(2 * kNumImages) + " images"),
            std::string::npos)
      << run.out;
  EXPECT_EQ(NumImages(), 2 * kNumImages);
  // The last prefix may be empty: a third session joins the two.
  const std::string list = folder_.Write("list.txt", database_ + "\n\n");
  EXPECT_EQ(Call(command_ + "--input_list_path " + list).ExitCode(), 0);
  EXPECT_EQ(NumImages(), 3 * kNumImages);
}

TEST_F(DatabaseMergerTest, BadInputIsAnErrorOfOneLine) {
  ExpectError(command_, "either --input_paths or --input_list_path");
  ExpectError(command_ + "--input_list_path x --input_paths " + database_,
              "either --input_paths or --input_list_path");
  ExpectError(command_ + "--input_list_path " + folder_.File("none"),
              "check --input_list_path");
  ExpectError(command_ + "--input_paths " + folder_.File("none.db"),
              "none.db does not exist");
  ExpectError(
      command_ + "--prefixes a/ --input_paths " + database_ + "," + database_,
      "1 entries for 2 databases");
  ExpectError("adasfm_database_merger --input_paths " + database_ +
                  " --output_path " + folder_.File("none/out.db"),
              "none");
}

}  // namespace
}  // namespace adasfm
