// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report/report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/database/two_view_geometry_backup.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "colmap_ext/host/database.h"
#include "colmap_ext/report/report_html.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/colmap_ext/report_model.h"
#include "tests/testing/colmap_ext/synthetic_scene.h"

namespace adasfm {
namespace {

constexpr char kHostileName[] = "</script><b>&\"'.png";

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

// The page without the contents of its scripts.
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
                                                  "\tcontradicts odometry"
                                                  "\nno such images\n");
  }

  void WriteSummaries() {
    folder_.Write("global/summary.json",
                  R"({"steps": [{"name": "loop gating", "seconds": 1.5,
                      "summary": "5 <pairs> tested"}],
                      "warnings": ["positions did not converge"]})");
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
        "0.000 m", "7.2 s", "5 &lt;pairs&gt; tested", "<tr class=\"warning\">",
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

TEST_F(ReportTest, NamesModelsLostImagesAndWeakPlaces) {
  folder_.Write(
      "global/summary.json",
      "{\"weak_places\": [{\"model1\": 0, \"model2\": 1, \"pairs\": 4, "
      "\"inliers\": 31, \"reason\": \"unverified join\", \"name1\": \"" +
          world_.images[2].name + "\", \"name2\": \"" + world_.images[5].name +
          "\"}], \"models\": [{\"unconfirmed_closures\": [{\"pairs\": 3, "
          "\"images\": 12, \"name1\": \"a\", \"name2\": \"b\"}]}]}");
  folder_.Write("sparse/summary.json",
                R"({"models": [
                      {"coarse_model": 1, "num_images": 25, "is_metric": true,
                       "verdict": {"line": "Verdict: good"}},
                      {"coarse_model": 0, "num_images": 7,
                       "verdict": {"line": "Verdict: failed"}}],
                    "images_in_no_model": [
                      {"name": "x<1>.png", "reason": "lost in the dark"},
                      {"name": "x2.png", "reason": "lost in the dark"}]})");
  const StatusOr<std::string> page = BuildReport(AllInputs());
  ASSERT_TRUE(page.ok()) << page.status().message();
  ExpectSelfContained(*page);
  for (const std::string text :
       {"Verdict: failed", "lost in the dark</th><td>2</td>",
        "x&lt;1&gt;.png, x2.png",
        "between the coarse models 0 and 1: 4 pairs, not used (unverified",
        "3 pairs, which alone hold 12 images"}) {
    EXPECT_NE(page->find(text), std::string::npos) << text;
  }
}

TEST_F(ReportTest, DrawsMatchesOnPhotos) {
  ReportOptions options = AllInputs();
  options.image_path = folder_.File("photos");
  // Any picture will do: OpenCV goes by the content and not by the name.
  std::filesystem::create_directories(options.image_path);
  for (const SyntheticImage& image : world_.images) {
    const std::filesystem::path path = folder_.File("photos/" + image.name);
    std::filesystem::create_directories(path.parent_path());
    folder_.Write("photos/" + image.name,
                  "P6 8 5 255\n" + std::string(8 * 5 * 3, '\x60'));
  }
  const StatusOr<std::string> page = BuildReport(options);
  ASSERT_TRUE(page.ok()) << page.status().message();
  ExpectSelfContained(*page);
  // One removed pair and four kept ones.
  EXPECT_EQ(Count(*page, "data:image/jpeg"), 5);
  SqliteConnection database(database_, SqliteConnection::Mode::kRead);
  const size_t num_inliers =
      ReadMatchesOfPair(&database, kTwoViewGeometryBackupTable, removed_)
          .size();
  EXPECT_NE(page->find(std::to_string(num_inliers) + " inliers, all removed"),
            std::string::npos);
  EXPECT_EQ(Count(*page, "<path class=\"kept\""), 4);
  EXPECT_EQ(*page, *BuildReport(options));

  // Truncated or missing photos are counted, and the page is made nevertheless.
  for (const SyntheticImage& image : world_.images) {
    folder_.Write("photos/" + image.name, "P6 8");
  }
  const StatusOr<std::string> without = BuildReport(options);
  ASSERT_TRUE(without.ok()) << without.status().message();
  ExpectSelfContained(*without);
  EXPECT_NE(without->find("5 of the pairs on photos"), std::string::npos);
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
  const StatusOr<std::string> page = BuildReport(options);
  ASSERT_TRUE(page.ok()) << page.status().message();
  ExpectSelfContained(*page);
  for (const char* note :
       {"no --coarse_path", "no --database_path", "no --ground_truth_path"}) {
    EXPECT_NE(page->find(note), std::string::npos) << note;
  }
  const nlohmann::json data = DataOf(*page);
  EXPECT_EQ(data["unit"], "units");
  EXPECT_EQ(data["points"]["count"], 100);
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
  ExpectError(arguments + " --max_time_gap_s -1", "max_time_gap_s");
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

}  // namespace
}  // namespace adasfm
