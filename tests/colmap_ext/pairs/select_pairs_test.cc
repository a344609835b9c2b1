// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/pairs/select_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <set>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/database.h"
#include "core/random.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/colmap_ext/landmark_descriptors.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"

namespace adasfm {
namespace {

class SelectPairsTest : public CommandLineTest {
 protected:
  // A database of the world with descriptors.
  void MakeDatabase(const SyntheticWorldOptions& options) {
    world_ = BuildSyntheticWorld(options);
    ASSERT_TRUE(WriteSyntheticDatabase(world_, database_).ok());
    WriteLandmarkDescriptors(world_, options.seed, database_);
  }

  PairSelection Select(const PairSelectionOptions& options) {
    const StatusOr<PairSelection> selection = SelectPairs(options, database_);
    EXPECT_TRUE(selection.ok()) << selection.status().message();
    return selection.ok() ? *selection : PairSelection();
  }

  SyntheticWorld world_;
  std::string database_ = folder_.File("database.db");
};

SyntheticWorldOptions SmallWorld(int num_images) {
  SyntheticWorldOptions options;
  options.num_images = num_images;
  options.num_keypoints_per_image = 100;
  return options;
}

// The share of true pairs, more than `min_gap` images apart, that are selected.
double RecallOfTruePairs(const SyntheticWorld& world,
                         const std::vector<ImagePair>& selected, int min_gap,
                         int* num_true) {
  const std::set<ImagePair> chosen(selected.begin(), selected.end());
  *num_true = 0;
  int num_found = 0;
  for (const SyntheticPair& pair : world.pairs) {
    const int gap = pair.image_id2 - pair.image_id1;
    if (pair.is_alias || gap <= min_gap || pair.inlier_matches.size() < 30) {
      continue;
    }
    ++*num_true;
    num_found += chosen.count(ImagePair(pair.image_id1, pair.image_id2));
  }
  return static_cast<double>(num_found) / std::max(1, *num_true);
}

TEST_F(SelectPairsTest, FindsTruePairsOfRevisits) {
  int num_true_of_all = 0;
  for (const uint64_t seed : {1, 2, 5}) {
    // Far enough to come back to places seen before.
    SyntheticWorldOptions options = SmallWorld(180);
    options.spacing_m = 4.0;
    options.seed = seed;
    MakeDatabase(options);
    const PairSelection selection = Select(PairSelectionOptions());
    int num_true = 0;
    const double recall =
        RecallOfTruePairs(world_, selection.pairs, 10, &num_true);
    num_true_of_all += num_true;
    // Without true pairs there is no recall.
    if (num_true > 0) {
      EXPECT_GT(recall, 0.95) << "seed " << seed;
    }
    EXPECT_LT(selection.pairs.size(), 180 * (10 + 30));
  }
  EXPECT_GT(num_true_of_all, 100);
}

// Matching a pair costs time, and omitting a true one costs accuracy.
TEST_F(SelectPairsTest, OdometryKeepsTruePairsAndSavesOthers) {
  for (const uint64_t seed : {1, 2, 5}) {
    SyntheticWorldOptions options = SmallWorld(180);
    options.spacing_m = 4.0;
    options.seed = seed;
    MakeDatabase(options);
    PairSelectionOptions pair_options;
    const PairSelection without = Select(pair_options);
    EXPECT_EQ(without.num_predicted, 0);
    PriorTables tables;
    tables.priors = BuildSyntheticScene(world_, {}).priors;
    for (const SyntheticImage& image : world_.images) {
      tables.image_times.push_back({image.image_id, image.timestamp_ns});
    }
    ASSERT_TRUE(WritePriorTables(database_, tables).ok());
    const PairSelection with = Select(pair_options);
    EXPECT_GT(with.num_predicted, 0);
    int num_true = 0;
    const double recall_without =
        RecallOfTruePairs(world_, without.pairs, 10, &num_true);
    const double recall_with =
        RecallOfTruePairs(world_, with.pairs, 10, &num_true);
    std::cout << "seed " << seed << ": " << without.pairs.size()
              << " pairs, recall " << recall_without << "; with odometry "
              << with.pairs.size() << " pairs (" << with.num_predicted
              << " predicted, " << with.num_similar << " similar), recall "
              << recall_with << " of " << num_true << std::endl;
    EXPECT_GE(recall_with, recall_without - 0.01);
    EXPECT_LT(with.pairs.size(), 0.8 * without.pairs.size());
    if (seed != 1) continue;
    pair_options.num_threads = 3;
    EXPECT_EQ(Select(pair_options).pairs, with.pairs);
    pair_options.odometry.enabled = false;
    EXPECT_EQ(Select(pair_options).pairs, without.pairs);
  }
}

TEST_F(SelectPairsTest, NeighborsAndSimilarImagesCount) {
  MakeDatabase(SmallWorld(40));
  PairSelectionOptions options;
  options.num_similar_images = 0;
  options.num_temporal_neighbors = 3;
  PairSelection selection = Select(options);
  EXPECT_EQ(selection.pairs.size(), 39 + 38 + 37);
  EXPECT_EQ(selection.num_temporal, 39 + 38 + 37);
  EXPECT_FALSE(selection.ordered_by_time);
  options.num_temporal_neighbors = 0;
  options.num_similar_images = 5;
  selection = Select(options);
  std::map<image_t, int> counts;
  for (const ImagePair& pair : selection.pairs) {
    EXPECT_LT(pair.image_id1, pair.image_id2);
    ++counts[pair.image_id1];
    ++counts[pair.image_id2];
  }
  for (const auto& [image_id, count] : counts) EXPECT_GE(count, 5);
  EXPECT_EQ(counts.size(), 40);
}

TEST_F(SelectPairsTest, ThreadsDoNotMatter) {
  MakeDatabase(SmallWorld(60));
  PairSelectionOptions options;
  options.num_temporal_neighbors = 0;
  options.num_similar_images = 4;
  options.num_threads = 1;
  const std::vector<ImagePair> pairs = Select(options).pairs;
  options.num_threads = 3;
  EXPECT_EQ(Select(options).pairs, pairs);
}

TEST_F(SelectPairsTest, OrderIsThatOfTimesElseOfNames) {
  MakeDatabase(SmallWorld(12));
  bool by_time = true;
  StatusOr<std::vector<image_t>> order = OrderImages(database_, "", &by_time);
  ASSERT_TRUE(order.ok());
  EXPECT_FALSE(by_time);
  // Names are times here, ids are in their order.
  EXPECT_TRUE(std::is_sorted(order->begin(), order->end()));
  // Times against the order of the names, from a file.
  std::string times = "#timestamp [ns],filename\n";
  for (int i = 11; i >= 0; --i) {
    times += std::to_string(1000 - i) + "," + world_.images[i].name + "\n";
  }
  order = OrderImages(database_, folder_.Write("times.csv", times), &by_time);
  ASSERT_TRUE(order.ok()) << order.status().message();
  EXPECT_TRUE(by_time);
  EXPECT_TRUE(std::is_sorted(order->rbegin(), order->rend()));
  // And from the importer's table.
  PriorTables tables;
  for (int i = 0; i < 12; ++i) {
    tables.image_times.push_back({world_.images[i].image_id, 1000 - i});
  }
  ASSERT_TRUE(WritePriorTables(database_, tables).ok());
  order = OrderImages(database_, "", &by_time);
  EXPECT_TRUE(by_time);
  EXPECT_TRUE(std::is_sorted(order->rbegin(), order->rend()));
}

// Two cameras whose files have the same names.
TEST_F(SelectPairsTest, TimesGoByWholeNames) {
  MakeDatabase(SmallWorld(12));
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    database.Execute(
        "UPDATE images SET name = CASE WHEN image_id > 6 THEN 'right/' || "
        "(image_id - 6) ELSE 'left/' || image_id END || '.png'");
  }
  std::string times = "#timestamp [ns],filename\n";
  for (const char* folder : {"left/", "right/"}) {
    for (int i = 1; i <= 6; ++i) {
      times += std::to_string(1000 + i + (*folder == 'r' ? 30 : 0)) + "," +
               folder + std::to_string(i) + ".png\n";
    }
  }
  bool by_time = false;
  std::vector<std::string> warnings;
  StatusOr<std::vector<image_t>> order = OrderImages(
      database_, folder_.Write("times.csv", times), &by_time, &warnings);
  ASSERT_TRUE(order.ok()) << order.status().message();
  EXPECT_TRUE(by_time);
  EXPECT_TRUE(warnings.empty());
  EXPECT_TRUE(std::is_sorted(order->begin(), order->end()));
  // Times of some images only, and of none.
  order = OrderImages(database_, folder_.Write("few.csv", times.substr(0, 50)),
                      &by_time, &warnings);
  ASSERT_TRUE(order.ok()) << order.status().message();
  ASSERT_EQ(warnings.size(), 1);
  EXPECT_NE(warnings[0].find("of the 12 images"), std::string::npos);
  EXPECT_FALSE(OrderImages(database_,
                           folder_.Write("other.csv",
                                         "#timestamp [ns],filename\n"
                                         "1000,other.png\n"),
                           &by_time)
                   .ok());
}

// All images are equally similar.
TEST_F(SelectPairsTest, EqualDescriptorsLeaveTheNeighbours) {
  MakeDatabase(SmallWorld(12));
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    database.Execute("UPDATE descriptors SET data = zeroblob(rows * cols)");
  }
  const StatusOr<PairSelection> selection = SelectPairs({}, database_);
  ASSERT_TRUE(selection.ok()) << selection.status().message();
  EXPECT_EQ(selection->num_similar, 0);
  EXPECT_GT(selection->num_temporal, 0);
  ASSERT_FALSE(selection->warnings.empty());
  EXPECT_NE(selection->warnings[0].find("are the same"), std::string::npos);
}

TEST_F(SelectPairsTest, DescriptorsOfHugeCountAreRefused) {
  MakeDatabase(SmallWorld(12));
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    database.Execute(
        "UPDATE descriptors SET rows = 1 << 58, data = x'' WHERE image_id = 3");
  }
  const StatusOr<PairSelection> selection = SelectPairs({}, database_);
  ASSERT_FALSE(selection.ok());
  EXPECT_NE(selection.status().message().find("malformed descriptors"),
            std::string::npos);
}

TEST_F(SelectPairsTest, DigitsAreNumbers) {
  MakeDatabase(SmallWorld(12));
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    database.Execute(
        "UPDATE images SET name = 'photo' || (13 - image_id) || '.jpg'");
  }
  bool by_time = true;
  const StatusOr<std::vector<image_t>> order =
      OrderImages(database_, "", &by_time);
  ASSERT_TRUE(order.ok());
  EXPECT_TRUE(std::is_sorted(order->rbegin(), order->rend()));
}

TEST_F(SelectPairsTest, TakesDescriptorsFromElsewhere) {
  MakeDatabase(SmallWorld(20));
  // Places on a circle in the order of the images: neighbours are near.
  std::string text = "# made by a network\n";
  for (int i = 0; i < 20; ++i) {
    text += world_.images[i].name + " " + std::to_string(std::cos(0.2 * i)) +
            " " + std::to_string(std::sin(0.2 * i)) + "\n";
  }
  const std::string vectors = folder_.Write("netvlad.txt", text);
  const std::string pairs = folder_.File("pairs.txt");
  const Run run = Call("adasfm_pair_generator --database_path " + database_ +
                       " --output_path " + pairs +
                       " --AdaSfmPairs.num_temporal_neighbors 0"
                       " --AdaSfmPairs.num_similar_images 2"
                       " --AdaSfmPairs.descriptors_path " +
                       vectors);
  ASSERT_EQ(run.ExitCode(), 0) << run.err;
  const std::string list = ReadBytes(pairs);
  EXPECT_EQ(std::count(list.begin(), list.end(), '\n'), 21) << list;
  EXPECT_NE(list.find(world_.images[4].name + " " + world_.images[5].name),
            std::string::npos);

  const std::string options = "adasfm_pair_generator --database_path " +
                              database_ + " --output_path " + pairs +
                              " --AdaSfmPairs.descriptors_path ";
  ExpectError(options + folder_.File("missing.txt"), "missing.txt");
  ExpectError(options + folder_.Write("a.txt", text + "x.png 1\n"),
              "line 22: has 1 numbers, the lines before it 2");
  ExpectError(options + folder_.Write("b.txt", "x.png 1 nan\n"), "'nan'");
  ExpectError(options + folder_.Write("c.txt", "x.png 1 2\nx.png 1 2\n"),
              "already");
  ExpectError(options + folder_.Write("d.txt", "other.png 1 2\n"),
              "none of its 1 images");
  ExpectError(options + folder_.Write("e.txt", "x.png 0 0\n"), "is zero");
}

// COLMAP 4 has floats in the table of bytes, and their kind in a column.
TEST_F(SelectPairsTest, LearnedDescriptorsOfTheDatabaseAreFloats) {
  MakeDatabase(SmallWorld(30));
  const PairSelection of_bytes = Select(PairSelectionOptions());
  EXPECT_GT(of_bytes.num_similar, 0);
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    database.Execute(
        "ALTER TABLE descriptors ADD COLUMN type INTEGER NOT NULL DEFAULT 0;");
    std::map<int64_t, std::vector<float>> floats;
    {
      SqliteStatement read(&database, "SELECT image_id, data FROM descriptors");
      while (read.Step()) {
        const auto* bytes = static_cast<const uint8_t*>(read.Blob(1));
        for (size_t i = 0; i < read.NumBytes(1); ++i) {
          floats[read.Int(0)].push_back(bytes[i] / 512.0f);
        }
      }
    }
    SqliteStatement write(&database,
                          "UPDATE descriptors SET type = 1, cols = 4 * cols, "
                          "data = ? WHERE image_id = ?");
    for (const auto& [image_id, values] : floats) {
      write.Reset();
      write.BindBlob(1, values.data(), values.size() * sizeof(float));
      write.BindInt(2, image_id);
      write.Step();
    }
  }
  const PairSelection of_floats = Select(PairSelectionOptions());
  EXPECT_EQ(of_floats.pairs, of_bytes.pairs);

  const auto expect_error = [this](const std::string& change,
                                   const std::string& message) {
    SqliteConnection(database_, SqliteConnection::Mode::kWrite).Execute(change);
    const auto selection = SelectPairs(PairSelectionOptions(), database_);
    ASSERT_FALSE(selection.ok());
    EXPECT_NE(selection.status().message().find(message), std::string::npos)
        << selection.status().message();
  };
  expect_error("UPDATE descriptors SET type = 2 WHERE image_id > 10",
               "another type");
  expect_error("UPDATE descriptors SET type = 7",
               "--AdaSfmPairs.descriptors_path");
}

TEST_F(SelectPairsTest, WrongInputIsOneLine) {
  MakeDatabase(SmallWorld(6));
  const std::string call = "adasfm_pair_generator --output_path " +
                           folder_.File("pairs.txt") + " --database_path ";
  ExpectError(call + folder_.File("missing.db"), "missing.db");
  ExpectError(call + database_ + " --AdaSfmPairs.min_overlap 0", "min_overlap");
  ExpectError(call + database_ + " --AdaSfmPairs.num_similar_images -1",
              "num_similar_images");
  ExpectError(call + database_ +
                  " --AdaSfmPairs.num_similar_images 0"
                  " --AdaSfmPairs.num_temporal_neighbors 0",
              "one of them must be positive");
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    database.Execute("DELETE FROM descriptors");
  }
  ExpectError(call + database_, "feature_extractor");
  // Names are looked at before descriptors.
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    database.Execute("UPDATE images SET name = 'a b.png' WHERE image_id = 1");
  }
  ExpectError(call + database_, "'a b.png' has a space");
}

}  // namespace
}  // namespace adasfm
