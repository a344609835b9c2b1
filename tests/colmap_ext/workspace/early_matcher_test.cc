// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/workspace/early_matcher.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/workspace/early_database.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/landmark_descriptors.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

constexpr int kNumNeighbors = 4;
constexpr size_t kMinNumPairs = 10;

class EarlyMatcherTest : public testing::Test {
 protected:
  EarlyMatcherTest() {
    SyntheticWorldOptions options;
    options.num_images = 20;
    options.num_keypoints_per_image = 200;
    world_ = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world_, all_).ok());
    WriteLandmarkDescriptors(world_, 1, all_);
    Execute(all_, "DELETE FROM matches");
    Execute(all_, "DELETE FROM two_view_geometries");
    std::filesystem::copy(all_, database_);
    for (const char* table : {"keypoints", "descriptors"}) {
      Execute(database_, std::string("DELETE FROM ") + table);
    }
    pairs_.num_temporal_neighbors = kNumNeighbors;
    pairs_.num_similar_images = 0;
    for (int i = 1; i <= options.num_images; ++i) {
      for (int k = i + 1; k <= options.num_images && k <= i + kNumNeighbors;
           ++k) {
        neighbors_.emplace_back(i, k);
      }
    }
  }

  static void Execute(const std::string& path, const std::string& sql) {
    SqliteConnection(path, SqliteConnection::Mode::kWrite).Execute(sql);
  }

  // As an extraction: one transaction per image, on a connection that does not
  // wait for locks.
  static void Extract(int begin, int end, const std::string& from,
                      SqliteConnection* database) {
    database->Execute("PRAGMA busy_timeout = 0");
    SqliteStatement attach(database, "ATTACH ? AS source");
    attach.BindText(1, from);
    attach.Step();
    for (int i = begin; i < end; ++i) {
      database->Execute("BEGIN IMMEDIATE");
      for (const char* table : {"keypoints", "descriptors"}) {
        database->Execute(std::string("INSERT INTO main.") + table +
                          " SELECT * FROM source." + table +
                          " WHERE image_id = " + std::to_string(i));
      }
      database->Execute("COMMIT");
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }

  EarlyMatchingRequest Request() const {
    EarlyMatchingRequest request;
    request.features.num_threads = 2;
    request.pairs = pairs_;
    request.database_path = database_;
    request.early_path = early_;
    request.inputs = "these";
    request.log_path = folder_.File("matching.log");
    request.min_num_pairs = kMinNumPairs;
    return request;
  }

  static int64_t Count(const std::string& path, const std::string& from) {
    SqliteConnection database(path, SqliteConnection::Mode::kWrite);
    SqliteStatement statement(&database, "SELECT count(*) FROM " + from);
    return statement.Step() ? statement.Int(0) : -1;
  }

  void WaitForEarlyMatches(int64_t count) {
    constexpr std::chrono::seconds kLimit(60);
    const auto start = std::chrono::steady_clock::now();
    while (std::chrono::steady_clock::now() < start + kLimit) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      try {
        if (Count(early_, "two_view_geometries") >= count) return;
      } catch (const SqliteError&) {
        // Not there yet.
      }
    }
    ADD_FAILURE() << "no " << count << " early matches";
  }

  void MatchAll(const std::string& path) const {
    const Status status = MatchPairs(Request().features, neighbors_, path,
                                     folder_.File("matching.log"),
                                     [](const std::string&, double) {});
    EXPECT_TRUE(status.ok()) << status.message();
    EXPECT_TRUE(CheckMatches(path, neighbors_).ok());
  }

  static std::vector<std::string> Rows(const std::string& path) {
    SqliteConnection database(path, SqliteConnection::Mode::kRead);
    std::vector<std::string> rows;
    for (const char* query :
         {"SELECT image_id, rows, hex(data) FROM keypoints ORDER BY image_id",
          "SELECT pair_id, rows, hex(data) FROM matches ORDER BY pair_id",
          "SELECT pair_id, rows, hex(data) || config || hex(F) || hex(E) || "
          "hex(H) FROM two_view_geometries ORDER BY pair_id"}) {
      SqliteStatement statement(&database, query);
      while (statement.Step()) {
        rows.push_back(statement.Text(0) + " " + statement.Text(1) + " " +
                       statement.Text(2));
      }
    }
    return rows;
  }

  TemporaryFolder folder_;
  SyntheticWorld world_;
  PairSelectionOptions pairs_;
  std::vector<ImagePair> neighbors_;
  // A database with all features, and one that gets them during a test.
  std::string all_ = folder_.File("all.db");
  std::string database_ = folder_.File("database.db");
  std::string early_ = EarlyDatabasePath(folder_.Path());
};

TEST_F(EarlyMatcherTest, TheResultIsTheSameAsWithout) {
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    database.Execute("PRAGMA journal_mode = WAL");
    EarlyMatcher matcher(Request());
    Extract(1, 9, all_, &database);
    matcher.Start();
    WaitForEarlyMatches(kMinNumPairs);
    database.Execute("DETACH source");
    // The matcher reads and matches while these are written.
    Extract(9, 17, all_, &database);
    WaitForEarlyMatches(2 * kMinNumPairs);
    database.Execute("DETACH source");
    Extract(17, 21, all_, &database);
    matcher.Finish();
  }
  // Matches are moved, and existing rows stay.
  const StatusOr<int> moved = TakeEarlyMatches(early_, "these", database_);
  ASSERT_TRUE(moved.ok()) << moved.status().message();
  const int num_early = *moved;
  EXPECT_GE(num_early, 2 * static_cast<int>(kMinNumPairs));
  EXPECT_EQ(Count(database_, "matches"), num_early);
  EXPECT_FALSE(std::filesystem::exists(early_));
  EXPECT_FALSE(std::filesystem::exists(early_ + "-wal"));
  MatchAll(database_);
  MatchAll(all_);
  EXPECT_TRUE(Rows(database_) == Rows(all_));
}

// As after a kill: only matches made for the same inputs are taken.
TEST_F(EarlyMatcherTest, OtherInputsAreOutdated) {
  SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
  database.Execute("PRAGMA journal_mode = WAL");
  Extract(1, 21, all_, &database);
  const auto match = [&](const std::string& inputs) {
    EarlyMatchingRequest request = Request();
    request.inputs = inputs;
    EarlyMatcher matcher(std::move(request));
    matcher.Start();
    WaitForEarlyMatches(neighbors_.size());
  };
  match("these");
  // One pair is half written.
  Execute(early_,
          "DELETE FROM matches WHERE pair_id = (SELECT MIN(pair_id) FROM "
          "matches)");
  std::filesystem::copy(early_, folder_.File("copy.db"));
  EXPECT_EQ(*TakeEarlyMatches(early_, "others", database_), 0);
  EXPECT_FALSE(std::filesystem::exists(early_));
  EXPECT_EQ(Count(database_, "matches"), 0);
  std::filesystem::copy(folder_.File("copy.db"), early_);
  EXPECT_EQ(*TakeEarlyMatches(early_, "these", database_),
            static_cast<int>(neighbors_.size()) - 1);
  EXPECT_EQ(Count(database_, "two_view_geometries"),
            static_cast<int>(neighbors_.size()) - 1);
  EXPECT_EQ(*TakeEarlyMatches(early_, "these", database_), 0);
}

// In SQLite's older journal mode a reader would block the extraction.
TEST_F(EarlyMatcherTest, DoesNotStandInTheWayOfTheExtraction) {
  Execute(database_, "PRAGMA journal_mode = DELETE");
  EXPECT_THROW(OpenEarlyDatabase(database_, "these", early_), SqliteError);
  Execute(database_, "PRAGMA journal_mode = WAL");
  OpenEarlyDatabase(database_, "these", early_);
  EXPECT_TRUE(EarlyFeatures(early_, database_).FindReady().empty());
  Execute(database_, "PRAGMA journal_mode = DELETE");
  EXPECT_THROW(EarlyFeatures(early_, database_), SqliteError);
}

}  // namespace
}  // namespace adasfm
