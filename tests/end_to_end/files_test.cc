// SPDX-License-Identifier: BSD-3-Clause
// What the commands do to files: foreign files are kept, damaged or unfinished
// ones are not used, and the last line states the quality of a model.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "colmap_ext/io/folder_lock.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class FilesTest : public CommandLineTest {
 protected:
  void SetUp() override {
    const Run world = Call("adasfm_synthesizer --num_images 40 --output_path " +
                           folder_.Path());
    ASSERT_EQ(world.ExitCode(), 0) << world.err;
    std::string arguments =
        "adasfm_prior_importer --database_path " + database_;
    for (const char* name : {"imu", "wheel", "sensors", "image_times"}) {
      const std::string file =
          std::string(name) == "image_times" ? "times" : name;
      arguments += std::string(" --") + name + "_path " +
                   folder_.File(file + (file == "sensors" ? ".yaml" : ".csv"));
    }
    importer_ = arguments;
    const Run import = Call(arguments);
    ASSERT_EQ(import.ExitCode(), 0) << import.err;
  }

  std::string Global(const std::string& output) {
    return "adasfm_global --database_path " + database_ + " --output_path " +
           folder_.File(output);
  }
  std::string Mapper(const std::string& output,
                     const std::string& input = "g/0") {
    return "adasfm_mapper --database_path " + database_ + " --input_path " +
           folder_.File(input) + " --output_path " + folder_.File(output);
  }
  void Execute(const std::string& sql) {
    SqliteConnection(database_, SqliteConnection::Mode::kWrite).Execute(sql);
  }
  nlohmann::json Verdict() {
    return nlohmann::json::parse(
        ReadBytes(folder_.File("m/summary.json")))["verdict"];
  }

  std::string database_ = folder_.File("database.db");
  std::string importer_;
};

TEST_F(FilesTest, VerdictClosesTheMapper) {
  ASSERT_EQ(Call(Global("g")).ExitCode(), 0);
  // The last step is in the summary, too.
  const nlohmann::json steps =
      nlohmann::json::parse(ReadBytes(folder_.File("g/summary.json")))["steps"];
  EXPECT_EQ(steps.back()["name"], "writing");
  const Run run = Call(Mapper("m"));
  ASSERT_EQ(run.ExitCode(), 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("\nVerdict: good. 40 of 40 images"));
  EXPECT_EQ(Verdict()["result"], "good");
  EXPECT_EQ(Verdict()["metric_source"], "wheels");
  // The wheel scale is known to 1 % beforehand, and better after the drive.
  EXPECT_GT(Verdict()["metric_sigma"], 0.0);
  EXPECT_LT(Verdict()["metric_sigma"], 0.01);
  EXPECT_THAT(run.out, HasSubstr("in metres from wheels (to 0."));
  // The report begins with the verdict, too.
  const Run report = Call("adasfm_reporter --input_path " + folder_.File("m") +
                          " --output_path " + folder_.File("report.html"));
  ASSERT_EQ(report.ExitCode(), 0) << report.err;
  EXPECT_THAT(ReadBytes(folder_.File("report.html")),
              HasSubstr("<p class=\"verdict good\" role=\"status\">Verdict: "
                        "good"));
}

TEST_F(FilesTest, WhoForgotTheMatcherIsToldSo) {
  ASSERT_EQ(Call(Global("g")).ExitCode(), 0);
  Execute("DELETE FROM two_view_geometries");
  Execute("DROP TABLE IF EXISTS adasfm_two_view_geometries");
  const std::string summary = ReadBytes(folder_.File("g/summary.json"));
  ExpectError(Global("g"), "no pair has enough verified ones");
  ExpectError(Mapper("m"), "no pair has enough verified ones");
  Execute("DELETE FROM matches");
  ExpectError(Global("g"), "run a matcher of COLMAP first");
  EXPECT_EQ(ReadBytes(folder_.File("g/summary.json")), summary);
}

TEST_F(FilesTest, LostImagesAreSaid) {
  Execute(
      "DELETE FROM two_view_geometries WHERE pair_id / 2147483647 > 25 OR "
      "pair_id % 2147483647 > 25");
  Execute("DELETE FROM adasfm_relative_pose_priors WHERE rowid > 24");
  const Run global = Call(Global("g"));
  ASSERT_EQ(global.ExitCode(), 0) << global.err;
  EXPECT_THAT(global.out, HasSubstr("15 of 40 images are in no model"));
  const Run mapper = Call(Mapper("m"));
  EXPECT_EQ(mapper.ExitCode(), 0) << mapper.err;
  EXPECT_EQ(Verdict()["result"], "doubtful");
  EXPECT_THAT(mapper.out, HasSubstr("15 of 40 images are lost"));
}

TEST_F(FilesTest, KeypointThatIsNoNumber) {
  // Two keypoints of image 5.
  const float nan = std::nanf("");
  std::string bytes;
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    SqliteStatement select(&database,
                           "SELECT data FROM keypoints WHERE image_id = 5");
    ASSERT_TRUE(select.Step());
    bytes.assign(static_cast<const char*>(select.Blob(0)), select.NumBytes(0));
  }
  for (int i = 0; i < 2; ++i) std::memcpy(&bytes[i * 24], &nan, sizeof(nan));
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    SqliteStatement update(&database,
                           "UPDATE keypoints SET data = ? WHERE image_id = 5");
    update.BindBlob(1, bytes.data(), bytes.size());
    update.Step();
  }
  const Run global = Call(Global("g"));
  ASSERT_EQ(global.ExitCode(), 0) << global.err;
  EXPECT_THAT(global.out, HasSubstr("keypoints are not numbers"));
  const Run mapper = Call(Mapper("m"));
  EXPECT_EQ(mapper.ExitCode(), 0) << mapper.err;
  EXPECT_EQ(Verdict()["num_images"], 40);
}

TEST_F(FilesTest, CameraThatIsNone) {
  Execute("UPDATE cameras SET params = zeroblob(32)");
  ExpectError(Global("g"), "parameters that no camera has");
}

TEST_F(FilesTest, ForeignFilesStay) {
  fs::create_directory(folder_.File("0"));
  const std::string photo = folder_.Write("0/photo.jpg", "x");
  ExpectError(Global("."), "/0/photo.jpg, which is no file of a model");
  EXPECT_EQ(ReadBytes(photo), "x");
  ASSERT_EQ(Call(Global("g")).ExitCode(), 0);
  fs::create_directories(folder_.File("m/checkpoints"));
  const std::string weights = folder_.Write("m/checkpoints/weights.pth", "x");
  ExpectError(Mapper("m"), weights);
  EXPECT_EQ(ReadBytes(weights), "x");
}

TEST_F(FilesTest, OutputsReplaceNoInputs) {
  const std::string before = ReadBytes(database_);
  ASSERT_EQ(Call(Global("g")).ExitCode(), 0);
  const std::string model = ReadBytes(folder_.File("g/0/images.bin"));
  ExpectError(Mapper("g"), "would be replaced");
  EXPECT_EQ(ReadBytes(folder_.File("g/0/images.bin")), model);
  const std::string after = ReadBytes(database_);
  ExpectError("adasfm_reporter --input_path " + folder_.File("g") +
                  " --database_path " + database_ + " --output_path " +
                  database_,
              "is the input --database_path");
  EXPECT_EQ(ReadBytes(database_), after);
  const std::string truth = ReadBytes(folder_.File("gt.txt"));
  ExpectError("adasfm_evaluator --input_path " + folder_.File("g") +
                  " --ground_truth_path " + folder_.File("gt.txt") +
                  " --json_path " + folder_.File("gt.txt"),
              "is the input --ground_truth_path");
  EXPECT_EQ(ReadBytes(folder_.File("gt.txt")), truth);
  ExpectError(importer_ + " --summary_path " + folder_.File("imu.csv"),
              "is the input --imu_path");
  // Without landmarks.txt the folder may be somebody's project, not a world.
  fs::remove(folder_.File("landmarks.txt"));
  ExpectError(
      "adasfm_synthesizer --num_images 5 --output_path " + folder_.Path(),
      "was not made by this command");
  EXPECT_EQ(ReadBytes(folder_.File("gt.txt")), truth);
}

TEST_F(FilesTest, SecondRunIsToldWhoHasTheFolder) {
  fs::create_directory(folder_.File("g"));
  const auto lock =
      FolderLock::Acquire(folder_.File("g"), FolderLock::Mode::kExclusive);
  ASSERT_TRUE(lock.ok());
  ExpectError(Global("g"), "process " + std::to_string(getpid()));
}

// Two commands at once would write one database file.
TEST_F(FilesTest, ASecondWorldKeepsOutOfTheFirstOnesFolder) {
  const std::string folder = folder_.File("world");
  std::filesystem::create_directory(folder);
  const auto held = FolderLock::Acquire(folder, FolderLock::Mode::kExclusive);
  ASSERT_TRUE(held.ok());
  ExpectError("adasfm_synthesizer --num_images 20 --output_path " + folder,
              "is in use by");
  EXPECT_FALSE(std::filesystem::exists(folder + "/database.db"));
}

// Existing models stay when the database cannot be written.
TEST_F(FilesTest, LockedDatabaseLeavesTheModels) {
  ASSERT_EQ(Call(Global("g")).ExitCode(), 0);
  const std::string summary = ReadBytes(folder_.File("g/summary.json"));
  SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
  const SqliteTransaction transaction(&database);
  ExpectError(Global("g"), "database is locked; nothing was written");
  EXPECT_EQ(ReadBytes(folder_.File("g/summary.json")), summary);
}

TEST_F(FilesTest, StrayWordsAndMisplacedOptions) {
  ExpectError(Global("g") + " extra", "'extra' is no option");
  ExpectError(Global("g") + " --project_path " + folder_.Path(),
              "cannot read the project file");
  ASSERT_EQ(Call(Global("g")).ExitCode(), 0);
  ExpectError(Mapper("m") + " --AdaSfmMapper.part_index 0",
              "--AdaSfmMapper.stage part only");
}

// With less address space libraries wait forever for memory.
TEST_F(FilesTest, TooLittleAddressSpace) {
  const auto error_under = [this](const std::string& limit) {
    const int status =
        std::system(("ulimit -v " + limit + LauncherPath() + " " + Global("g") +
                     " > " + folder_.File("out") + " 2> " + folder_.File("err"))
                        .c_str());
    EXPECT_NE(status, 0);
    return ReadBytes(folder_.File("err"));
  };
  const std::string error = "ERROR: the limit of address space (ulimit -v) is ";
  EXPECT_THAT(error_under("450000; "), HasSubstr(error + "450000 kB"));
  EXPECT_THAT(error_under("450000; OMP_NUM_THREADS=8 "),
              HasSubstr(error + "450000 kB"));
  EXPECT_THAT(error_under("350000; "), HasSubstr(error + "below"));
}

// The keypoints of a pinhole camera, said to be those of a fisheye.
TEST_F(FilesTest, WrongLensModelIsNamed) {
  std::vector<double> params(8, 0.0);
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    SqliteStatement read(&database, "SELECT params FROM cameras");
    ASSERT_TRUE(read.Step());
    ASSERT_EQ(read.NumBytes(0), 4 * sizeof(double));
    std::memcpy(params.data(), read.Blob(0), 4 * sizeof(double));
  }
  {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    SqliteStatement write(&database,
                          "UPDATE cameras SET model = 5, params = ?");
    write.BindBlob(1, params.data(), params.size() * sizeof(double));
    write.Step();
  }
  ASSERT_EQ(Call(importer_ + " --force 1").ExitCode(), 0);
  ASSERT_EQ(Call(Global("g")).ExitCode(), 0);
  const Run run = Call(Mapper("m"));
  EXPECT_THAT(
      run.out + run.err,
      HasSubstr("Verdict: doubtful: the lens model of camera 1 does not fit"));
}

TEST_F(FilesTest, WorldOnAFullDisk) {
  // Each size fails elsewhere: at a log, at the database.
  for (const char* blocks : {"8", "400", "1500"}) {
    const std::string world = folder_.File(std::string("world") + blocks);
    const int status = std::system(
        ("trap '' XFSZ; ulimit -f " + std::string(blocks) + "; " +
         LauncherPath() + " adasfm_synthesizer --num_images 60 --output_path " +
         world + " > " + folder_.File("out") + " 2> " + folder_.File("err"))
            .c_str());
    EXPECT_NE(status, 0) << blocks;
    EXPECT_THAT(ReadBytes(folder_.File("err")), HasSubstr("File too large"));
    EXPECT_FALSE(fs::exists(world + "/database.db"));
    EXPECT_FALSE(fs::exists(world + "/database.db.tmp"));
    EXPECT_FALSE(fs::exists(world + "/database.db.tmp-wal"));
  }
}

}  // namespace
}  // namespace adasfm
