// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report/report_scene.h"

#include <gtest/gtest.h>

#include <set>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/evaluation/evaluation.h"
#include "colmap_ext/report/report_examples.h"
#include "colmap_ext/report/report_html.h"
#include "colmap_ext/report/report_pairs.h"
#include "core/random.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/report_model.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"
#include "tests/testing/colmap_ext/temporary_folder.h"

namespace adasfm {
namespace {

SyntheticWorld BuildWorld(uint64_t seed) {
  SyntheticWorldOptions options;
  options.seed = seed;
  options.num_images = 30;
  return BuildSyntheticWorld(options);
}

TEST(ReportScene, PriorsWithoutErrorFollowTheModel) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildWorld(seed);
    const colmap::Reconstruction model = MakeModel(world, 1, 0.0);
    SyntheticPriorOptions exact;
    exact.rotation_sigma_rad = exact.translation_sigma_m = 0.0;
    PriorTables tables;
    tables.priors = BuildSyntheticScene(world, exact).priors;
    // Without a length, the motion from the 11th image to the next starts a new
    // run.
    tables.priors[10].flags = kPriorRotation;
    ReportScene scene = BuildReportScene({}, model, nullptr, tables);
    ChainPriors(tables.priors, &scene);
    ASSERT_EQ(scene.images.size(), 30);
    for (size_t i = 0; i < scene.images.size(); ++i) {
      const ReportImage& image = scene.images[i];
      ASSERT_TRUE(image.prior_cam_from_world.has_value()) << i;
      EXPECT_EQ(image.prior_run, i <= 10 ? 0 : 1);
      EXPECT_LT((image.prior_cam_from_world->TargetOriginInSource() -
                 image.cam_from_world->TargetOriginInSource())
                    .norm(),
                1e-6);
    }
  }
}

TEST(ReportScene, PointsAreSampledUpToALimit) {
  const colmap::Reconstruction model = MakeModel(BuildWorld(1), 4, 0.25);
  ASSERT_GT(model.NumPoints3D(), 7);
  EXPECT_EQ(PointsToJson(model, ReportScene(), 7)["count"], 7);
  EXPECT_EQ(PointsToJson(model, ReportScene(), 1000000)["count"],
            model.NumPoints3D());
}

TEST(ReportScene, TheTruthComesIntoTheModelsWorld) {
  for (const uint64_t seed : {1, 2, 3}) {
    const SyntheticWorld world = BuildWorld(seed);
    Random random(seed);
    const Eigen::Quaterniond turn = ExpSo3(random.GaussianVector(1.0));
    const Eigen::Vector3d shift = random.GaussianVector(50.0);
    for (const double scale : {1.0, 2.5}) {
      NamedPoses truth;
      for (const SyntheticImage& image : world.images) {
        truth[image.name] = TransformCamFromWorld(Sim3d(scale, turn, shift),
                                                  image.cam_from_world);
      }
      for (const bool is_metric : {false, true}) {
        ReportScene scene = BuildReportScene({}, MakeModel(world, 1, 0.0),
                                             nullptr, PriorTables());
        AlignTruth(truth, is_metric, &scene);
        double max_error_m = 0.0, max_distance = 0.0;
        for (const ReportImage& image : scene.images) {
          max_error_m = std::max(max_error_m, *image.error_m);
          max_distance = std::max(max_distance,
                                  (*image.true_center -
                                   image.cam_from_world->TargetOriginInSource())
                                      .norm());
        }
        // A wrong scale counts as an error of a metric model.
        const bool fits = scale == 1.0 || !is_metric;
        EXPECT_EQ(max_error_m < 1e-6, fits);
        EXPECT_EQ(max_distance < 1e-6, fits);
      }
    }
  }
}

TEST(ReportScene, UpIsUpwards) {
  SyntheticWorldOptions options;
  options.num_images = 30;
  const SyntheticWorld world = BuildSyntheticWorld(options);
  colmap::Reconstruction model = MakeModel(world, 1, 0.0);
  // The world's z is up; here x is.
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(
      Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX());
  for (const image_t image_id : model.RegImageIds()) {
    SetCamFromWorld(
        TransformCamFromWorld(Sim3d(1.0, turn, Eigen::Vector3d::Zero()),
                              CamFromWorld(model.Image(image_id))),
        &model.Image(image_id));
  }
  PriorTables tables;
  for (const SyntheticImage& image : world.images) {
    tables.gravity.push_back({image.image_id, image.cam_from_world.rotation *
                                                  -Eigen::Vector3d::UnitZ()});
  }
  const ReportScene with = BuildReportScene({}, model, nullptr, tables);
  EXPECT_LT(AngleBetweenRad(Eigen::Vector3d(with.level_from_world *
                                            Eigen::Vector3d::UnitX()),
                            Eigen::Vector3d::UnitZ()),
            1e-6);
  // Cameras of a car are upright within a few degrees.
  const ReportScene without =
      BuildReportScene({}, model, nullptr, PriorTables());
  EXPECT_LT(AngleBetweenRad(Eigen::Vector3d(without.level_from_world *
                                            Eigen::Vector3d::UnitX()),
                            Eigen::Vector3d::UnitZ()),
            DegToRad(10.0));
}

// Pairs (i, i + gap) of `num_images` images, every third one removed.
ReportPairs MakePairs(size_t num_images, size_t max_gap) {
  ReportPairs pairs;
  for (size_t i = 0; i < num_images; ++i) {
    for (size_t gap = 1; gap <= max_gap && i + gap < num_images; ++gap) {
      const int64_t count = 15 + (i * 7919 + gap * 104729) % 300;
      pairs.pairs.push_back(
          {i, i + gap, count, (i + gap) % 3 == 0 ? 0 : count, 2 * count});
    }
  }
  return pairs;
}

TEST(SelectExamples, TakesTheMostDoubtfulAndSpreadsThem) {
  const ReportPairs pairs = MakePairs(100, 9);
  const std::vector<ReportPair> removed = SelectRemovedExamples(pairs, 100, 4);
  const std::vector<ReportPair> kept = SelectKeptExamples(pairs, 100, 4);
  ASSERT_EQ(removed.size(), 4);
  ASSERT_EQ(kept.size(), 4);
  int64_t most_removed = 0, fewest_kept = 1000;
  for (const ReportPair& pair : pairs.pairs) {
    if (pair.num_after == 0) {
      most_removed = std::max(most_removed, pair.num_before);
    } else {
      fewest_kept = std::min(fewest_kept, pair.num_after);
    }
  }
  EXPECT_EQ(removed[0].num_before, most_removed);
  EXPECT_EQ(kept[0].index2 - kept[0].index1, 9);
  EXPECT_EQ(kept[1].num_after, fewest_kept);
  for (const std::vector<ReportPair>* list : {&removed, &kept}) {
    for (size_t a = 0; a < list->size(); ++a) {
      EXPECT_EQ((*list)[a].num_after == 0, list == &removed);
      for (size_t b = 0; b < a; ++b) {
        EXPECT_GT(
            std::abs(1.0 * (*list)[a].index1 - 1.0 * (*list)[b].index1) +
                std::abs(1.0 * (*list)[a].index2 - 1.0 * (*list)[b].index2),
            5.0);
      }
    }
  }
}

TEST(SelectExamples, TakesNearOnesRatherThanNone) {
  const ReportPairs pairs = MakePairs(4, 2);
  size_t num_removed = 0;
  for (const ReportPair& pair : pairs.pairs) num_removed += pair.num_after == 0;
  EXPECT_EQ(SelectRemovedExamples(pairs, 4, 10).size(), num_removed);
  EXPECT_EQ(SelectKeptExamples(pairs, 4, 10).size(),
            pairs.pairs.size() - num_removed);
  EXPECT_TRUE(SelectKeptExamples(pairs, 4, 0).empty());
  EXPECT_TRUE(SelectKeptExamples(ReportPairs(), 0, 4).empty());
}

TEST(PairsToJson, SizeIsBounded) {
  const ReportPairs pairs = MakePairs(1000, 20);
  const nlohmann::json full = PairsToJson(pairs, 1000, 1000);
  EXPECT_EQ(full["size"], 1000);
  EXPECT_EQ(full["before"], PackUint16([&pairs] {
              std::vector<uint16_t> counts;
              for (const ReportPair& pair : pairs.pairs) {
                counts.push_back(pair.num_before);
              }
              return counts;
            }()));
  // Cells of ten images; those of 20 neighbours lie in three diagonals.
  const nlohmann::json small = PairsToJson(pairs, 1000, 100);
  EXPECT_EQ(small["size"], 100);
  EXPECT_EQ(small["before"]["u16"].get<std::string>().size(),
            EncodeBase64(std::string(2 * (100 + 99 + 98), ' ').data(),
                         2 * (100 + 99 + 98))
                .size());
  EXPECT_EQ(PairsToJson(ReportPairs(), 0, 10)["size"], 1);
}

TEST(ReadRemovedPairs, NamesMayHaveSpaces) {
  TemporaryFolder folder;
  ReportScene scene;
  const char* names[] = {"a b", "c", "a", "b c d"};
  for (size_t i = 0; i < 4; ++i) scene.index_of_name[names[i]] = i;
  const RemovedPairs removed = ReadRemovedPairs(
      folder.Write("pairs.txt", "a b c\na b c d\na c\nx y\n"), scene);
  const std::vector<std::pair<size_t, size_t>> expected = {
      {0, 1}, {2, 3}, {2, 1}};
  EXPECT_EQ(removed.pairs, expected);
  EXPECT_EQ(removed.num_unknown, 1);
}

TEST(Histogram, TheLastBinTakesTheRest) {
  Histogram histogram(0.5, 3);
  for (const double value : {0.0, 0.4, 0.6, 1.0, 7.0, 1e300}) {
    histogram.Add(value);
  }
  EXPECT_EQ(histogram.ToJson()["counts"], nlohmann::json({2, 1, 3}));
}

TEST(ReportHtml, Encodings) {
  EXPECT_EQ(EncodeBase64("Man", 3), "TWFu");
  EXPECT_EQ(EncodeBase64("Ma", 2), "TWE=");
  EXPECT_EQ(EncodeBase64("\xff", 1), "/w==");
  EXPECT_EQ(EscapeHtml("<a href=\"x\">&'"),
            "&lt;a href=&quot;x&quot;&gt;&amp;&#39;");
  const nlohmann::json json = {{"k", "</script>&<!--"}};
  const std::string text = JsonForScript(json);
  EXPECT_EQ(text.find_first_of("<>&"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(text), json);
  EXPECT_NO_THROW(JsonForScript("\xff\xfe"));
  EXPECT_EQ(FormatCount(1234567), "1,234,567");
  EXPECT_EQ(FormatCount(123), "123");
  EXPECT_EQ(FillTemplate("a {{X}} b", {{"X", "{{X}}"}}), "a {{X}} b");
  EXPECT_THROW(FillTemplate("{{Y}}", {{"X", ""}}), std::invalid_argument);
  EXPECT_THROW(FillTemplate("{{X", {{"X", ""}}), std::invalid_argument);
}

}  // namespace
}  // namespace adasfm
