// SPDX-License-Identifier: BSD-3-Clause
// The chain of commands, killed at random moments and run again.

#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>
#include <thread>

#include "core/random.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/paths.h"

namespace adasfm {
namespace {

// More kills than the few that every test run can afford:
// ADASFM_NUM_KILLS=50 test_end_to_end --gtest_filter='KillTest.*'
int NumKills() {
  const char* text = std::getenv("ADASFM_NUM_KILLS");
  return text == nullptr ? 4 : std::stoi(text);
}

class KillTest : public CommandLineTest {
 protected:
  // Makes a world and a script of the chain. `mapper_input` is a path in $OUT.
  void Prepare(const std::string& world, const std::string& importer,
               const std::string& mapper_input) {
    const Run run = Call("adasfm_synthesizer --num_keypoints 150 " + world +
                         " --output_path " + folder_.Path());
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
    // One thread: the same sums, so the same bits.
    const std::string sh =
        "set -e\n"
        "adasfm() { $LAUNCHER \"$@\" > \"$OUT/log\" 2>&1; }\n"
        "adasfm adasfm_prior_importer --database_path $OUT/database.db "
        "--image_times_path $IN/times.csv --imu_path $IN/imu.csv "
        "--sensors_path $IN/sensors.yaml " +
        importer +
        "\n"
        "adasfm adasfm_global --database_path $OUT/database.db "
        "--output_path $OUT/global --AdaSfmGlobal.num_threads 1\n"
        "adasfm adasfm_mapper --database_path $OUT/database.db "
        "--input_path $OUT/" +
        mapper_input +
        " --output_path $OUT/sparse "
        "--num_threads 1 --AdaSfmPartition.max_part_size 20 "
        "--AdaSfmPartition.max_num_images_undivided 20\n";
    script_ = folder_.Write("chain.sh", sh);
  }

  // An empty folder with the database as it was made.
  std::string NewRun(const std::string& name) {
    const std::string path = folder_.File(name);
    std::filesystem::create_directories(path);
    std::filesystem::copy_file(folder_.File("database.db"),
                               path + "/database.db");
    return path;
  }

  // The whole chain, as a process group of its own.
  pid_t Start(const std::string& path) {
    const pid_t child = fork();
    if (child != 0) {
      setpgid(child, child);
      return child;
    }
    setpgid(0, 0);
    setenv("LAUNCHER", LauncherPath().c_str(), 1);
    setenv("IN", folder_.Path().c_str(), 1);
    setenv("OUT", path.c_str(), 1);
    execl("/bin/sh", "sh", script_.c_str(), nullptr);
    _exit(2);
  }

  void Finish(const std::string& path) {
    int status = 0;
    waitpid(Start(path), &status, 0);
    ASSERT_EQ(status, 0) << ReadBytes(path + "/log");
  }

  std::string Sqlite(const std::string& path, const std::string& statement) {
    const std::string out = folder_.File("sqlite_out");
    // A program that the killed shell ran may still be exiting, with its lock.
    EXPECT_EQ(std::system(("sqlite3 -cmd '.timeout 10000' " + path +
                           "/database.db \"" + statement + "\" > " + out)
                              .c_str()),
              0);
    return ReadBytes(out);
  }

  void KillAndCompare(int num_models);

  std::string script_;
};

// Kills the chain at random times and runs it again: the database and the
// models must equal those of an undisturbed run.
void KillTest::KillAndCompare(int num_models) {
  const std::string expected = NewRun("undisturbed");
  const auto start = std::chrono::steady_clock::now();
  ASSERT_NO_FATAL_FAILURE(Finish(expected));
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
          .count();
  const std::string expected_database = Sqlite(expected, ".dump");
  Random random(5);
  int num_killed = 0;
  for (int trial = 0; trial < NumKills(); ++trial) {
    const std::string path = NewRun("killed");
    const pid_t child = Start(path);
    std::this_thread::sleep_for(
        std::chrono::duration<double>(random.Uniform(0.0, seconds)));
    ::kill(-child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    num_killed += WIFSIGNALED(status);
    EXPECT_EQ(Sqlite(path, "PRAGMA integrity_check"), "ok\n");
    ASSERT_NO_FATAL_FAILURE(Finish(path));
    for (int k = 0; k < num_models; ++k) {
      for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
        const std::string file = "/sparse/" + std::to_string(k) + "/" + name;
        EXPECT_EQ(ReadBytes(path + file), ReadBytes(expected + file)) << trial;
        EXPECT_FALSE(ReadBytes(path + file).empty()) << file;
      }
    }
    EXPECT_FALSE(std::filesystem::exists(path + "/sparse/" +
                                         std::to_string(num_models)));
    EXPECT_EQ(Sqlite(path, ".dump"), expected_database) << trial;
    std::filesystem::remove_all(path);
  }
  std::cout << num_killed << " runs killed, of " << seconds << " s each\n";
}

TEST_F(KillTest, EndsInTheSameModelWithTheDatabaseIntact) {
  ASSERT_NO_FATAL_FAILURE(Prepare("--num_images 40 --seed 5",
                                  "--wheel_path $IN/wheel.csv", "global/0"));
  KillAndCompare(1);
}

// Without wheels nothing connects the two sides of a dark gap.
TEST_F(KillTest, EndsInTheSameModelsOfSeveralComponents) {
  ASSERT_NO_FATAL_FAILURE(
      Prepare("--num_images 60 --seed 5 --num_blackouts 1 --blackout_images 14",
              "", "global"));
  KillAndCompare(2);
}

}  // namespace
}  // namespace adasfm
