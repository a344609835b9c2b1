// SPDX-License-Identifier: BSD-3-Clause
// adasfm_prior_importer with --trajectory_path as a user calls it, on a
// synthetic database.

#include <iomanip>
#include <sstream>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/evaluation/evaluation.h"
#include "sensors/io/read_image_times.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

constexpr int kNumImages = 20;

class TrajectoryTest : public CommandLineTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(Call("adasfm_synthesizer --num_images 20 --output_path " +
                   folder_.Path())
                  .ExitCode(),
              0);
    truth_ = ReadGroundTruth(folder_.File("gt.txt"), {}, {}).value();
    ASSERT_EQ(truth_.size(), kNumImages);
  }

  std::string Import(const std::string& path) const {
    return "adasfm_prior_importer --database_path " +
           folder_.File("database.db") + " --trajectory_path " + path;
  }

  // The trajectory of the camera: world_from_cam at the images' times.
  std::string WriteTum() const {
    std::ostringstream text;
    text << std::setprecision(17);
    for (const auto& [name, cam_from_world] : truth_) {
      timestamp_t time_ns = 0;
      EXPECT_TRUE(ParseImageNameTime(name, &time_ns));
      const Rigid3d pose = cam_from_world.Inverse();
      text << time_ns << " " << pose.translation.transpose() << " "
           << pose.rotation.coeffs().transpose() << "\n";
    }
    return folder_.Write("trajectory.txt", text.str());
  }

  std::string WriteModel() const {
    std::ostringstream images;
    images << std::setprecision(17);
    int id = 100;  // ids are not those of the database
    for (const auto& [name, cam_from_world] : truth_) {
      const Eigen::Quaterniond& q = cam_from_world.rotation;
      const Eigen::Vector3d& t = cam_from_world.translation;
      images << ++id << " " << q.w() << " " << q.x() << " " << q.y() << " "
             << q.z() << " " << t.x() << " " << t.y() << " " << t.z() << " 1 "
             << name << "\n\n";
    }
    folder_.Write("cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n");
    folder_.Write("images.txt", images.str());
    folder_.Write("points3D.txt", "");
    return folder_.Path();
  }

  void ExpectTrueMotions() {
    const auto read = ReadPriorTables(folder_.File("database.db"));
    ASSERT_TRUE(read.ok()) << read.status().message();
    const PriorTables& tables = read->tables;
    ASSERT_EQ(tables.priors.size(), kNumImages - 1);
    auto second = truth_.begin();  // in the order of time, as the names are
    auto first = second++;
    for (const RelativePosePrior& prior : tables.priors) {
      const Rigid3d motion = ComputeCam2FromCam1(first->second, second->second);
      EXPECT_LT((prior.cam2_from_cam1.translation - motion.translation).norm(),
                1e-6);
      EXPECT_LT(prior.cam2_from_cam1.rotation.angularDistance(motion.rotation),
                1e-6);
      EXPECT_TRUE(prior.HasLength());
      first = second++;
    }
  }

  NamedPoses truth_;
};

TEST_F(TrajectoryTest, ATumFileAndAModelGiveTheMotionsBetweenImages) {
  for (const std::string& path : {WriteTum(), WriteModel()}) {
    SCOPED_TRACE(path);
    const Run run = Call(Import(path));
    ASSERT_EQ(run.ExitCode(), 0) << run.err;
    EXPECT_NE(run.out.find("20 with times, 20 inside the logs"),
              std::string::npos)
        << run.out;
    ExpectTrueMotions();
  }
}

TEST_F(TrajectoryTest, WhatIsWrongIsSaidInOneLine) {
  const std::string path = WriteTum();
  ExpectError(Import(path) + " --imu_path " + folder_.File("imu.csv"),
              "of type odometry");
  ExpectError(Import(path) + " --AdaSfmTrajectory.sigma_m_per_m 0",
              "sigma_m_per_m");
  ExpectError(Import(folder_.Write("other_day.txt",
                                   "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")),
              "gives poses to 0 of 20 images");
  ExpectError(Import(folder_.File("none.txt")), "none.txt");
  ExpectError("adasfm_prior_importer --database_path " +
                  folder_.File("database.db") + " --imu_path " +
                  folder_.File("imu.csv"),
              "--sensors_path");
}

}  // namespace
}  // namespace adasfm
