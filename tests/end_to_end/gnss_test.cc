// SPDX-License-Identifier: BSD-3-Clause
// From positions of GNSS to a georeferenced model, as a user calls it, on a
// synthetic drive.

#include <cmath>
#include <iomanip>
#include <map>
#include <sstream>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/evaluation/evaluation.h"
#include "colmap_ext/host/frame_files.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/io/folder_lock.h"
#include "colmap_ext/io/georeference_file.h"
#include "core/geodesy.h"
#include "core/random.h"
#include "core/sqlite.h"
#include "sensors/io/read_image_times.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

// Where the drive's world has its origin.
const GeodeticPosition kWorldOrigin{48.98, 8.39, 115.0};

class GnssTest : public CommandLineTest {
 protected:
  void Synthesize(uint64_t seed) {
    ASSERT_EQ(Call("adasfm_synthesizer --num_images 80 --seed " +
                   std::to_string(seed) + " --output_path " + folder_.Path())
                  .ExitCode(),
              0);
    truth_.clear();
    const StatusOr<NamedPoses> truth =
        ReadGroundTruth(folder_.File("gt.txt"), {}, {});
    ASSERT_TRUE(truth.ok()) << truth.status().message();
    for (const auto& [name, pose] : *truth) {
      truth_[name] = pose.TargetOriginInSource();
    }
    ASSERT_EQ(truth_.size(), 80u);
  }

  // A fix with a sigma of 0.3 m at every other image; the fixes of two seconds
  // jump by 15 m.
  std::string WriteGnss(uint64_t seed) const {
    Random random(seed);
    std::ostringstream text;
    text << std::setprecision(17)
         << "#timestamp [ns],latitude [deg],longitude [deg],altitude "
            "[m],sigma_horizontal [m],sigma_vertical [m]\n";
    const EnuFrame frame(kWorldOrigin);
    int index = 0;
    for (const auto& [name, center] : truth_) {
      timestamp_t time_ns = 0;
      EXPECT_TRUE(ParseImageNameTime(name, &time_ns));
      if (index++ % 2 == 1) continue;
      Eigen::Vector3d position = center + random.GaussianVector(kSigmaM);
      if (index > 30 && index < 38) position += Eigen::Vector3d(12, 9, 0);
      const GeodeticPosition fix = frame.GeodeticFromEnu(position);
      text << time_ns << "," << fix.latitude_deg << "," << fix.longitude_deg
           << "," << fix.height_m << "," << kSigmaM << "," << kSigmaM << "\n";
    }
    return folder_.Write("gnss.csv", text.str());
  }

  void Reconstruct() {
    EXPECT_EQ(
        Call("adasfm_global --database_path " + folder_.File("database.db") +
             " --output_path " + folder_.File("coarse"))
            .ExitCode(),
        0);
    EXPECT_EQ(
        Call("adasfm_mapper --database_path " + folder_.File("database.db") +
             " --input_path " + folder_.File("coarse/0") + " --output_path " +
             folder_.File("sparse"))
            .ExitCode(),
        0);
  }

  // The RMS error of the cameras on the Earth, without any alignment.
  double RmsError(const std::string& folder) const {
    const auto origin = ReadGeoreference(folder + "/georeference.json");
    EXPECT_TRUE(origin.ok()) << origin.status().message();
    const auto model = ReadModel(folder + "/0");
    EXPECT_TRUE(model.ok()) << model.status().message();
    const EnuFrame frame(*origin), world(kWorldOrigin);
    double sum = 0.0;
    for (const auto& [image_id, pose] : CamsFromWorld(*model)) {
      const Eigen::Vector3d& center = truth_.at(model->Image(image_id).Name());
      sum += (frame.EcefFromEnu(pose.TargetOriginInSource()) -
              world.EcefFromEnu(center))
                 .squaredNorm();
    }
    EXPECT_EQ(model->NumRegImages(), truth_.size());
    return std::sqrt(sum / model->NumRegImages());
  }

  std::string Import(const std::string& options) const {
    return "adasfm_prior_importer --database_path " +
           folder_.File("database.db") + " " + options;
  }

  static constexpr double kSigmaM = 0.3;
  std::map<std::string, Eigen::Vector3d> truth_;
};

// 36 good fixes of 0.3 m determine the frame to 0.3 sqrt(7 / 36 / 3) = 0.08 m
// per direction at best, 0.13 m in space.
TEST_F(GnssTest, PositionsWithOtherSensors) {
  for (const uint64_t seed : {1, 2}) {
    Synthesize(seed);
    const std::string logs = "--imu_path " + folder_.File("imu.csv") +
                             " --wheel_path " + folder_.File("wheel.csv") +
                             " --sensors_path " + folder_.File("sensors.yaml");
    ASSERT_EQ(Call(Import(logs + " --gnss_path " + WriteGnss(seed))).ExitCode(),
              0);
    Reconstruct();
    EXPECT_LT(RmsError(folder_.File("coarse")), 0.5) << seed;
    EXPECT_LT(RmsError(folder_.File("sparse")), 0.25) << seed;
  }
}

TEST_F(GnssTest, PositionsAlone) {
  for (const uint64_t seed : {3, 4}) {
    Synthesize(seed);
    ASSERT_EQ(Call(Import("--gnss_path " + WriteGnss(seed))).ExitCode(), 0);
    Reconstruct();
    EXPECT_LT(RmsError(folder_.File("sparse")), 0.3) << seed;
  }
  // The same model in ECEF keeps its ids of frames and rigs.
  ModelFrames frames;
  for (const auto& [image_id, pose] :
       CamsFromWorld(*ReadModel(folder_.File("sparse/0")))) {
    frames.frames[image_id] = {image_id + 100, 7};
  }
  ASSERT_TRUE(WriteBinaryModel(*ReadModel(folder_.File("sparse/0")),
                               folder_.File("sparse/0"), frames)
                  .ok());
  ASSERT_EQ(
      Call("adasfm_georeferencer --input_path " + folder_.File("sparse/0") +
           " --output_path " + folder_.File("ecef"))
          .ExitCode(),
      0);
  const auto enu = ReadModel(folder_.File("sparse/0"));
  const auto ecef = ReadModel(folder_.File("ecef"));
  const auto origin =
      ReadGeoreference(folder_.File("sparse/georeference.json"));
  ASSERT_TRUE(enu.ok() && ecef.ok() && origin.ok());
  for (const auto& [image_id, pose] : CamsFromWorld(*enu)) {
    EXPECT_LT((EnuFrame(*origin).EcefFromEnu(pose.TargetOriginInSource()) -
               CamFromWorld(ecef->Image(image_id)).TargetOriginInSource())
                  .norm(),
              1e-6);
  }
  const auto kept = ReadFrameFiles(folder_.File("ecef"));
  ASSERT_TRUE(kept.ok());
  ASSERT_EQ(kept->frames.size(), frames.frames.size());
  EXPECT_EQ(kept->frames.begin()->second.frame_id,
            frames.frames.begin()->second.frame_id);
  EXPECT_EQ(kept->frames.begin()->second.rig_id, 7);
  // Not while another run writes there.
  const auto lock =
      FolderLock::Acquire(folder_.File("ecef"), FolderLock::Mode::kExclusive);
  ASSERT_TRUE(lock.ok());
  ExpectError("adasfm_georeferencer --input_path " + folder_.File("sparse/0") +
                  " --output_path " + folder_.File("ecef"),
              "is in use by");
}

// Positions that COLMAP 3.8 takes from EXIF.
TEST_F(GnssTest, PositionsOfPhotos) {
  Synthesize(5);
  const std::string path = folder_.File("database.db");
  {
    SqliteConnection database(path, SqliteConnection::Mode::kWrite);
    SqliteStatement statement(&database,
                              "UPDATE images SET prior_tx = ?, prior_ty = ?, "
                              "prior_tz = ? WHERE name = ?");
    Random random(5);
    for (const auto& [name, center] : truth_) {
      const GeodeticPosition fix =
          EnuFrame(kWorldOrigin)
              .GeodeticFromEnu(center + random.GaussianVector(kSigmaM));
      statement.Reset();
      statement.BindDouble(1, fix.latitude_deg);
      statement.BindDouble(2, fix.longitude_deg);
      statement.BindDouble(3, fix.height_m);
      statement.BindText(4, name);
      statement.Step();
    }
  }
  ASSERT_EQ(Call(Import("--gnss_path database")).ExitCode(), 0);
  const auto tables = ReadPriorTables(path);
  ASSERT_TRUE(tables.ok()) << tables.status().message();
  EXPECT_EQ(tables->tables.positions.size(), 80u);
  Reconstruct();
  EXPECT_LT(RmsError(folder_.File("sparse")), 0.3);
}

TEST_F(GnssTest, SaysWhatIsWrong) {
  Synthesize(6);
  const std::string gnss = WriteGnss(6);
  ExpectError(Import("--gnss_path database"), "no image has a position");
  ExpectError(Import("--gnss_path " + folder_.File("none.csv")),
              "no such file");
  const std::string other_day = folder_.Write(
      "other_day.csv",
      "#timestamp [ns],latitude [deg],longitude [deg],altitude [m]\n"
      "1000,48,11,5\n");
  ExpectError(Import("--gnss_path " + other_day), "another day");
  ExpectError(Import("--AdaSfmGnss.max_fix_gap_s -1 --gnss_path " + gnss),
              "AdaSfmGnss.max_fix_gap_s");
  ExpectError("adasfm_georeferencer --input_path " + folder_.Path() +
                  " --output_path " + folder_.File("x"),
              "georeference.json");
  ExpectError(
      "adasfm_global --AdaSfmGlobal.write_pose_priors 1 "
      "--database_path " +
          folder_.File("database.db") + " --output_path " +
          folder_.File("coarse"),
      "no table pose_priors");
}

}  // namespace
}  // namespace adasfm
