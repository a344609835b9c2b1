// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "colmap_ext/host/database.h"
#include "colmap_ext/prior_tables.h"
#include "colmap_ext/report_examples.h"
#include "colmap_ext/report_html.h"
#include "colmap_ext/report_pairs.h"
#include "colmap_ext/report_scene.h"
#include "colmap_ext/two_view_geometry_backup.h"
#include "colmap_ext/write_synthetic_world.h"
#include "core/random.h"
#include "core/so3.h"
#include "tests/colmap_ext/command_line_fixture.h"
#include "tests/colmap_ext/synthetic_scene.h"

namespace adasfm {
namespace {

constexpr char kHostileName[] = "</script><b>&\"'.png";

// Poses of the world as a model, some keypoints seen where they should be, and
// moved by `shift_px`.
colmap::Reconstruction MakeModel(const SyntheticWorld& world, int num_points,
                                 double shift_px) {
  colmap::Reconstruction model;
  colmap::Camera camera;
  camera.SetCameraId(1);
  camera.InitializeWithName("SIMPLE_PINHOLE", 500.0, 800, 500);
  model.AddCamera(camera);
  for (const SyntheticImage& entry : world.images) {
    colmap::Image image;
    image.SetImageId(entry.image_id);
    image.SetCameraId(1);
    image.SetName(entry.name);
    SetCamFromWorld(entry.cam_from_world, &image);
    // Points lie on the axis, 10 m ahead.
    image.SetPoints2D(std::vector<Eigen::Vector2d>(
        num_points, Eigen::Vector2d(400.0 + shift_px, 250.0)));
    model.AddImage(image);
    model.RegisterImage(entry.image_id);
  }
  for (const SyntheticImage& entry : world.images) {
    for (int k = 0; k < num_points; ++k) {
      colmap::Track track;
      track.AddElement(entry.image_id, k);
      model.AddPoint3D(
          entry.cam_from_world.Inverse() * Eigen::Vector3d(0.0, 0.0, 10.0),
          track, Eigen::Vector3ub(1, 2, 3));
    }
  }
  return model;
}

nlohmann::json DataOf(const std::string& page) {
  const std::string begin = "<script type=\"application/json\" id=\"data\">";
  const size_t from = page.find(begin) + begin.size();
  return nlohmann::json::parse(
      page.substr(from, page.find("</script>", from) - from));
}

int Count(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  return std::distance(std::sregex_iterator(text.begin(), text.end(), regex),
                       std::sregex_iterator());
}

// The page without its scripts' insides.
std::string MarkupOf(std::string page) {
  size_t from = 0;
  while ((from = page.find("<script", from)) != std::string::npos) {
    from = page.find('>', from) + 1;
    page.erase(from, page.find("</script>", from) - from);
  }
  return page;
}

void ExpectSelfContained(const std::string& page) {
  EXPECT_EQ(page.rfind("<!doctype html>", 0), 0);
  EXPECT_EQ(page.find("http://"), std::string::npos);
  EXPECT_EQ(page.find("https://"), std::string::npos);
  EXPECT_EQ(page.find("{{"), std::string::npos);
  const std::string markup = MarkupOf(page);
  EXPECT_EQ(Count(markup, "(src|href)=\"(?!data:)"), 0);
  for (const std::string tag :
       {"html",   "head",    "body",  "main",   "header", "style",
        "script", "section", "table", "thead",  "tbody",  "tr",
        "th",     "td",      "dl",    "div",    "figure", "p",
        "ul",     "li",      "label", "canvas", "span",   "h2"}) {
    EXPECT_EQ(Count(markup, "<" + tag + "[ >\n]"),
              Count(markup, "</" + tag + ">"))
        << tag;
  }
  // Every id that the script asks for is there, once.
  std::multiset<std::string> ids;
  const std::regex id_pattern(" id=\"([^\"]+)\"");
  for (std::sregex_iterator it(markup.begin(), markup.end(), id_pattern), end;
       it != end; ++it) {
    ids.insert((*it)[1]);
  }
  const std::regex use_pattern("byId\\(\"([^\"]+)\"\\)");
  for (std::sregex_iterator it(page.begin(), page.end(), use_pattern), end;
       it != end; ++it) {
    EXPECT_EQ(ids.count((*it)[1]), 1) << (*it)[1];
  }
}

// The output of a chain, as its stages leave it.
class ReportTest : public CommandLineTest {
 protected:
  ReportTest() {
    SyntheticWorldOptions world_options;
    world_options.num_images = 25;
    world_options.num_keypoints_per_image = 60;
    world_ = BuildSyntheticWorld(world_options);
    world_.images[3].name = kHostileName;
    EXPECT_TRUE(WriteSyntheticDatabase(world_, database_).ok());
    EXPECT_TRUE(WriteSyntheticLogs(world_, folder_.Path()).ok());
    for (const char* model : {"global/0", "sparse/0"}) {
      std::filesystem::create_directories(folder_.File(model));
      MakeModel(world_, 4, 0.25).Write(folder_.File(model));
    }
    WriteTables();
    WriteSummaries();
  }

  void WriteTables() {
    PriorTables tables;
    tables.priors = BuildSyntheticScene(world_, {}).priors;
    for (const SyntheticImage& image : world_.images) {
      tables.image_times.push_back({image.image_id, image.timestamp_ns});
    }
    EXPECT_TRUE(WritePriorTables(database_, tables).ok());
    removed_ = ImagePair(world_.pairs[0].image_id1, world_.pairs[0].image_id2);
    EXPECT_TRUE(RewriteTwoViewGeometries(database_, {}, {removed_}).ok());
    folder_.Write("global/removed_pairs.txt", world_.images[3].name + " " +
                                                  world_.images[9].name +
                                                  "\nno such images\n");
  }

  void WriteSummaries() {
    folder_.Write("global/summary.json",
                  R"({"steps": [{"name": "loop gating", "seconds": 1.5,
                      "summary": "5 <pairs> tested"}]})");
    folder_.Write("sparse/summary.json",
                  R"({"is_metric": true, "refine_seconds": 2.25, "parts": [
                      {"part_index": 0, "num_images": 25, "merged": false,
                       "failure": ""}]})");
    std::filesystem::create_directories(folder_.File("sparse/checkpoints"));
    folder_.Write("sparse/checkpoints/plan.json",
                  R"({"parts": [[1, 2, 3], [3, 4]]})");
    folder_.Write("steps.json",
                  R"([{"name": "matching", "seconds": 3.0},
                      {"name": "model", "seconds": 9.0}, 7])");
    folder_.Write(
        "database.db.priors.json",
        R"({"imu_rate_hz": 200.0, "seconds": 0.5, "warnings": ["a < b"]})");
  }

  ReportOptions AllInputs() const {
    ReportOptions options;
    options.input_path = folder_.File("sparse/0");
    options.coarse_path = folder_.File("global");
    options.database_path = database_;
    options.ground_truth_path = folder_.File("sparse/0");
    return options;
  }

  std::string database_ = folder_.File("database.db");
  SyntheticWorld world_;
  ImagePair removed_;
};

TEST_F(ReportTest, IsSelfContainedAndHoldsTheFigures) {
  const StatusOr<std::string> page = BuildReport(AllInputs());
  ASSERT_TRUE(page.ok()) << page.status().message();
  ExpectSelfContained(*page);
  for (const std::string figure :
       {"25 of 25", "<b>100</b>", "1.00", "0.25 px", "RMSE of the points",
        "0.000 m", "7.2 s", "5 &lt;pairs&gt; tested",
        "does not fit the coarse model", "a &lt; b", "200 Hz", "1 lines of"}) {
    EXPECT_NE(page->find(figure), std::string::npos) << figure;
  }
  const nlohmann::json data = DataOf(*page);
  EXPECT_EQ(data["unit"], "m");
  for (const char* key : {"final", "coarse", "prior", "truth", "error"}) {
    EXPECT_TRUE(data["images"][key].contains("f32")) << key;
  }
  EXPECT_EQ(data["images"]["part"], PackUint16([] {
              std::vector<uint16_t> parts(25, 0);
              parts[0] = parts[1] = parts[2] = 1;
              parts[3] = 2;
              return parts;
            }()));
  EXPECT_EQ(data["removed"], PackUint32({3, 9}));
  EXPECT_EQ(data["pairs"]["num_before"].get<int>() - 1,
            data["pairs"]["num_after"].get<int>());
  // All errors are 0.25 px, in the third bin of 0.1 px.
  EXPECT_EQ(data["reprojection"]["counts"][2], 100);
  EXPECT_EQ(*page, *BuildReport(AllInputs()));
}

TEST_F(ReportTest, DrawsMatchesOnPhotos) {
  ReportOptions options = AllInputs();
  options.image_path = folder_.File("photos");
  options.max_num_examples = 2;
  // Any picture will do: OpenCV goes by the content and not by the name.
  std::filesystem::create_directories(options.image_path);
  for (const SyntheticImage& image : world_.images) {
    if (image.name == kHostileName) continue;
    folder_.Write("photos/" + image.name,
                  "P6 8 5 255\n" + std::string(8 * 5 * 3, '\x60'));
  }
  const StatusOr<std::string> page = BuildReport(options);
  ASSERT_TRUE(page.ok()) << page.status().message();
  ExpectSelfContained(*page);
  EXPECT_EQ(Count(*page, "data:image/jpeg"), 3);
  SqliteConnection database(database_, SqliteConnection::Mode::kRead);
  const size_t num_inliers =
      ReadMatchesOfPair(&database, kTwoViewGeometryBackupTable, removed_)
          .size();
  EXPECT_NE(page->find(std::to_string(num_inliers) + " inliers, all removed"),
            std::string::npos);
  EXPECT_EQ(Count(*page, "<path class=\"kept\""), 2);
  EXPECT_EQ(*page, *BuildReport(options));

  // Photos that are cut short or missing are counted, and the page stands.
  for (const SyntheticImage& image : world_.images) {
    folder_.Write("photos/" + image.name, "P6 8");
  }
  const StatusOr<std::string> without = BuildReport(options);
  ASSERT_TRUE(without.ok()) << without.status().message();
  ExpectSelfContained(*without);
  EXPECT_NE(without->find("3 of the pairs on photos"), std::string::npos);
  EXPECT_EQ(Count(*without, "data:image/jpeg"), 0);
}

TEST_F(ReportTest, NamesCannotBreakThePage) {
  const StatusOr<std::string> page = BuildReport(AllInputs());
  ASSERT_TRUE(page.ok());
  EXPECT_EQ(page->find(kHostileName), std::string::npos);
  EXPECT_EQ(Count(*page, "</script>"), 2);
  const nlohmann::json names = DataOf(*page)["images"]["names"];
  EXPECT_EQ(std::count(names.begin(), names.end(), kHostileName), 1);
}

TEST_F(ReportTest, LeavesOutWhatIsNotGiven) {
  ReportOptions options;
  options.input_path = folder_.File("global/0");
  options.max_num_points = 7;
  const StatusOr<std::string> page = BuildReport(options);
  ASSERT_TRUE(page.ok()) << page.status().message();
  ExpectSelfContained(*page);
  for (const char* note :
       {"no --coarse_path", "no --database_path", "no --ground_truth_path"}) {
    EXPECT_NE(page->find(note), std::string::npos) << note;
  }
  const nlohmann::json data = DataOf(*page);
  EXPECT_EQ(data["unit"], "units");
  EXPECT_EQ(data["points"]["count"], 7);
  EXPECT_TRUE(data["images"]["coarse"].is_null());
  EXPECT_FALSE(data.contains("pairs"));
}

TEST_F(ReportTest, SummariesThatAreCutShortAreNamed) {
  folder_.Write("sparse/summary.json", "{\"parts\": [");
  folder_.Write("steps.json", "[{");
  folder_.Write("global/summary.json", "{\"steps\": 3, \"models\": [1]}");
  folder_.Write("database.db.priors.json", "{\"imu_rate_hz\": \"fast\"}");
  folder_.Write("sparse/checkpoints/plan.json", "{\"parts\": [1, [-1, 99]]}");
  const StatusOr<std::string> page = BuildReport(AllInputs());
  ASSERT_TRUE(page.ok()) << page.status().message();
  ExpectSelfContained(*page);
  EXPECT_NE(page->find("sparse/summary.json is not a complete JSON file"),
            std::string::npos);
}

TEST_F(ReportTest, TheCommandWritesTheFile) {
  const std::string output = folder_.File("report.html");
  const std::string arguments = "adasfm_reporter --output_path " + output +
                                " --input_path " + folder_.File("sparse");
  const Run run = Call(arguments);
  ASSERT_EQ(run.ExitCode(), 0) << run.err;
  ExpectSelfContained(ReadBytes(output));
}

TEST_F(ReportTest, WrongInputIsOneLine) {
  const std::string output = folder_.File("report.html");
  const std::string arguments = "adasfm_reporter --output_path " + output +
                                " --input_path " + folder_.File("sparse/0");
  ExpectError(
      "adasfm_reporter --output_path " + output + " --input_path /nowhere",
      "/nowhere");
  for (const char* option :
       {"coarse_path", "database_path", "ground_truth_path"}) {
    ExpectError(arguments + " --" + option + " /nowhere", "/nowhere");
  }
  ExpectError(arguments + " --max_num_points -1", "max_num_points = -1");
  ExpectError(arguments + " --max_time_gap_s -1", "max_time_gap_s");
  ExpectError(arguments + " --max_num_examples 51", "max_num_examples = 51");
  ExpectError(
      arguments + " --database_path " + database_ + " --image_path /nowhere",
      "/nowhere");
  EXPECT_FALSE(std::filesystem::exists(output));
  ExpectError(
      "adasfm_reporter --output_path /nowhere/report.html "
      "--input_path " +
          folder_.File("sparse/0"),
      "/nowhere/report.html");
}

TEST(ReportScene, PriorsWithoutErrorFollowTheModel) {
  for (const uint64_t seed : {1, 2, 3}) {
    SyntheticWorldOptions options;
    options.seed = seed;
    options.num_images = 30;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    const colmap::Reconstruction model = MakeModel(world, 1, 0.0);
    SyntheticPriorOptions exact;
    exact.rotation_sigma_rad = exact.translation_sigma_m = 0.0;
    PriorTables tables;
    tables.priors = BuildSyntheticScene(world, exact).priors;
    // Without its length the motion from the 11th image to the next is open.
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

TEST(ReportScene, TheTruthComesIntoTheModelsWorld) {
  for (const uint64_t seed : {1, 2, 3}) {
    SyntheticWorldOptions options;
    options.seed = seed;
    options.num_images = 30;
    const SyntheticWorld world = BuildSyntheticWorld(options);
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
        // A model in metres does not get a wrong scale forgiven.
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
