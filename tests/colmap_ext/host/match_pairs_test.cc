// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/host/features.h"
#include "core/so3.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/landmark_descriptors.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

class MatchPairsTest : public testing::Test {
 protected:
  MatchPairsTest() {
    SyntheticWorldOptions options;
    options.num_images = 14;
    options.num_keypoints_per_image = 200;
    world_ = BuildSyntheticWorld(options);
    for (const SyntheticImage& image1 : world_.images) {
      for (const SyntheticImage& image2 : world_.images) {
        if (image1.image_id < image2.image_id) {
          pairs_.emplace_back(image1.image_id, image2.image_id);
        }
      }
    }
  }

  // With features, without matches.
  std::string MakeDatabase(const std::string& name) {
    const std::string path = folder_.File(name);
    EXPECT_TRUE(WriteSyntheticDatabase(world_, path).ok());
    WriteLandmarkDescriptors(world_, 1, path);
    SqliteConnection database(path, SqliteConnection::Mode::kWrite);
    database.Execute("DELETE FROM matches");
    database.Execute("DELETE FROM two_view_geometries");
    return path;
  }

  // The number of pairs that the predictor guided.
  int Match(const std::string& path, const std::vector<ImagePair>& pairs,
            const std::string& matcher, int num_threads,
            const MotionPredictor& predictor = {}) {
    FeatureOptions options;
    options.matcher = matcher;
    options.num_threads = num_threads;
    int num_guided = 0;
    const Status status = MatchPairs(
        options, pairs, path, folder_.File("matching.log"),
        [](const std::string&, double) {}, predictor, &num_guided);
    EXPECT_TRUE(status.ok()) << status.message();
    return num_guided;
  }

  // Predicts the true motions with the given error, and sigmas of half a
  // milliradian and a hundredth of a metre.
  MotionPredictor Predict(const Rigid3d& error) {
    return [this, error](const ImagePair& pair) {
      PredictedMotion motion;
      motion.cam2_from_cam1 =
          error * world_.images[pair.image_id2 - 1].cam_from_world *
          world_.images[pair.image_id1 - 1].cam_from_world.Inverse();
      motion.covariance.diagonal() << Eigen::Vector3d::Constant(25e-8),
          Eigen::Vector3d::Constant(1e-4);
      return motion;
    };
  }

  // Inlier matches, and those of them that are true.
  std::pair<int, int> CountInliers(const std::string& path) {
    SqliteConnection database(path, SqliteConnection::Mode::kRead);
    int num_all = 0, num_true = 0;
    for (const ImagePair& pair : pairs_) {
      const auto& landmarks1 = world_.images[pair.image_id1 - 1].landmark_ids;
      const auto& landmarks2 = world_.images[pair.image_id2 - 1].landmark_ids;
      for (const FeatureMatch& match :
           ReadMatchesOfPair(&database, "two_view_geometries", pair)) {
        ++num_all;
        num_true +=
            landmarks1[match.point2D_idx1] == landmarks2[match.point2D_idx2];
      }
    }
    return {num_all, num_true};
  }

  // All that the matcher writes, bit by bit.
  static std::vector<std::string> Rows(const std::string& path) {
    SqliteConnection database(path, SqliteConnection::Mode::kRead);
    std::vector<std::string> rows;
    for (const char* query :
         {"SELECT pair_id, rows, hex(data) FROM matches ORDER BY pair_id",
          "SELECT pair_id, rows, hex(data) || config || hex(F) || hex(E) || "
          "hex(H) FROM two_view_geometries ORDER BY pair_id"}) {
      SqliteStatement statement(&database, query);
      while (statement.Step()) {
        rows.push_back(std::to_string(statement.Int(0)) + " " +
                       std::to_string(statement.Int(1)) + " " +
                       statement.Text(2));
      }
    }
    return rows;
  }

  TemporaryFolder folder_;
  SyntheticWorld world_;
  std::vector<ImagePair> pairs_;
};

TEST_F(MatchPairsTest, ThreadsAndInterruptionsDoNotMatter) {
  const std::string once = MakeDatabase("once.db");
  Match(once, pairs_, "adasfm", 1);
  EXPECT_TRUE(CheckMatches(once, pairs_).ok());
  const std::vector<std::string> rows = Rows(once);
  EXPECT_EQ(rows.size(), 2 * pairs_.size());
  // On several threads, backwards, in two runs, the second of which finds a
  // pair that was half written.
  const std::string again = MakeDatabase("again.db");
  const std::vector<ImagePair> backwards(pairs_.rbegin(), pairs_.rend());
  Match(again,
        std::vector<ImagePair>(backwards.begin(), backwards.begin() + 40),
        "adasfm", 3);
  {
    SqliteConnection database(again, SqliteConnection::Mode::kWrite);
    database.Execute(
        "DELETE FROM two_view_geometries WHERE pair_id = (SELECT MAX(pair_id) "
        "FROM two_view_geometries)");
  }
  Match(again, backwards, "adasfm", 4);
  EXPECT_EQ(Rows(again), rows);
}

// The matches are true, and include nearly all that COLMAP's matcher finds.
TEST_F(MatchPairsTest, MatchesAreTrueAndCompareWithTheHosts) {
  const std::string ours = MakeDatabase("ours.db");
  const std::string host = MakeDatabase("host.db");
  Match(ours, pairs_, "adasfm", 2);
  Match(host, pairs_, "host", 2);
  SqliteConnection our_database(ours, SqliteConnection::Mode::kRead);
  SqliteConnection host_database(host, SqliteConnection::Mode::kRead);
  size_t num_true = 0, num_all = 0, num_host = 0, num_both = 0;
  for (const ImagePair& pair : pairs_) {
    const std::vector<FeatureMatch> matches =
        ReadMatchesOfPair(&our_database, "two_view_geometries", pair);
    const std::set<FeatureMatch> found(matches.begin(), matches.end());
    const auto& landmarks1 = world_.images[pair.image_id1 - 1].landmark_ids;
    const auto& landmarks2 = world_.images[pair.image_id2 - 1].landmark_ids;
    for (const FeatureMatch& match : matches) {
      ++num_all;
      num_true +=
          landmarks1[match.point2D_idx1] == landmarks2[match.point2D_idx2];
    }
    for (const FeatureMatch& match :
         ReadMatchesOfPair(&host_database, "two_view_geometries", pair)) {
      ++num_host;
      num_both += found.count(match);
    }
  }
  EXPECT_GT(num_all, 1000);
  EXPECT_GT(num_true, 0.99 * num_all);
  EXPECT_GT(num_both, 0.98 * num_host);
}

TEST_F(MatchPairsTest, AGoodPredictionGuides) {
  const std::string plain = MakeDatabase("plain.db");
  const std::string guided = MakeDatabase("guided.db");
  Match(plain, pairs_, "adasfm", 2);
  EXPECT_GT(Match(guided, pairs_, "adasfm", 2, Predict(Rigid3d())), 10);
  EXPECT_TRUE(CheckMatches(guided, pairs_).ok());
  const auto [num_plain, num_true_plain] = CountInliers(plain);
  const auto [num_guided, num_true_guided] = CountInliers(guided);
  EXPECT_GT(num_true_guided, 0.99 * num_guided);
  EXPECT_GE(num_true_guided, num_true_plain);
}

// A prediction that the matches contradict does not change the result.
TEST_F(MatchPairsTest, AWrongPredictionChangesNothing) {
  const std::string plain = MakeDatabase("plain.db");
  const std::string misled = MakeDatabase("misled.db");
  Match(plain, pairs_, "adasfm", 2);
  const Rigid3d error(ExpSo3(Eigen::Vector3d(0.15, 0.1, 0.1)),
                      Eigen::Vector3d(0.0, 0.3, 0.0));
  EXPECT_EQ(Match(misled, pairs_, "adasfm", 2, Predict(error)), 0);
  EXPECT_TRUE(Rows(misled) == Rows(plain));
}

TEST_F(MatchPairsTest, OtherDescriptorsAreRefused) {
  const std::string path = MakeDatabase("floats.db");
  {
    SqliteConnection database(path, SqliteConnection::Mode::kWrite);
    database.Execute("UPDATE descriptors SET rows = 2 * rows, cols = 64");
  }
  FeatureOptions options;
  const Status status =
      MatchPairs(options, pairs_, path, folder_.File("matching.log"),
                 [](const std::string&, double) {});
  EXPECT_NE(status.message().find("64 bytes are not SIFT's"), std::string::npos)
      << status.message();
}

}  // namespace
}  // namespace adasfm
