// SPDX-License-Identifier: BSD-3-Clause
// A stereo rig as a user has it: its calibration in sensors.yaml, or the host's
// own rig in the database.

#include <cmath>
#include <cstring>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/database/rig_table.h"
#include "colmap_ext/evaluation/evaluation.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/colmap_ext/reshape_database.h"

namespace adasfm {
namespace {

constexpr int kNumFrames = 40;

class RigTest : public CommandLineTest {
 protected:
  void Synthesize() {
    Run run =
        Call("adasfm_synthesizer --num_images " + std::to_string(kNumFrames) +
             " --stereo_baseline 0.5 --num_neighbors 4 --seed 3 "
             "--output_path " +
             folder_.Path());
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
  }

  void Import(const std::string& logs) {
    Run run = Call("adasfm_prior_importer --database_path " + Database() +
                   " --image_times_path " + folder_.File("times.csv") +
                   " --sensors_path " + folder_.File("sensors.yaml") + logs);
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
  }

  void Reconstruct() {
    Run run = Call("adasfm_global --database_path " + Database() +
                   " --output_path " + folder_.File("coarse"));
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
    run = Call("adasfm_mapper --database_path " + Database() +
               " --input_path " + folder_.File("coarse/0") + " --output_path " +
               folder_.File("sparse"));
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
    model_ = *ReadModel(folder_.File("sparse/0"));
    ASSERT_EQ(model_.NumRegImages(), 2 * kNumFrames);
  }

  // Image k of cam0 and k + kNumFrames of cam1 are a frame: their relative pose
  // is one and the same.
  Rigid3d Mount(image_t image_id) const {
    return ComputeCam2FromCam1(
        CamFromWorld(model_.Image(image_id)),
        CamFromWorld(model_.Image(image_id + kNumFrames)));
  }
  void ExpectRigidFrames() const {
    for (image_t image_id = 2; image_id <= kNumFrames; ++image_id) {
      EXPECT_LT((Mount(image_id).ToMatrix() - Mount(1).ToMatrix()).norm(),
                1e-9);
    }
  }

  // How many times too long the way from the first camera to each other one is.
  double Scale() const {
    const StatusOr<NamedPoses> truth =
        ReadGroundTruth(folder_.File("gt.txt"), {}, {});
    const auto way = [](const Rigid3d& first, const Rigid3d& pose) {
      return (pose.TargetOriginInSource() - first.TargetOriginInSource())
          .norm();
    };
    const auto true_pose = [&](image_t image_id) {
      return truth->at(model_.Image(image_id).Name());
    };
    double sum = 0.0;
    double sum_of_truth = 0.0;
    for (image_t image_id = 2; image_id <= kNumFrames; ++image_id) {
      sum += way(CamFromWorld(model_.Image(1)),
                 CamFromWorld(model_.Image(image_id)));
      sum_of_truth += way(true_pose(1), true_pose(image_id));
    }
    return sum / sum_of_truth;
  }

  std::string Database() const { return folder_.File("database.db"); }

  colmap::Reconstruction model_;
};

TEST_F(RigTest, TheBaselineAloneGivesMetres) {
  Synthesize();
  Import("");
  Reconstruct();
  ExpectRigidFrames();
  EXPECT_NEAR(Mount(1).translation.norm(), 0.5, 0.004);
  // The baseline's 2 mm of 0.5 m are 0.4 %, vision adds some.
  EXPECT_NEAR(Scale(), 1.0, 0.02);
  // COLMAP 3.12 and later read the rig: one, of two cameras.
  const std::string rigs = ReadBytes(folder_.File("sparse/0/rigs.bin"));
  ASSERT_EQ(rigs.size(), 8u + 4 + 4 + 8 + 8 + 1 + 7 * 8);
  const std::string frames = ReadBytes(folder_.File("sparse/0/frames.bin"));
  uint64_t num_frames = 0;
  ASSERT_GE(frames.size(), sizeof(num_frames));
  std::memcpy(&num_frames, frames.data(), sizeof(num_frames));
  EXPECT_EQ(num_frames, kNumFrames);
}

TEST_F(RigTest, LogsMoveTheFrames) {
  Synthesize();
  Import(" --imu_path " + folder_.File("imu.csv") + " --wheel_path " +
         folder_.File("wheel.csv"));
  const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(Database());
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  EXPECT_EQ(loaded->tables.image_times.size(), 2 * kNumFrames);
  EXPECT_EQ(loaded->tables.priors.size(), kNumFrames - 1);
  for (const RelativePosePrior& prior : loaded->tables.priors) {
    EXPECT_EQ(prior.image_id2, prior.image_id1 + 1);
  }
  Reconstruct();
  ExpectRigidFrames();
  EXPECT_NEAR(Scale(), 1.0, 0.01);
}

// The host's own rig, of which only the frames are known.
TEST_F(RigTest, AnUnknownMountIsEstimated) {
  Synthesize();
  ReshapeDatabase(Database(), "4.2");
  SqliteConnection(Database(), SqliteConnection::Mode::kWrite)
      .Execute(
          "INSERT INTO rig_sensors VALUES (1, 2, 0, NULL);"
          "UPDATE frame_data SET frame_id = data_id - 40 WHERE data_id > 40;"
          "DELETE FROM frames WHERE frame_id > 40;"
          "DELETE FROM rigs WHERE rig_id = 2;");
  Reconstruct();
  ExpectRigidFrames();
  const CameraRigs rigs = [&] {
    SqliteConnection database(Database(), SqliteConnection::Mode::kRead);
    return ReadCameraRigs(&database);
  }();
  EXPECT_EQ(rigs.images.size(), 2 * kNumFrames);
  // In the truth the second camera is to the right, turned by half a degree.
  EXPECT_NEAR(Mount(1).translation.normalized().x(), -1.0, 0.01);
  EXPECT_LT(Eigen::AngleAxisd(Mount(1).rotation).angle(), 0.015);
  EXPECT_GT(Eigen::AngleAxisd(Mount(1).rotation).angle(), 0.007);
}

}  // namespace
}  // namespace adasfm
