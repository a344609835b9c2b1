// SPDX-License-Identifier: BSD-3-Clause
// What the importer makes of logs with errors, through its command.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "colmap_ext/database/prior_tables.h"
#include "core/so3.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

// A line of a log: the time, then the readings.
struct Row {
  int64_t time_ns = 0;
  std::vector<double> values;
};

class FaultyLogsTest : public CommandLineTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(Call("adasfm_synthesizer --output_path " + folder_.Path() +
                   " --num_images 60")
                  .ExitCode(),
              0);
  }

  std::string ImportArguments() const {
    return "adasfm_prior_importer --database_path " +
           folder_.File("database.db") + " --image_times_path " +
           folder_.File("times.csv") + " --imu_path " +
           folder_.File("imu.csv") + " --wheel_path " +
           folder_.File("wheel.csv") + " --sensors_path " +
           folder_.File("sensors.yaml");
  }

  // change gets the index of the data row; line numbers are two more.
  void ChangeLog(const std::string& name,
                 const std::function<void(size_t, Row*)>& change) {
    std::ifstream in(folder_.File(name));
    std::string line, text;
    std::getline(in, line);
    text = line + "\n";
    for (size_t i = 0; std::getline(in, line); ++i) {
      std::replace(line.begin(), line.end(), ',', ' ');
      std::istringstream fields(line);
      Row row;
      fields >> row.time_ns;
      for (double value; fields >> value;) row.values.push_back(value);
      change(i, &row);
      std::ostringstream out;
      out.precision(10);
      out << row.time_ns;
      for (const double value : row.values) out << "," << value;
      text += out.str() + "\n";
    }
    folder_.Write(name, text);
  }

  void ReplaceInCalibration(const std::string& from, const std::string& to) {
    std::string text = ReadBytes(folder_.File("sensors.yaml"));
    const size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos);
    folder_.Write("sensors.yaml", text.replace(at, from.size(), to));
  }

  std::vector<RelativePosePrior> Priors() const {
    const auto loaded = ReadPriorTables(folder_.File("database.db"));
    EXPECT_TRUE(loaded.ok());
    return loaded.ok() ? loaded->tables.priors
                       : std::vector<RelativePosePrior>();
  }

  // Expects priors within these bounds of those of the whole log.
  void ExpectNear(const std::vector<RelativePosePrior>& priors,
                  const std::vector<RelativePosePrior>& clean, double deg,
                  double metres) {
    ASSERT_EQ(priors.size(), clean.size());
    for (size_t i = 0; i < priors.size(); ++i) {
      const Rigid3d& a = priors[i].cam2_from_cam1;
      const Rigid3d& b = clean[i].cam2_from_cam1;
      EXPECT_LT(RadToDeg(a.rotation.angularDistance(b.rotation)), deg) << i;
      EXPECT_LT((a.translation - b.translation).norm(), metres) << i;
    }
  }
};

TEST_F(FaultyLogsTest, OneBadSampleIsNamedAndChangesNothing) {
  ASSERT_EQ(Call(ImportArguments()).ExitCode(), 0);
  const std::vector<RelativePosePrior> clean = Priors();
  ChangeLog("imu.csv", [](size_t i, Row* row) {
    if (i == 1500) row->values[2] = 17.0;
    if (i == 1800) row->values[4] = 10000.0;
  });
  const Run run = Call(ImportArguments());
  EXPECT_EQ(run.ExitCode(), 0) << run.err;
  EXPECT_NE(run.out.find("imu.csv, line 1502: 1 sample is a spike"),
            std::string::npos)
      << run.out;
  EXPECT_NE(run.out.find("imu.csv, line 1802: 1 sample is beyond"),
            std::string::npos);
  ExpectNear(Priors(), clean, 0.05, 0.01);
  const auto summary =
      nlohmann::json::parse(ReadBytes(folder_.File("database.db.priors.json")));
  ASSERT_EQ(summary["log_faults"].size(), 2u);
  EXPECT_EQ(summary["log_faults"][0]["kind"], "spike");
  EXPECT_EQ(summary["log_faults"][0]["first"], 1502);
}

TEST_F(FaultyLogsTest, ZerosAreNamedAndBridged) {
  ASSERT_EQ(Call(ImportArguments()).ExitCode(), 0);
  const std::vector<RelativePosePrior> clean = Priors();
  ChangeLog("imu.csv", [](size_t i, Row* row) {
    if (i >= 1500 && i < 1510) row->values.assign(6, 0.0);
  });
  const Run run = Call(ImportArguments());
  EXPECT_NE(run.out.find("lines 1502-1511: 10 samples are all zero"),
            std::string::npos)
      << run.out;
  ExpectNear(Priors(), clean, 0.5, 0.05);
}

TEST_F(FaultyLogsTest, ContradictingSensorsAreRefusedUnlessForced) {
  ChangeLog("imu.csv", [](size_t, Row* row) {
    for (int axis = 3; axis < 6; ++axis) row->values[axis] *= -1.0;
  });
  ExpectError(ImportArguments(), "the accelerometer has the other sign");
  const Run run = Call(ImportArguments() + " --force 1");
  EXPECT_EQ(run.ExitCode(), 0) << run.err;
  EXPECT_NE(run.out.find("the accelerometer has the other sign"),
            std::string::npos);
}

TEST_F(FaultyLogsTest, WheelsOfAnotherHourAreRefused) {
  ChangeLog("wheel.csv",
            [](size_t, Row* row) { row->time_ns += 3600'000'000'000; });
  ExpectError(ImportArguments(), "the wheel log covers no image");
}

TEST_F(FaultyLogsTest, KilometresPerHourAreRefused) {
  ChangeLog("wheel.csv", [](size_t, Row* row) {
    for (double& value : row->values) value *= 3.6;
  });
  ExpectError(ImportArguments(), "look like km/h");
}

TEST_F(FaultyLogsTest, ImpossibleNoiseFiguresAreRefused) {
  ReplaceInCalibration("speed_noise: 0.05", "speed_noise: 1e-200");
  ExpectError(ImportArguments(),
              "speed_noise is 1e-200 m/s; between 1e-05 and 20 is possible");
}

TEST_F(FaultyLogsTest, AnEstimateThatIsNotFiniteIsNotWritten) {
  ASSERT_EQ(Call(ImportArguments()).ExitCode(), 0);
  const std::vector<RelativePosePrior> before = Priors();
  const Run run =
      Call(ImportArguments() + " --AdaSfmPriors.gravity_m_s2 1e300");
  EXPECT_EQ(run.ExitCode(), 1) << run.out;
  ExpectNear(Priors(), before, 1e-9, 1e-12);
}

TEST_F(FaultyLogsTest, DamagedPriorsAreReplaced) {
  ASSERT_EQ(Call(ImportArguments()).ExitCode(), 0);
  SqliteConnection(folder_.File("database.db"), SqliteConnection::Mode::kWrite)
      .Execute(
          "UPDATE adasfm_relative_pose_priors SET tvec = zeroblob(24), "
          "qvec = zeroblob(32)");
  ASSERT_FALSE(ReadPriorTables(folder_.File("database.db")).ok());
  EXPECT_EQ(Call(ImportArguments()).ExitCode(), 0);
  EXPECT_EQ(Priors().size(), 59u);
}

}  // namespace
}  // namespace adasfm
