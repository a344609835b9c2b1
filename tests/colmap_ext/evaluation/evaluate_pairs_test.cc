// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/evaluation/evaluate_pairs.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numeric>

#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

class EvaluatePairsTest : public testing::Test {
 protected:
  EvaluatePairsTest() {
    SyntheticWorldOptions options;
    options.num_images = 12;
    options.num_keypoints_per_image = 120;
    world_ = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world_, database_).ok());
    EXPECT_TRUE(WriteSyntheticLogs(world_, folder_.Path()).ok());
    for (const SyntheticImage& image : world_.images) {
      truth_[image.name] = image.cam_from_world;
    }
  }

  PairEvaluation Evaluate(bool with_landmarks = true) {
    const StatusOr<PairEvaluation> evaluation = EvaluateDatabasePairs(
        database_, truth_,
        with_landmarks ? folder_.File("landmarks.txt") : std::string());
    EXPECT_TRUE(evaluation.ok()) << evaluation.status().message();
    return *evaluation;
  }

  bool IsTrue(const SyntheticPair& pair, const FeatureMatch& match) const {
    return world_.images[pair.image_id1 - 1].landmark_ids[match.point2D_idx1] ==
           world_.images[pair.image_id2 - 1].landmark_ids[match.point2D_idx2];
  }

  TemporaryFolder folder_;
  std::string database_ = folder_.File("database.db");
  SyntheticWorld world_;
  NamedPoses truth_;
};

TEST_F(EvaluatePairsTest, CountsMatchesAsTheWorldKnowsThem) {
  int64_t num_matches = 0, num_true = 0, num_true_raw = 0;
  int num_pairs = 0;
  for (const SyntheticPair& pair : world_.pairs) {
    if (pair.inlier_matches.size() < 15) continue;
    ++num_pairs;
    num_matches += pair.inlier_matches.size();
    for (const FeatureMatch& match : pair.inlier_matches) {
      num_true += IsTrue(pair, match);
    }
    for (const FeatureMatch& match : pair.raw_matches) {
      num_true_raw += IsTrue(pair, match);
    }
  }
  const PairEvaluation evaluation = Evaluate();
  EXPECT_TRUE(evaluation.has_landmarks);
  EXPECT_EQ(evaluation.num_true_raw_matches, num_true_raw);
  for (const PairSetFigures* figures :
       {&evaluation.verified, &evaluation.kept_before,
        &evaluation.kept_after}) {
    EXPECT_EQ(figures->num_pairs, num_pairs);
    EXPECT_EQ(figures->num_matches, num_matches);
    EXPECT_EQ(figures->num_true_matches, num_true);
    EXPECT_EQ(figures->num_false_pairs, 0);
    EXPECT_EQ(std::accumulate(figures->inlier_ratio_histogram.begin(),
                              figures->inlier_ratio_histogram.end(), 0),
              num_pairs);
    EXPECT_GT(figures->mean_inlier_ratio, 0.5);
    EXPECT_LE(figures->mean_inlier_ratio, 1.0);
  }
}

// Half of the pairs are replaced by their true poses and matches, one of the
// others is removed.
TEST_F(EvaluatePairsTest, TellsBeforeFromAfter) {
  std::vector<NewTwoViewGeometry> rows;
  std::vector<ImagePair> removed;
  for (const SyntheticPair& pair : world_.pairs) {
    if (pair.inlier_matches.size() < 15) continue;
    const ImagePair ids(pair.image_id1, pair.image_id2);
    NewTwoViewGeometry row;
    row.pair = ids;
    for (const FeatureMatch& match : pair.raw_matches) {
      if (IsTrue(pair, match)) row.inlier_matches.push_back(match);
    }
    row.cam2_from_cam1 =
        ComputeCam2FromCam1(world_.images[pair.image_id1 - 1].cam_from_world,
                            world_.images[pair.image_id2 - 1].cam_from_world);
    if (removed.empty()) {
      removed.push_back(ids);
    } else {
      rows.push_back(row);
    }
  }
  const PairEvaluation before = Evaluate();
  ASSERT_TRUE(RewriteTwoViewGeometries(database_, rows, removed).ok());
  const PairEvaluation after = Evaluate();
  EXPECT_EQ(after.verified.num_pairs, before.verified.num_pairs);
  EXPECT_EQ(after.verified.num_matches, before.verified.num_matches);
  EXPECT_EQ(after.kept_before.num_pairs, rows.size());
  EXPECT_EQ(after.kept_after.num_pairs, rows.size());
  EXPECT_EQ(after.kept_after.num_true_matches, after.kept_after.num_matches);
  EXPECT_GE(after.kept_after.num_true_matches,
            after.kept_before.num_true_matches);
  for (const RelativePoseAuc& auc : after.kept_after.auc) {
    EXPECT_NEAR(auc.rotation_percent, 100.0, 1e-3);
    EXPECT_NEAR(auc.translation_percent, 100.0, 1e-3);
  }
  EXPECT_LT(after.kept_before.auc.front().translation_percent, 99.0);
  const auto json = nlohmann::json::parse(PairEvaluationToJson(after));
  EXPECT_EQ(json["kept_after"]["precision"], 1.0);
  EXPECT_LE(json["kept_after"]["recall"], 1.0);
  EXPECT_NE(FormatPairEvaluation(after).find("kept, refined"),
            std::string::npos);
}

TEST_F(EvaluatePairsTest, KnowsFalsePairs) {
  // Another numbering of one image's landmarks makes all its pairs false.
  std::string text;
  for (const SyntheticImage& image : world_.images) {
    text += image.name;
    for (const int id : image.landmark_ids) {
      text += " " + std::to_string(image.image_id == 3 ? id + 100000 : id);
    }
    text += "\n";
  }
  folder_.Write("landmarks.txt", text);
  int num_false = 0;
  for (const SyntheticPair& pair : world_.pairs) {
    num_false += (pair.image_id1 == 3 || pair.image_id2 == 3) &&
                 pair.inlier_matches.size() >= 15;
  }
  EXPECT_EQ(Evaluate().verified.num_false_pairs, num_false);
}

TEST_F(EvaluatePairsTest, WithoutLandmarksThereIsNoPrecision) {
  const PairEvaluation evaluation = Evaluate(false);
  EXPECT_FALSE(evaluation.has_landmarks);
  EXPECT_EQ(PairEvaluationToJson(evaluation).find("precision"),
            std::string::npos);
}

TEST_F(EvaluatePairsTest, NamesWhatIsWrong) {
  folder_.Write("landmarks.txt", world_.images[0].name + " 1 2\na.png 1 x\n");
  const StatusOr<KeypointLandmarks> landmarks =
      ReadKeypointLandmarks(folder_.File("landmarks.txt"));
  ASSERT_FALSE(landmarks.ok());
  EXPECT_NE(landmarks.status().message().find("landmarks.txt:2"),
            std::string::npos);
  EXPECT_FALSE(ReadKeypointLandmarks(folder_.File("none")).ok());
  NamedPoses others;
  others["other.png"] = Rigid3d();
  EXPECT_FALSE(EvaluateDatabasePairs(database_, others, "").ok());
}

}  // namespace
}  // namespace adasfm
