// SPDX-License-Identifier: BSD-3-Clause
// The commands as a user calls them.

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "colmap_ext/commands/registry.h"
#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/datasets/write_synthetic_world.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/paths.h"

namespace adasfm {
namespace {

TEST_F(CommandLineTest, HandsOtherCommandsOver) {
  const std::string host =
      "ADASFM_HOST_COLMAP=" + WriteScript("printf '<%s>' \"$@\"\nexit 37\n");
  const Run run = Call("mapper --image_path 'a b' '' --x=1", host);
  EXPECT_EQ(run.ExitCode(), 37);
  EXPECT_EQ(run.out, "<mapper><--image_path><a b><><--x=1>");
}

TEST_F(CommandLineTest, SignalsPass) {
  const std::string host =
      "exec env ADASFM_HOST_COLMAP=" + WriteScript("kill -TERM $$\n");
  const Run run = Call("mapper", host);
  ASSERT_TRUE(WIFSIGNALED(run.status));
  EXPECT_EQ(WTERMSIG(run.status), SIGTERM);
}

// Under a limit of address space our own commands have one OpenMP thread, but
// the host has the user's number.
TEST_F(CommandLineTest, TheHostHasTheUsersThreads) {
  const std::string host = "ulimit -v 4000000; ADASFM_HOST_COLMAP=" +
                           WriteScript("env | grep -o 'OMP_NUM_THREADS=.*'\n");
  EXPECT_EQ(Call("mapper", "unset OMP_NUM_THREADS; " + host).out, "");
  EXPECT_EQ(Call("mapper", host + " OMP_NUM_THREADS=7").out,
            "OMP_NUM_THREADS=7\n");
}

TEST_F(CommandLineTest, TheHostRuns) {
  const Run run = Call("mapper");
  EXPECT_EQ(run.ExitCode(), 1);
  EXPECT_NE(run.err.find("--database_path"), std::string::npos);
}

TEST_F(CommandLineTest, HostThatCannotRun) {
  ExpectError("mapper", "is not an executable file",
              "ADASFM_HOST_COLMAP=/nowhere/colmap");
  ExpectError("mapper", "is not an executable file",
              "ADASFM_HOST_COLMAP=" + folder_.Write("text", "x"));
  ExpectError("mapper", "is this program",
              std::string("ADASFM_HOST_COLMAP=") + LauncherPath());
}

TEST_F(CommandLineTest, VersionNamesLibraryAndHost) {
  const Run own = Call("adasfm_version");
  EXPECT_EQ(own.ExitCode(), 0);
  EXPECT_NE(own.out.find("Library: COLMAP 3.8"), std::string::npos) << own.out;
  const std::string host =
      WriteScript("echo 'COLMAP 4.2.1 (Commit Unknown)'\n");
  const Run other = Call("adasfm_version", "ADASFM_HOST_COLMAP=" + host);
  EXPECT_NE(other.out.find("Host:    COLMAP 4.2.1 (" + host + ")"),
            std::string::npos)
      << other.out;
  const Run none = Call("adasfm_version", "ADASFM_HOST_COLMAP=/nowhere/colmap");
  EXPECT_EQ(none.ExitCode(), 0);
  EXPECT_NE(none.out.find("/nowhere/colmap is no program"), std::string::npos);
}

TEST_F(CommandLineTest, WarnsBeforeTheHostSpoilsADatabase) {
  const std::string database = folder_.File("it's.db");
  const std::string quoted = "\"" + database + "\"";
  const auto warning = [&](const std::string& version,
                           const std::string& arguments) {
    const std::string host =
        WriteScript("echo 'COLMAP " + version + " -- Structure'\n");
    return Call("mapper " + arguments, "ADASFM_HOST_COLMAP=" + host).err;
  };
  const std::string given = "--database_path " + quoted;
  EXPECT_EQ(warning("3.8", given), "");  // no file yet
  ASSERT_EQ(
      Call("adasfm_synthesizer --num_images 4 --output_path " + folder_.Path())
          .ExitCode(),
      0);
  std::filesystem::rename(folder_.File("database.db"), database);
  EXPECT_EQ(warning("3.8", given), "");

  const auto execute = [&](const std::string& sql) {
    SqliteConnection(database, SqliteConnection::Mode::kWrite).Execute(sql);
  };
  execute(
      "ALTER TABLE images DROP COLUMN prior_qw;"
      "CREATE TABLE pose_priors (image_id INTEGER, position BLOB);");
  for (const std::string& arguments :
       {given, "--image_path x --database_path=" + quoted}) {
    const std::string text = warning("3.8", arguments);
    EXPECT_EQ(text.rfind("WARNING: " + database, 0), 0) << text;
    EXPECT_NE(text.find("is of COLMAP 3.10 or later"), std::string::npos);
  }
  EXPECT_EQ(warning("3.10-dev", given), "");
  EXPECT_EQ(warning("3.13.0", given), "");
  EXPECT_NE(warning("4.2.1", given).find("ADD COLUMN position_covariance"),
            std::string::npos);
  execute("CREATE TABLE frames (frame_id INTEGER);");
  EXPECT_NE(warning("3.11", given).find("3.12 or later"), std::string::npos);
  execute(
      "ALTER TABLE pose_priors DROP COLUMN image_id;"
      "ALTER TABLE pose_priors ADD COLUMN corr_data_id INTEGER;");
  EXPECT_NE(warning("3.13", given).find("4.0 or later"), std::string::npos);
  EXPECT_EQ(warning("4.2.1", given), "");
}

TEST_F(CommandLineTest, HelpListsBoth) {
  for (const char* arguments : {"", "help", "-h", "--help"}) {
    const Run run = Call(arguments);
    EXPECT_EQ(run.ExitCode(), 0);
    EXPECT_NE(run.out.find("  exhaustive_matcher\n"), std::string::npos);
    for (const Command& command : Commands()) {
      EXPECT_NE(run.out.find(std::string("  ") + command.name),
                std::string::npos);
    }
  }
}

TEST_F(CommandLineTest, EveryCommandExplainsItself) {
  for (const Command& command : Commands()) {
    const Run run = Call(std::string(command.name) + " -h");
    EXPECT_EQ(run.ExitCode(), 0) << command.name;
    EXPECT_NE(run.out.find("_path"), std::string::npos) << command.name;
    EXPECT_NE(run.out.find("--log_level"), std::string::npos) << command.name;
    ExpectError(std::string(command.name) + " --no_such_option 1",
                "no_such_option");
    // The only command without required options.
    if (std::string(command.name) == "adasfm_version") continue;
    ExpectError(command.name, "required but missing");
  }
}

TEST_F(CommandLineTest, UnknownCommand) {
  ExpectError("adasfm_mappper", "unknown command `adasfm_mappper`");
}

TEST_F(CommandLineTest, ProjectFile) {
  ExpectError("adasfm_restorer --project_path " + folder_.File("none.ini"),
              "none.ini");
  // The file gives the database; another command's option is passed over.
  const std::string project = folder_.Write(
      "project.ini", "database_path=" + folder_.File("from_file.db") +
                         "\n[SiftExtraction]\nmax_num_features=9\n");
  ExpectError("adasfm_restorer --project_path " + project, "from_file.db");
  ExpectError("adasfm_restorer --project_path " +
                  folder_.Write("windows.ini",
                                "\xEF\xBB\xBF"
                                "database_path=windows.db\n"),
              "windows.db");
  ExpectError("adasfm_restorer --project_path " + project +
                  " --database_path " + folder_.File("from_line.db"),
              "from_line.db");
  ExpectError("adasfm_prior_importer --project_path " +
                  folder_.Write("typo.ini", "[AdaSfmPriors]\nmax_typo_s=9\n"),
              "AdaSfmPriors.max_typo_s");
}

// A synthetic world on disk, and importer calls on it.
class ImporterTest : public CommandLineTest {
 protected:
  ImporterTest() {
    SyntheticWorldOptions options;
    options.num_images = 25;
    options.num_keypoints_per_image = 60;
    const SyntheticWorld world = BuildSyntheticWorld(options);
    EXPECT_TRUE(WriteSyntheticDatabase(world, database_).ok());
    EXPECT_TRUE(WriteSyntheticLogs(world, folder_.Path()).ok());
  }

  // The importer's arguments, with one file of the set replaced.
  std::string Arguments(const std::string& option = "",
                        const std::string& path = "") {
    std::string arguments = "adasfm_prior_importer";
    const std::pair<std::string, std::string> files[] = {
        {"database_path", database_},
        {"image_times_path", folder_.File("times.csv")},
        {"imu_path", folder_.File("imu.csv")},
        {"wheel_path", folder_.File("wheel.csv")},
        {"sensors_path", folder_.File("sensors.yaml")}};
    for (const auto& [name, file] : files) {
      arguments += " --" + name + " " + (name == option ? path : file);
    }
    return arguments;
  }

  void ExpectRefused(const std::string& arguments, const std::string& message) {
    const std::string before = ReadBytes(database_);
    ExpectError(arguments, message);
    EXPECT_EQ(ReadBytes(database_), before) << arguments;
    EXPECT_FALSE(std::filesystem::exists(database_ + ".priors.json"));
  }

  std::string database_ = folder_.File("database.db");
};

TEST_F(ImporterTest, WritesTablesAndSummary) {
  const Run run = Call(Arguments());
  ASSERT_EQ(run.ExitCode(), 0) << run.err;
  const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(database_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  EXPECT_EQ(loaded->tables.image_times.size(), 25);
  EXPECT_EQ(loaded->tables.priors.size(), 24);
  const nlohmann::json summary =
      nlohmann::json::parse(ReadBytes(database_ + ".priors.json"));
  EXPECT_EQ(summary["num_priors"], 24);
  EXPECT_EQ(summary["num_images"], 25);
  // A second import gives the same summary, except for the time it takes.
  ASSERT_EQ(Call(Arguments()).ExitCode(), 0);
  nlohmann::json again =
      nlohmann::json::parse(ReadBytes(database_ + ".priors.json"));
  again["seconds"] = summary["seconds"];
  EXPECT_EQ(again, summary);
  EXPECT_EQ(ReadPriorTables(database_)->tables.priors.size(), 24);
}

TEST_F(ImporterTest, NamesHoldTheTimes) {
  ASSERT_EQ(Call(Arguments("image_times_path", "''")).ExitCode(), 0);
  EXPECT_EQ(ReadPriorTables(database_)->tables.priors.size(), 24);
}

TEST_F(ImporterTest, EitherSensorAlone) {
  ASSERT_EQ(Call(Arguments("wheel_path", "''")).ExitCode(), 0);
  StatusOr<LoadedPriorTables> loaded = ReadPriorTables(database_);
  for (const RelativePosePrior& prior : loaded->tables.priors) {
    EXPECT_TRUE(prior.HasRotation());
    EXPECT_FALSE(prior.HasLength());
  }
  const Run wheels_alone = Call(Arguments("imu_path", "''"));
  ASSERT_EQ(wheels_alone.ExitCode(), 0);
  // The rotation error of wheels alone is unknown.
  EXPECT_NE(wheels_alone.out.find("m per 100 m"), std::string::npos);
  EXPECT_EQ(wheels_alone.out.find("deg per 100 m"), std::string::npos);
  loaded = ReadPriorTables(database_);
  ASSERT_FALSE(loaded->tables.priors.empty());
  for (const RelativePosePrior& prior : loaded->tables.priors) {
    EXPECT_TRUE(prior.HasLength());
  }
  EXPECT_TRUE(loaded->tables.gravity.empty());
}

TEST_F(ImporterTest, MissingAndEmptyFiles) {
  const std::string empty = folder_.Write("empty", "");
  for (const char* option :
       {"image_times_path", "imu_path", "wheel_path", "sensors_path"}) {
    ExpectRefused(Arguments(option, folder_.File("missing")), "missing");
    ExpectRefused(Arguments(option, empty), "empty");
  }
  ExpectRefused(Arguments("database_path", folder_.File("missing.db")),
                "missing.db");
  ExpectRefused(Arguments("database_path", empty), "empty");
}

TEST_F(ImporterTest, WrongFiles) {
  ExpectRefused(
      Arguments("sensors_path", folder_.Write("bad.yaml", "cam0: [1, {")),
      "bad.yaml");
  ExpectRefused(Arguments("database_path", folder_.File("imu.csv")),
                "not a database");
  ExpectRefused(Arguments("imu_path", folder_.File("sensors.yaml")),
                "sensors.yaml");
  ExpectRefused(Arguments("imu_path", "'' --wheel_path ''"), "");
}

TEST_F(ImporterTest, NoImageNameInCommon) {
  ExpectRefused(Arguments("image_times_path",
                          folder_.Write("other.csv",
                                        "#timestamp [ns],filename\n"
                                        "1600000003000000000,other.png\n")),
                "other.png");
}

TEST_F(ImporterTest, SomeUnknownNamesAreAWarning) {
  std::ofstream(folder_.File("times.csv"), std::ios::app)
      << "1900000000000000000,later.png\n";
  const Run run = Call(Arguments());
  EXPECT_EQ(run.ExitCode(), 0) << run.err;
  EXPECT_NE(run.out.find("later.png"), std::string::npos);
  EXPECT_EQ(ReadPriorTables(database_)->tables.priors.size(), 24);
}

TEST_F(ImporterTest, TimesThatDoNotOverlap) {
  std::ifstream file(folder_.File("times.csv"));
  std::string line;
  std::string shifted;
  while (std::getline(file, line)) {
    // A year later.
    if (!line.empty() && line[0] == '1') line.replace(0, 3, "163");
    shifted += line + "\n";
  }
  ExpectRefused(
      Arguments("image_times_path", folder_.Write("shifted.csv", shifted)),
      "clocks");
}

TEST_F(ImporterTest, SummaryThatCannotBeWritten) {
  // Below a regular file not even root can write.
  ExpectRefused(Arguments() + " --summary_path " + folder_.File("imu.csv") +
                    "/summary.json",
                "imu.csv/summary.json");
}

TEST_F(ImporterTest, InvalidOptions) {
  ExpectRefused(Arguments() + " --AdaSfmPriors.max_imu_gap_s -1",
                "AdaSfmPriors.max_imu_gap_s");
  ExpectRefused(Arguments() + " --AdaSfmPriors.estimate_time_shift 2",
                "AdaSfmPriors.estimate_time_shift");
  ExpectRefused(Arguments() + " --AdaSfmPriors.max_imu_gap_s abc",
                "AdaSfmPriors.max_imu_gap_s");
}

TEST_F(ImporterTest, EvaluatorAndRestorerOnWrongInput) {
  const std::string truth = " --ground_truth_path " + folder_.File("gt.txt");
  ExpectError("adasfm_evaluator --input_path " + folder_.File("none") + truth,
              "no COLMAP model");
  const std::string model = folder_.File("model");
  std::filesystem::create_directory(model);
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    folder_.Write(std::string("model/") + name, "\x05");
  }
  ExpectError("adasfm_evaluator --input_path " + model + truth, "cameras.bin");
  const std::string before = ReadBytes(database_);
  EXPECT_EQ(Call("adasfm_restorer --database_path " + database_).ExitCode(), 0);
  EXPECT_EQ(ReadBytes(database_), before);
  ExpectError("adasfm_restorer --database_path " + folder_.File("gt.txt"),
              "not a database");
}

}  // namespace
}  // namespace adasfm
