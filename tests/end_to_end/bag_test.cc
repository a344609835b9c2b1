// SPDX-License-Identifier: BSD-3-Clause
// adasfm_automatic_reconstructor and adasfm_prior_importer with --bag_path as a
// user calls them, on a small rendered drive recorded as a ROS 2 bag.

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "colmap_ext/host/model.h"
#include "sensors/io/calibration.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/end_to_end/drive_bag.h"
#include "tests/testing/paths.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr int kNumImages = 14;
constexpr char kCameraParams[] = "288,288,240,150";

class BagTest : public CommandLineTest {
 protected:
  // One drive, rendered once for all tests; they only read it.
  static void SetUpTestSuite() {
    drive_ = std::make_unique<TemporaryFolder>();
    ASSERT_EQ(std::system((LauncherPath() +
                           " adasfm_synthesizer --render 1 --num_images " +
                           std::to_string(kNumImages) +
                           " --image_width 480 --image_height 300 "
                           "--output_path " +
                           drive_->Path() + " > /dev/null")
                              .c_str()),
              0);
  }
  static void TearDownTestSuite() { drive_.reset(); }

  std::string WriteBag(const std::string& name,
                       const DriveBagOptions& options = {}) {
    WriteDriveBag(drive_->Path(), folder_.File(name), options);
    return folder_.File(name);
  }

  std::string FromBag(const std::string& bag_path) const {
    return "adasfm_automatic_reconstructor --bag_path " + bag_path +
           " --workspace_path " + workspace_ + " --max_num_features 400";
  }

  Run ExpectSuccess(const std::string& arguments) {
    const Run run = Call(arguments);
    EXPECT_EQ(run.ExitCode(), 0) << arguments << "\n" << run.out << run.err;
    return run;
  }

  // The RMS error of the camera centres, aligned without scale.
  double ErrorOfModel(const std::string& model_path) {
    ExpectSuccess("adasfm_evaluator --input_path " + model_path +
                  " --ground_truth_path " + drive_->File("gt.txt") +
                  " --image_times_path " + drive_->File("times.csv") +
                  " --json_path " + folder_.File("evaluation.json"));
    const auto json =
        nlohmann::json::parse(ReadBytes(folder_.File("evaluation.json")));
    EXPECT_EQ(json.at("num_common_images"), kNumImages);
    return json.at("se3").at("translation_rmse_m");
  }

  static bool Contains(const std::string& text, const std::string& word) {
    return text.find(word) != std::string::npos;
  }

  static std::unique_ptr<TemporaryFolder> drive_;
  std::string workspace_ = folder_.File("workspace");
};

std::unique_ptr<TemporaryFolder> BagTest::drive_;

TEST_F(BagTest, OneCommandMakesAModelAsGoodAsFromFiles) {
  DriveBagOptions options;
  options.writer.compression = "zstd";
  const std::string bag = WriteBag("drive.mcap", options);
  Run run = ExpectSuccess(FromBag(bag));
  EXPECT_TRUE(Contains(run.out, "bag: 14 of 14 photos")) << run.out;
  EXPECT_TRUE(Contains(run.out, "camera PINHOLE")) << run.out;
  EXPECT_TRUE(Contains(run.out, "the bag does not tell the IMU's noise"))
      << run.out;
  const double error_m = ErrorOfModel(workspace_ + "/sparse");
  // The same reconstruction from the drive's files.
  const std::string reference = folder_.File("reference");
  ExpectSuccess("adasfm_automatic_reconstructor --image_path " +
                drive_->File("images") + " --workspace_path " + reference +
                " --camera_model PINHOLE --camera_params " + kCameraParams +
                " --max_num_features 400 --image_times_path " +
                drive_->File("times.csv") + " --imu_path " +
                drive_->File("imu.csv") + " --wheel_path " +
                drive_->File("wheel.csv") + " --sensors_path " +
                drive_->File("sensors.yaml"));
  const double reference_m = ErrorOfModel(reference + "/sparse");
  RecordProperty("bag_mm", static_cast<int>(1e3 * error_m));
  RecordProperty("files_mm", static_cast<int>(1e3 * reference_m));
  EXPECT_LT(error_m, 1.2 * reference_m + 0.01);

  // Again: nothing is done twice.
  run = ExpectSuccess(FromBag(bag));
  EXPECT_TRUE(Contains(run.out, "bag: done before")) << run.out;
  EXPECT_TRUE(Contains(run.out, "report: done before")) << run.out;
  // Without the database, the files extracted from the bag are still used.
  fs::remove(workspace_ + "/database.db");
  run = ExpectSuccess(FromBag(bag));
  EXPECT_TRUE(Contains(run.out, "bag: done before")) << run.out;
  EXPECT_FALSE(Contains(run.out, "features: done before")) << run.out;
  // The importer reads the same logs from the bag itself.
  run = ExpectSuccess("adasfm_prior_importer --database_path " + workspace_ +
                      "/database.db --bag_path " + bag + " --sensors_path " +
                      workspace_ + "/bag/sensors.yaml");
  EXPECT_TRUE(Contains(run.out, "14 with times, 14 inside")) << run.out;
}

TEST_F(BagTest, RawPhotosOfADb3BagKeepTheirPixels) {
  DriveBagOptions options;
  options.has_raw_images = true;
  const std::string bag = WriteBag("drive.db3", options);
  // Every third photo. The model of so few photos is not tested.
  Call(FromBag(bag) + " --image_step 3");
  const fs::path folder = workspace_ + "/bag/images";
  int num_photos = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const cv::Mat photo = cv::imread(entry.path().string());
    const cv::Mat truth =
        cv::imread(drive_->File("images/") + entry.path().filename().string());
    ASSERT_FALSE(truth.empty()) << entry.path();
    EXPECT_EQ(cv::norm(photo, truth, cv::NORM_INF), 0.0);
    ++num_photos;
  }
  EXPECT_EQ(num_photos, (kNumImages + 2) / 3);
  // The extrinsics are the drive's own.
  const auto truth = ReadSensorCalibration(drive_->File("sensors.yaml"));
  const auto found = ReadSensorCalibration(workspace_ + "/bag/sensors.yaml");
  ASSERT_TRUE(found.ok()) << found.status().message();
  EXPECT_NEAR(
      (found->cam_from_imu.translation - truth->cam_from_imu.translation)
          .norm(),
      0.0, 1e-9);
  EXPECT_NEAR(found->cam_from_imu.rotation.angularDistance(
                  truth->cam_from_imu.rotation),
              0.0, 1e-9);
  EXPECT_NEAR(
      (found->imu_from_wheel.translation - truth->imu_from_wheel.translation)
          .norm(),
      0.0, 1e-9);
  EXPECT_NEAR(found->imu_rate_hz, 200.0, 0.1);
  EXPECT_EQ(found->wheel_type, WheelType::kOdometry);
}

TEST_F(BagTest, WhatIsWrongIsSaidInOneLineWithTheRemedy) {
  DriveBagOptions options;
  options.has_extrinsics = false;
  options.has_second_imu = true;
  const std::string bag = WriteBag("drive.mcap", options);
  ExpectError(FromBag(bag), "choose one with --imu_topic /imu");
  ExpectError(FromBag(bag) + " --imu_topic /gyro", "no topic /gyro");
  ExpectError(FromBag(bag) + " --image_topic /eye",
              "/camera/image_raw/compressed (sensor_msgs/CompressedImage)");
  const std::string clear = FromBag(bag) + " --imu_topic /imu";
  ExpectError(clear, "give a calibration with --sensors_path");
  ExpectError(clear, "'imu_link' and 'camera_optical'");
  ExpectError(clear + " --image_step 0", "image_step = 0");
  ExpectError(clear + " --image_path " + drive_->File("images"),
              "one of --image_path, --video_path and --bag_path");
  ExpectError(FromBag(folder_.File("none.mcap")), "no such file");
  ExpectError("adasfm_automatic_reconstructor --workspace_path " + workspace_,
              "one of --image_path, --video_path and --bag_path");
  // Somebody's own folder is not touched.
  const std::string mine = folder_.File("mine");
  fs::create_directories(mine + "/bag/images");
  ExpectError("adasfm_automatic_reconstructor --bag_path " + bag +
                  " --workspace_path " + mine,
              "did not make");
  EXPECT_TRUE(fs::exists(mine + "/bag/images"));
}

// A film of the drive's photos, five a second.
TEST_F(BagTest, AVideoBecomesPhotosWithItsTimes) {
  if (std::system("command -v ffmpeg > /dev/null") != 0) {
    GTEST_SKIP() << "ffmpeg is missing (scripts/setup.sh --for-tests)";
  }
  const std::string video = folder_.File("the drive.mp4");
  ASSERT_EQ(std::system(("cat " + drive_->File("images") +
                         "/*.png | ffmpeg -v error -f image2pipe -framerate 5 "
                         "-i - -c:v mpeg4 -q:v 1 '" +
                         video + "'")
                            .c_str()),
            0);
  const std::string command =
      "adasfm_automatic_reconstructor --video_path '" + video +
      "' --workspace_path " + workspace_ +
      " --max_num_features 100 --video_start_ns 7000000000";
  // The model of so few features is not tested.
  Run run = Call(command);
  EXPECT_TRUE(Contains(run.out, "video: 14 of 14 frames")) << run.out;
  std::vector<fs::path> truths;
  for (const auto& entry : fs::directory_iterator(drive_->File("images"))) {
    truths.push_back(entry.path());
  }
  std::sort(truths.begin(), truths.end());
  for (int i = 0; i < kNumImages; ++i) {
    const std::string name =
        std::to_string(int64_t{200000000} * (35 + i)) + ".jpg";
    const cv::Mat photo = cv::imread(workspace_ + "/bag/images/" +
                                     std::string(23 - name.size(), '0') + name);
    ASSERT_FALSE(photo.empty()) << name;
    const cv::Mat truth = cv::imread(truths[i].string());
    EXPECT_LT(cv::norm(photo, truth, cv::NORM_L1) / (3.0 * truth.total()), 4.0);
  }
  run = Call(command);
  EXPECT_TRUE(Contains(run.out, "bag: done before")) << run.out;
  run = Call(command + " --image_step 5");
  EXPECT_TRUE(Contains(run.out, "video: 3 of 14 frames")) << run.out;

  ExpectError(command + " --image_distance_m 1", "with a video --wheel_path");
  ExpectError(command, "ffprobe is not on the PATH", "PATH=/nowhere");
  ExpectError("adasfm_automatic_reconstructor --video_path " +
                  folder_.Write("no.mp4", "This is no film.") +
                  " --workspace_path " + workspace_,
              "ffprobe failed");
}

TEST_F(BagTest, ACutBagIsUsedAsFarAsItGoes) {
  DriveBagOptions options;
  options.writer.compression = "lz4";
  const std::string bag = WriteBag("drive.mcap", options);
  fs::resize_file(bag, fs::file_size(bag) * 7 / 10);
  const Run run = Call(FromBag(bag));
  EXPECT_TRUE(Contains(run.out, "WARNING: " + bag + ": cut short")) << run.out;
  EXPECT_TRUE(fs::exists(workspace_ + "/bag/image_times.csv"));
}

}  // namespace
}  // namespace adasfm
