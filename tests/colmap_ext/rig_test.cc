// SPDX-License-Identifier: BSD-3-Clause
// A stereo rig as a user has it: its calibration in sensors.yaml, or the host's
// own rig in the database.

#include <cmath>
#include <cstring>
#include <filesystem>

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

class RigTest : public CommandLineTest {
 protected:
  void Synthesize(int num_frames) {
    num_frames_ = num_frames;
    Run run =
        Call("adasfm_synthesizer --num_images " + std::to_string(num_frames) +
             " --stereo_baseline 0.5 --num_neighbors 4 --seed 3 "
             "--output_path " +
             folder_.Path());
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
  }

  void Import(const std::string& logs) {
    Run run = Call("adasfm_prior_importer --database_path " + database_ +
                   " --image_times_path " + folder_.File("times.csv") +
                   " --sensors_path " + folder_.File("sensors.yaml") + logs);
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
  }

  void Reconstruct(const std::string& output = "model") {
    coarse_ = folder_.File(output) + "/global/0";
    const std::string sparse = folder_.File(output) + "/sparse";
    Run run = Call("adasfm_global --database_path " + database_ +
                   " --output_path " + folder_.File(output) + "/global");
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
    run = Call("adasfm_mapper --database_path " + database_ + " --input_path " +
               coarse_ + " --output_path " + sparse);
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
    sparse_ = sparse + "/0";
    model_ = *ReadModel(sparse_);
    ASSERT_EQ(model_.NumRegImages(), 2 * num_frames_);
  }

  // Image k of cam0 and image k + num_frames_ of cam1 form a frame. Their
  // relative pose is the same in all frames.
  Rigid3d CamFromRig(image_t image_id) const {
    return ComputeCam2FromCam1(
        CamFromWorld(model_.Image(image_id)),
        CamFromWorld(model_.Image(image_id + num_frames_)));
  }
  void ExpectRigidFrames() const {
    for (int image_id = 2; image_id <= num_frames_; ++image_id) {
      EXPECT_LT(
          (CamFromRig(image_id).ToMatrix() - CamFromRig(1).ToMatrix()).norm(),
          1e-9);
    }
  }

  // Makes the focal length of the second camera `ratio` times too long and not
  // measured. Returns the parameters of the first camera, which is known.
  std::vector<double> MistakeSecondLens(double ratio) {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    std::vector<double> params;
    {
      SqliteStatement statement(
          &database, "SELECT params FROM cameras WHERE camera_id = 1");
      EXPECT_TRUE(statement.Step());
      params.resize(statement.NumBytes(0) / sizeof(double));
      std::memcpy(params.data(), statement.Blob(0), statement.NumBytes(0));
    }
    std::vector<double> mistaken = params;
    for (const size_t i : {0, 1}) mistaken.at(i) *= ratio;
    SqliteStatement statement(&database,
                              "UPDATE cameras SET params = ?, "
                              "prior_focal_length = 0 WHERE camera_id = 2");
    statement.BindBlob(1, mistaken.data(), mistaken.size() * sizeof(double));
    statement.Step();
    return params;
  }

  // The second camera's pose of the calibration, as COLMAP writes it.
  std::string SensorFromRig() {
    SqliteConnection database(database_, SqliteConnection::Mode::kRead);
    SqliteStatement statement(
        &database,
        "SELECT qvec, tvec FROM adasfm_rig_cameras WHERE camera_id = 2");
    EXPECT_TRUE(statement.Step());
    std::string bytes;
    for (int column : {0, 1}) {
      bytes.append(static_cast<const char*>(statement.Blob(column)),
                   statement.NumBytes(column));
    }
    return bytes;
  }

  // The ratio of estimated to true distances from the first image to the
  // others.
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
    for (int image_id = 2; image_id <= num_frames_; ++image_id) {
      sum += way(CamFromWorld(model_.Image(1)),
                 CamFromWorld(model_.Image(image_id)));
      sum_of_truth += way(true_pose(1), true_pose(image_id));
    }
    return sum / sum_of_truth;
  }

  std::string database_ = folder_.File("database.db");
  int num_frames_ = 0;
  std::string coarse_;
  std::string sparse_;
  colmap::Reconstruction model_;
};

TEST_F(RigTest, TheBaselineAloneGivesMetres) {
  Synthesize(40);
  Import("");
  Reconstruct();
  ExpectRigidFrames();
  EXPECT_NEAR(CamFromRig(1).translation.norm(), 0.5, 0.004);
  // The baseline is known to 2 mm of 0.5 m, or 0.4 %; vision adds some error.
  EXPECT_NEAR(Scale(), 1.0, 0.02);
  // COLMAP 3.12 and later read the rig: one, of two cameras.
  const std::string rigs = ReadBytes(sparse_ + "/rigs.bin");
  ASSERT_EQ(rigs.size(), 8u + 4 + 4 + 8 + 8 + 1 + 7 * 8);
  const std::string frames = ReadBytes(sparse_ + "/frames.bin");
  uint64_t num_frames = 0;
  ASSERT_GE(frames.size(), sizeof(num_frames));
  std::memcpy(&num_frames, frames.data(), sizeof(num_frames));
  EXPECT_EQ(num_frames, num_frames_);
}

TEST_F(RigTest, LogsMoveTheFrames) {
  Synthesize(40);
  Import(" --imu_path " + folder_.File("imu.csv") + " --wheel_path " +
         folder_.File("wheel.csv"));
  const StatusOr<LoadedPriorTables> loaded = ReadPriorTables(database_);
  ASSERT_TRUE(loaded.ok()) << loaded.status().message();
  EXPECT_EQ(loaded->tables.image_times.size(), 2 * num_frames_);
  EXPECT_EQ(loaded->tables.priors.size(), num_frames_ - 1);
  for (const RelativePosePrior& prior : loaded->tables.priors) {
    EXPECT_EQ(prior.image_id2, prior.image_id1 + 1);
  }
  Reconstruct();
  ExpectRigidFrames();
  EXPECT_NEAR(Scale(), 1.0, 0.01);
}

// Both lenses are the same, and one is known: its parameters stay exactly as
// they are, and the other lens is estimated.
TEST_F(RigTest, AnUnknownLensIsRefinedBesideAKnownOne) {
  Synthesize(40);
  const std::vector<double> known = MistakeSecondLens(1.1);
  Import(" --imu_path " + folder_.File("imu.csv") + " --wheel_path " +
         folder_.File("wheel.csv"));
  Reconstruct();
  for (const colmap::Reconstruction& model : {*ReadModel(coarse_), model_}) {
    EXPECT_EQ(ParamsOf(model.Camera(1)), known);
    EXPECT_NEAR(model.Camera(2).MeanFocalLength() / known[0], 1.0, 0.01);
  }
  ExpectRigidFrames();
}

// If a database has no rigs, the calibration defines the rig. COLMAP 3.12 and
// later have tables for it.
TEST_F(RigTest, AllFormsGiveTheSameModels) {
  Synthesize(12);
  const std::string world = database_;
  std::string pose;
  std::string coarse;
  std::map<image_t, Rigid3d> expected_poses;
  int num_forms = 0;
  for (const std::string& form : DatabaseForms()) {
    SCOPED_TRACE("COLMAP " + form);
    database_ = folder_.File("form.db");
    std::filesystem::copy_file(
        world, database_, std::filesystem::copy_options::overwrite_existing);
    ReshapeDatabase(database_, form);
    if (SqliteConnection(database_, SqliteConnection::Mode::kRead)
            .HasTable("rigs")) {
      ASSERT_FALSE(pose.empty());
      MakeStereoRig(database_, num_frames_, pose);
    } else {
      Import("");
    }
    // No blanks: the folder goes into a command line.
    ASSERT_NO_FATAL_FAILURE(
        Reconstruct("model-" + std::to_string(num_forms++)));
    ExpectRigidFrames();
    EXPECT_TRUE(std::filesystem::exists(sparse_ + "/rigs.bin"));
    const std::map<image_t, Rigid3d> poses = CamsFromWorld(model_);
    if (expected_poses.empty()) {
      pose = SensorFromRig();
      coarse = coarse_;
      expected_poses = poses;
    }
    for (const std::string file :
         {"cameras.bin", "images.bin", "points3D.bin"}) {
      EXPECT_EQ(ReadBytes(coarse_ + "/" + file), ReadBytes(coarse + "/" + file))
          << file;
    }
    for (const auto& [image_id, expected] : expected_poses) {
      const Rigid3d& found = poses.at(image_id);
      EXPECT_LT((found.translation - expected.translation).norm(), 1e-9);
      EXPECT_LT(found.rotation.angularDistance(expected.rotation), 1e-9);
    }
  }
}

// The host's own rig, of which only the frames are known.
TEST_F(RigTest, UnknownExtrinsicsAreEstimated) {
  Synthesize(40);
  ReshapeDatabase(database_, "4.2");
  MakeStereoRig(database_, num_frames_, "");
  Reconstruct();
  ExpectRigidFrames();
  const CameraRigs rigs = [&] {
    SqliteConnection database(database_, SqliteConnection::Mode::kRead);
    return ReadCameraRigs(&database);
  }();
  EXPECT_EQ(rigs.images.size(), 2 * num_frames_);
  // In the truth the second camera is to the right, rotated by half a degree.
  EXPECT_NEAR(CamFromRig(1).translation.normalized().x(), -1.0, 0.01);
  EXPECT_LT(Eigen::AngleAxisd(CamFromRig(1).rotation).angle(), 0.015);
  EXPECT_GT(Eigen::AngleAxisd(CamFromRig(1).rotation).angle(), 0.007);
}

}  // namespace
}  // namespace adasfm
