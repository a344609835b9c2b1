// SPDX-License-Identifier: BSD-3-Clause
// What the mapper stage does when it is stopped, when a part fails and when
// memory is short.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <new>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>

#include "colmap_ext/mapper_stage/mapper_fingerprint.h"
#include "colmap_ext/mapper_stage/mapper_stage.h"
#include "colmap_ext/mapper_stage/mapping_summary.h"
#include "colmap_ext/mapper_stage/part_memory.h"
#include "tests/testing/colmap_ext/file_size_limit.h"
#include "tests/testing/colmap_ext/mapper_stage_fixture.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

class MapperCheckpointsTest : public MapperStageTest {
 protected:
  // The summary without measured times.
  static nlohmann::json Figures(const MapperStageSummary& summary) {
    nlohmann::json json = MapperSummaryToJson(summary);
    for (const char* name : {"plan", "parts", "merge", "refine"}) {
      json.erase(std::string(name) + "_seconds");
    }
    for (nlohmann::json& part : json["parts"]) part.erase("seconds");
    return json;
  }
};

TEST_F(MapperCheckpointsTest, ContinuesFromWhatIsThere) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto undisturbed = Run(world);
  // As a kill in the middle of part 0 leaves it: its temporary folder, and no
  // part.
  const std::string part = folder_ + "/checkpoints/part_0";
  fs::rename(part, part + ".tmp");
  fs::remove(part + ".tmp/points3D.bin");
  const auto part_time = fs::last_write_time(folder_ + "/checkpoints/part_1");
  const auto continued = Run(world);
  EXPECT_EQ(part_time, fs::last_write_time(folder_ + "/checkpoints/part_1"));
  ASSERT_EQ(undisturbed.size(), continued.size());
  for (const auto& [image_id, pose] : undisturbed) {
    EXPECT_TRUE(PosesNear(pose, continued.at(image_id), 1e-9, 1e-9));
  }
}

// A damaged checkpoint is reported and made again, and the model is the same.
TEST_F(MapperCheckpointsTest, DamagedCheckpointsAreMadeAgain) {
  MapperWorldOptions options;
  options.world.num_images = 60;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto undisturbed = Run(world);
  const std::string checkpoints = folder_ + "/checkpoints/";
  const auto flip = [](const std::string& path, std::streamoff offset) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(offset);
    file.put('\x7f');
  };
  const std::vector<std::pair<std::string, std::function<void()>>> damages = {
      {"part_0/points3D.bin is damaged",
       [&] { fs::resize_file(checkpoints + "part_0/points3D.bin", 3000); }},
      {"part_0/cameras.bin is damaged",
       [&] { flip(checkpoints + "part_0/cameras.bin", 40); }},
      {"part_0/images.bin is missing",
       [&] { fs::remove(checkpoints + "part_0/images.bin"); }},
      {"part_0/state.json is damaged",
       [&] { flip(checkpoints + "part_0/state.json", 60); }},
      {"part_0 holds part 1",
       [&] {
         fs::remove_all(checkpoints + "part_0");
         fs::copy(checkpoints + "part_1", checkpoints + "part_0");
       }},
      {"plan.json is damaged",
       [&] { fs::resize_file(checkpoints + "plan.json", 0); }},
      {"refine_3/points3D.bin is damaged",
       [&] { fs::resize_file(checkpoints + "refine_3/points3D.bin", 0); }}};
  for (const auto& [message, damage] : damages) {
    damage();
    const auto part_time = fs::last_write_time(checkpoints + "part_1");
    std::string lines;
    MapperStage stage(
        options_, world.data, world.coarse_poses, folder_,
        [&](const std::string& line, double) { lines += line + "\n"; });
    ASSERT_TRUE(stage.Plan().ok()) << message;
    ASSERT_TRUE(stage.RunAllParts().ok()) << message;
    const auto model = stage.Merge(true);
    ASSERT_TRUE(model.ok()) << message << model.status().message();
    EXPECT_NE(lines.find(message), std::string::npos) << message << lines;
    EXPECT_EQ(part_time, fs::last_write_time(checkpoints + "part_1"));
    const auto poses = Poses(*model);
    ASSERT_EQ(poses.size(), undisturbed.size());
    for (const auto& [image_id, pose] : undisturbed) {
      EXPECT_TRUE(PosesNear(pose, poses.at(image_id), 1e-12, 1e-12)) << message;
    }
  }
}

TEST_F(MapperCheckpointsTest, FailedWriteNamesTheCauseAndIsMadeGood) {
  MapperWorldOptions options;
  options.world.num_images = 60;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto undisturbed = Run(world);
  fs::remove_all(folder_);
  MapperStage stage(options_, world.data, world.coarse_poses, folder_);
  ASSERT_TRUE(stage.Plan().ok());
  {
    const FileSizeLimit limit(20000);
    const Status status = stage.RunPart(0);
    ASSERT_FALSE(status.ok());
    EXPECT_NE(status.message().find("File too large"), std::string::npos)
        << status.message();
  }
  const auto again = Run(world);
  ASSERT_EQ(again.size(), undisturbed.size());
  for (const auto& [image_id, pose] : undisturbed) {
    EXPECT_TRUE(PosesNear(pose, again.at(image_id), 1e-12, 1e-12));
  }
}

TEST_F(MapperCheckpointsTest, ForeignFilesStayWhenOptionsChange) {
  MapperWorldOptions options;
  options.world.num_images = 60;
  const MapperWorld world = BuildMapperWorld(options);
  ASSERT_TRUE(MapperStage(options_, world.data, world.coarse_poses, folder_)
                  .Plan()
                  .ok());
  const std::string foreign = folder_ + "/checkpoints/weights.pth";
  std::ofstream(foreign) << "x";
  options_.local.registration.max_reproj_error_px = 6.0;
  const Status status =
      MapperStage(options_, world.data, world.coarse_poses, folder_).Plan();
  ASSERT_FALSE(status.ok());
  EXPECT_NE(status.message().find(foreign), std::string::npos);
  EXPECT_TRUE(fs::exists(foreign));
}

TEST_F(MapperCheckpointsTest, ContinuesInsideTheRefinement) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto undisturbed = Run(world);
  const nlohmann::json expected_figures = Figures(summary_);
  fs::remove_all(folder_);
  MapperStage stopped(options_, world.data, world.coarse_poses, folder_,
                      [](const std::string& line, double) {
                        if (line.find("round 2") != std::string::npos) {
                          throw std::runtime_error("stopped");
                        }
                      });
  ASSERT_TRUE(stopped.Plan().ok());
  ASSERT_TRUE(stopped.RunAllParts().ok());
  EXPECT_THROW(stopped.Merge(true), std::runtime_error);
  const std::string saved = folder_ + "/checkpoints/refine_";
  EXPECT_FALSE(fs::exists(saved + "0"));
  EXPECT_TRUE(fs::exists(saved + "1"));
  // First the remaining rounds, then only reading, from a folder where a kill
  // has left half of an earlier round.
  for (int run = 0; run < 2; ++run) {
    if (run == 1) fs::create_directory(saved + "2");
    const auto continued = Run(world);
    EXPECT_TRUE(fs::exists(saved + "3"));
    EXPECT_FALSE(fs::exists(saved + "2"));
    ASSERT_EQ(undisturbed.size(), continued.size());
    for (const auto& [image_id, pose] : undisturbed) {
      EXPECT_TRUE(PosesNear(pose, continued.at(image_id), 1e-12, 1e-12));
    }
    EXPECT_EQ(Figures(summary_), expected_figures);
  }
  // Other options of the refinement do not continue from it.
  options_.local.keypoint_sigma_px = 2.0;
  MapperStage changed(options_, world.data, world.coarse_poses, folder_);
  EXPECT_FALSE(changed.Merge(true).ok());
}

// Lack of memory is not a failure of the part, so that none is recorded.
TEST_F(MapperCheckpointsTest, PartWithoutMemoryIsMadeLater) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  const auto undisturbed = Run(world);
  fs::remove_all(folder_);
  MapperStage starved(
      options_, world.data, world.coarse_poses, folder_, {},
      [](const LocalMapperOptions&, const SceneData&, const CoarsePoseMap&,
         const std::set<image_t>&) -> LocalMapResult {
        throw std::bad_alloc();
      });
  ASSERT_TRUE(starved.Plan().ok());
  EXPECT_THROW(starved.RunAllParts(), std::bad_alloc);
  const auto later = Run(world);
  ASSERT_EQ(undisturbed.size(), later.size());
  for (const auto& [image_id, pose] : undisturbed) {
    EXPECT_TRUE(PosesNear(pose, later.at(image_id), 1e-12, 1e-12));
  }
}

TEST_F(MapperCheckpointsTest, PartThatThrowsIsTriedOnceMoreMoreStrictly) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  options_.num_threads = 1;
  std::vector<int> min_visible;
  const auto throws_while_loose =
      [&](const LocalMapperOptions& local, const SceneData& data,
          const CoarsePoseMap& coarse, const std::set<image_t>& images) {
        if (images.count(1)) {
          min_visible.push_back(local.registration.min_num_visible_points);
          if (min_visible.size() == 1) throw std::runtime_error("a bad point");
        }
        return ReconstructLocally(local, data, coarse, images);
      };
  std::string lines;
  MapperStage stage(
      options_, world.data, world.coarse_poses, folder_,
      [&](const std::string& line, double) { lines += line + "\n"; },
      throws_while_loose);
  ASSERT_TRUE(stage.Plan().ok());
  ASSERT_TRUE(stage.RunAllParts().ok());
  ASSERT_TRUE(stage.Merge(true).ok());
  EXPECT_NE(lines.find("failed: a bad point; trying again"), std::string::npos)
      << lines;
  ASSERT_EQ(min_visible.size(), 2);
  EXPECT_GT(min_visible[1], min_visible[0]);
  int num_retried = 0;
  for (const PartReport& part : stage.Summary().parts) {
    EXPECT_TRUE(part.failure.empty());
    num_retried += part.retry_reason == "a bad point";
  }
  EXPECT_EQ(num_retried, 1);
}

TEST_F(MapperCheckpointsTest, PartThatKeepsThrowingIsNamedAndTheOthersGoOn) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  int num_calls = 0;
  options_.num_threads = 1;
  MapperStage stage(
      options_, world.data, world.coarse_poses, folder_, {},
      [&](const LocalMapperOptions& local, const SceneData& data,
          const CoarsePoseMap& coarse, const std::set<image_t>& images) {
        if (images.count(1)) {
          ++num_calls;
          throw std::runtime_error("no luck");
        }
        return ReconstructLocally(local, data, coarse, images);
      });
  ASSERT_TRUE(stage.Plan().ok());
  ASSERT_TRUE(stage.RunAllParts().ok());
  EXPECT_EQ(num_calls, 2);
  const auto model = stage.Merge(true);
  ASSERT_TRUE(model.ok());
  // The coarse poses and the refinement replace the part.
  EXPECT_EQ(model->NumRegImages(), options.world.num_images);
  EXPECT_LT(ComputeAlignedErrors(Poses(*model), world.true_poses, {}).rmse_m,
            CoarseRmseM(world));
  EXPECT_NE(FormatMapperSummaryText(stage.Summary()).find("FAILED: no luck"),
            std::string::npos);
}

TEST_F(MapperCheckpointsTest, MemoryBoundsTheParallelParts) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  for (const bool enough : {true, false}) {
    options_.max_memory_gb = enough ? 10.0 : 1e-3;
    fs::remove_all(folder_);
    std::string lines;
    std::mutex mutex;
    MapperStage stage(options_, world.data, world.coarse_poses, folder_,
                      [&](const std::string& line, double) {
                        const std::lock_guard<std::mutex> lock(mutex);
                        lines += line + "\n";
                      });
    ASSERT_TRUE(stage.Plan().ok());
    ASSERT_TRUE(stage.RunAllParts().ok());
    EXPECT_EQ(stage.Summary().num_parallel_parts, enough ? 2 : 1);
    EXPECT_GT(stage.Summary().max_part_memory_bytes, 1e6);
    EXPECT_EQ(lines.find("not enough for one") == std::string::npos, enough)
        << lines;
  }
}

TEST(CountPartsThatFit, TakesTheBiggestTogether) {
  EXPECT_EQ(CountPartsThatFit({1.0, 5.0, 3.0}, 9.0), 3);
  EXPECT_EQ(CountPartsThatFit({1.0, 5.0, 3.0}, 8.0), 2);
  EXPECT_EQ(CountPartsThatFit({1.0, 5.0, 3.0}, 5.0), 1);
  EXPECT_EQ(CountPartsThatFit({1.0, 5.0, 3.0}, 0.0), 1);
}

TEST_F(MapperCheckpointsTest, ChangedOptionsOrDataStartAnew) {
  MapperWorldOptions options;
  options.world.num_images = 60;
  MapperWorld world = BuildMapperWorld(options);
  MapperStage stage(options_, world.data, world.coarse_poses, folder_);
  ASSERT_TRUE(stage.Plan().ok());
  ASSERT_TRUE(stage.RunPart(0).ok());
  const std::string part = folder_ + "/checkpoints/part_0/state.json";
  ASSERT_TRUE(fs::exists(part));

  MapperStageOptions changed = options_;
  changed.local.registration.max_reproj_error_px = 6.0;
  MapperStage with_options(changed, world.data, world.coarse_poses, folder_);
  EXPECT_NE(with_options.Fingerprint(), stage.Fingerprint());
  EXPECT_FALSE(with_options.RunPart(0).ok());
  EXPECT_FALSE(with_options.Merge(true).ok());

  world.data.images.begin()->second.keypoints.front().x() += 1.0;
  MapperStage with_data(options_, world.data, world.coarse_poses, folder_);
  EXPECT_NE(with_data.Fingerprint(), stage.Fingerprint());
  ASSERT_TRUE(with_data.Plan().ok());
  EXPECT_FALSE(fs::exists(part));
}

// Depends on all that an import may change, so that checkpoints of other sensor
// data are not used.
TEST(ComputePartsFingerprint, DependsOnAllThatSensorsMeasure) {
  SceneData data;
  data.priors.resize(1);
  data.inertial_motions.resize(1);
  data.inertial_motions[0].by_wheels = MeasuredTranslation();
  data.positions.resize(1);
  data.wheel_scale = WheelScale();
  data.rigs.cameras[1].cam_from_rig = Rigid3d();
  data.rigs.images[1].camera_id = 1;
  const auto fingerprint = [&data] {
    return ComputePartsFingerprint(PartitionPlanOptions(), LocalMapperOptions(),
                                   data, CoarsePoseMap());
  };
  std::set<std::string> seen = {fingerprint()};
  const auto expect_new = [&](const char* what) {
    EXPECT_TRUE(seen.insert(fingerprint()).second) << what;
  };
  for (const auto& [name, value] : std::vector<std::pair<const char*, double*>>{
           {"rotation", &data.priors[0].cam2_from_cam1.rotation.x()},
           {"translation", &data.priors[0].cam2_from_cam1.translation.x()},
           {"covariance", &data.priors[0].covariance(5, 5)},
           {"dt", &data.inertial_motions[0].dt_s},
           {"velocity", &data.inertial_motions[0].delta_velocity.z()},
           {"position", &data.inertial_motions[0].delta_position.z()},
           {"velocity by bias",
            &data.inertial_motions[0].velocity_by_bias(2, 2)},
           {"position by bias",
            &data.inertial_motions[0].position_by_bias(2, 2)},
           {"lever arm", &data.inertial_motions[0].camera_from_imu_origin.z()},
           {"wheels", &data.inertial_motions[0].by_wheels->translation.z()},
           {"wheels' covariance",
            &data.inertial_motions[0].by_wheels->covariance(2, 2)},
           {"fix", &data.positions[0].position.z()},
           {"fix's covariance", &data.positions[0].covariance(2, 2)},
           {"antenna", &data.positions[0].antenna_in_cam.z()},
           {"length drift", &data.length_drift_ratio},
           {"accelerometer's scale", &data.inertial_scale_sigma},
           {"wheel scale", &data.wheel_scale->scale},
           {"wheel scale's sigma", &data.wheel_scale->sigma},
           {"rig", &data.rigs.cameras[1].cam_from_rig->translation.z()},
           {"rig's rotation sigma", &data.rigs.cameras[1].rotation_sigma_rad},
           {"rig's translation sigma",
            &data.rigs.cameras[1].translation_sigma_m}}) {
    *value += 0.125;
    expect_new(name);
  }
  data.priors[0].dt_ns = 1;
  expect_new("time");
  data.priors[0].flags = kPriorRotation;
  expect_new("flags");
  data.rigs.images[1].frame_id = 7;
  expect_new("frame");
  data.images[1].gravity_in_cam = Eigen::Vector3d::UnitY();
  expect_new("gravity");
}

TEST_F(MapperCheckpointsTest, MergeNamesTheMissingParts) {
  MapperWorldOptions options;
  options.world.num_images = 80;
  const MapperWorld world = BuildMapperWorld(options);
  MapperStage stage(options_, world.data, world.coarse_poses, folder_);
  EXPECT_FALSE(stage.RunPart(0).ok());
  ASSERT_TRUE(stage.Plan().ok());
  ASSERT_TRUE(stage.RunPart(0).ok());
  EXPECT_FALSE(stage.RunPart(99).ok());
  const auto missing = stage.Merge(true);
  ASSERT_FALSE(missing.ok());
  EXPECT_NE(missing.status().message().find("missing parts: 1"),
            std::string::npos);
  // The existing parts can be merged; images of missing parts keep coarse
  // poses.
  MapperStage again(options_, world.data, world.coarse_poses, folder_);
  const auto model = again.Merge(false);
  ASSERT_TRUE(model.ok());
  EXPECT_EQ(model->NumRegImages(), options.world.num_images);
}

}  // namespace
}  // namespace adasfm
