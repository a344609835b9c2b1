// SPDX-License-Identifier: BSD-3-Clause
// adasfm_automatic_reconstructor as a user calls it, on small rendered photos.

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <thread>

#include "colmap_ext/database/prior_tables.h"
#include "colmap_ext/host/model.h"
#include "sensors/io/calibration.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"
#include "tests/testing/paths.h"

namespace adasfm {
namespace {

namespace fs = std::filesystem;

constexpr int kNumImages = 14;

class AutomaticTest : public CommandLineTest {
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
    std::smatch match;
    const std::string sensors = ReadBytes(drive_->File("sensors.yaml"));
    ASSERT_TRUE(std::regex_search(sensors, match,
                                  std::regex("intrinsics: *\\[([^\\]]*)\\]")));
    // Calibration tools put pixel centres at whole numbers, COLMAP at .5.
    std::istringstream intrinsics(
        std::regex_replace(match[1].str(), std::regex(","), " "));
    std::vector<double> params(4);
    for (double& param : params) intrinsics >> param;
    std::ostringstream text;
    text << params[0] << "," << params[1] << "," << params[2] + 0.5 << ","
         << params[3] + 0.5;
    camera_params_ = text.str();
    intrinsics_ = match[1].str();
  }
  static void TearDownTestSuite() { drive_.reset(); }

  std::string Photos() const {
    return "adasfm_automatic_reconstructor --image_path " +
           drive_->File("images") + " --workspace_path " + workspace_ +
           " --camera_model PINHOLE --camera_params " + camera_params_ +
           " --max_num_features 400";
  }
  std::string WithSensors() const {
    return "adasfm_automatic_reconstructor --image_path " +
           drive_->File("images") + " --workspace_path " + workspace_ +
           " --max_num_features 400 --image_times_path " +
           drive_->File("times.csv") + " --imu_path " +
           drive_->File("imu.csv") + " --wheel_path " +
           drive_->File("wheel.csv") + " --sensors_path " +
           drive_->File("sensors.yaml");
  }

  Run ExpectSuccess(const std::string& arguments) {
    const Run run = Call(arguments);
    EXPECT_EQ(run.ExitCode(), 0) << arguments << "\n" << run.out << run.err;
    return run;
  }

  void ExpectModel() {
    const StatusOr<colmap::Reconstruction> model =
        ReadModel(workspace_ + "/sparse/0");
    ASSERT_TRUE(model.ok()) << model.status().message();
    EXPECT_EQ(model->NumRegImages(), kNumImages);
    EXPECT_TRUE(std::any_of(
        model->Points3D().begin(), model->Points3D().end(),
        [](const auto& point) { return !point.second.Color().isZero(); }));
    EXPECT_GT(fs::file_size(workspace_ + "/report.html"), 10000);
  }

  // The host's own program.
  std::string HostPath() {
    const std::string version = Call("adasfm_version").out;
    std::smatch match;
    EXPECT_TRUE(std::regex_search(version, match,
                                  std::regex("Host: +COLMAP \\S+ \\((.*)\\)")))
        << version;
    return match[1].str();
  }

  // What the steps recorded, by name.
  std::map<std::string, bool> DoneSteps() const {
    std::map<std::string, bool> steps;
    for (const nlohmann::json& step :
         nlohmann::json::parse(ReadBytes(workspace_ + "/steps.json"))) {
      steps[step.at("name")] = step.at("is_done");
    }
    return steps;
  }

  static bool Contains(const std::string& text, const std::string& word) {
    return text.find(word) != std::string::npos;
  }

  static std::unique_ptr<TemporaryFolder> drive_;
  static std::string camera_params_;
  static std::string intrinsics_;
  std::string workspace_ = folder_.File("workspace");
};

std::unique_ptr<TemporaryFolder> AutomaticTest::drive_;
std::string AutomaticTest::camera_params_;
std::string AutomaticTest::intrinsics_;

TEST_F(AutomaticTest, PhotosAndSensorsThenAgainThenWithOtherOptions) {
  Run run = ExpectSuccess(WithSensors() + " --ground_truth_path " +
                          drive_->File("gt.txt"));
  ExpectModel();
  // The camera is that of sensors.yaml.
  EXPECT_TRUE(Contains(run.out, "1 camera, calibrated as PINHOLE")) << run.out;
  EXPECT_FALSE(Contains(run.out, "WARNING: the database has no sensor"));
  EXPECT_EQ(DoneSteps().size(), 6);
  // Again: nothing is done twice.
  const fs::file_time_type model_time =
      fs::last_write_time(workspace_ + "/sparse/0/images.bin");
  run = ExpectSuccess(WithSensors() + " --ground_truth_path " +
                      drive_->File("gt.txt"));
  for (const auto& [name, is_done] : DoneSteps()) {
    EXPECT_TRUE(Contains(run.out, name + ": done before")) << run.out;
  }
  EXPECT_EQ(fs::last_write_time(workspace_ + "/sparse/0/images.bin"),
            model_time);
  // Without the wheels: features stay, and the pairs are chosen anew.
  run = ExpectSuccess(
      std::regex_replace(WithSensors(), std::regex("--wheel_path [^ ]*"), ""));
  EXPECT_TRUE(Contains(run.out, "features: done before")) << run.out;
  EXPECT_TRUE(Contains(run.out, "matching: wheel is 'none', was ")) << run.out;
  EXPECT_NE(fs::last_write_time(workspace_ + "/sparse/0/images.bin"),
            model_time);
  ExpectModel();
  // Without any sensor: the priors are removed.
  run = ExpectSuccess(Photos());
  EXPECT_TRUE(Contains(run.out, "WARNING: the database has no sensor"));
  EXPECT_TRUE(
      ReadPriorTables(workspace_ + "/database.db")->tables.priors.empty());
  EXPECT_FALSE(fs::exists(workspace_ + "/database.db.priors.json"));
  ExpectModel();
}

TEST_F(AutomaticTest, PhotosOfAnotherSizeThanCalibratedAreAnError) {
  const std::string sensors = folder_.File("sensors.yaml");
  std::ofstream(sensors) << std::regex_replace(
      ReadBytes(drive_->File("sensors.yaml")), std::regex("resolution: .*"),
      "resolution: [960, 600]");
  ExpectError("adasfm_automatic_reconstructor --image_path " +
                  drive_->File("images") + " --workspace_path " + workspace_ +
                  " --image_times_path " + drive_->File("times.csv") +
                  " --imu_path " + drive_->File("imu.csv") +
                  " --sensors_path " + sensors,
              "has 480x300 pixels, but the camera is calibrated for 960x600");
}

TEST_F(AutomaticTest, TheUsersColmapExtractsAndMatches) {
  const std::string host = HostPath();
  // COLMAP fails half-way: one line, which names the log.
  const std::string wrapper = WriteScript(
      "[ \"$1\" = matches_importer ] && [ \"$2\" != -h ] && "
      "echo broken && exit 3\nexec " +
      host + " \"$@\"\n");
  ExpectError(Photos(), "failed in matches_importer; see " + workspace_,
              "ADASFM_HOST_COLMAP=" + wrapper);
  EXPECT_TRUE(
      Contains(ReadBytes(workspace_ + "/logs/features.log"), "Processed file"));
  EXPECT_TRUE(Contains(ReadBytes(workspace_ + "/logs/matching.log"), "broken"));
  // Again with one that works: the features stay.
  const Run run = Call(Photos(), "ADASFM_HOST_COLMAP=" + host);
  EXPECT_EQ(run.ExitCode(), 0) << run.err;
  EXPECT_TRUE(Contains(run.out, "features: done before")) << run.out;
  ExpectModel();
  for (const auto& entry : fs::directory_iterator(workspace_ + "/logs")) {
    EXPECT_EQ(entry.path().extension(), ".log") << entry.path();
  }
}

TEST_F(AutomaticTest, TheWorkspaceMayLieAmongThePhotos) {
  const std::string photos = folder_.File("phötos of a day");
  fs::copy(drive_->File("images"), photos);
  std::ofstream(photos + "/notes.txt") << "no photo";
  workspace_ = photos + "/work space";
  const std::string command = "adasfm_automatic_reconstructor --image_path '" +
                              photos + "' --workspace_path '" + workspace_ +
                              "'" + " --camera_model PINHOLE --camera_params " +
                              camera_params_ + " --max_num_features 400";
  Run run = ExpectSuccess(command);
  EXPECT_TRUE(Contains(run.out, "not images: 1 of ")) << run.out;
  ExpectModel();
  // Files that the command wrote are not taken for photos.
  run = ExpectSuccess(command);
  EXPECT_TRUE(Contains(run.out, "features: done before")) << run.out;
  ExpectError("adasfm_automatic_reconstructor --image_path '" + photos +
                  "' --workspace_path '" + photos + "/../phötos of a day'",
              "is the folder of the photos");
}

TEST_F(AutomaticTest, RestartDoesAllAnew) {
  ExpectSuccess(Photos());
  const std::string kept = workspace_ + "/notes.txt";
  std::ofstream(kept) << "mine";
  const Run run = ExpectSuccess(Photos() + " --restart 1");
  EXPECT_TRUE(Contains(run.out, "removing what earlier runs left"));
  EXPECT_FALSE(Contains(run.out, "done before")) << run.out;
  EXPECT_EQ(DoneSteps().size(), 6);
  ExpectModel();
  EXPECT_TRUE(fs::exists(kept));
}

TEST_F(AutomaticTest, EurocRecording) {
  const std::string root = folder_.File("MH_00");
  fs::create_directories(root + "/mav0/cam0");
  fs::create_directories(root + "/mav0/imu0");
  fs::copy(drive_->File("images"), root + "/mav0/cam0/data");
  fs::copy(drive_->File("times.csv"), root + "/mav0/cam0/data.csv");
  fs::copy(drive_->File("imu.csv"), root + "/mav0/imu0/data.csv");
  const StatusOr<SensorCalibration> sensors =
      ReadSensorCalibration(drive_->File("sensors.yaml"));
  ASSERT_TRUE(sensors.ok());
  const Eigen::Matrix<double, 3, 4> body_from_cam =
      sensors->cam_from_imu.Inverse().ToMatrix();
  std::ostringstream camera;
  camera.precision(15);
  camera << "T_BS:\n  data: [";
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 4; ++j) camera << body_from_cam(i, j) << ", ";
  }
  camera << "0, 0, 0, 1]\nintrinsics: [" << intrinsics_
         << "]\ndistortion_model: radial-tangential\n"
            "distortion_coefficients: [0, 0, 0, 0]\n";
  std::ofstream(root + "/mav0/cam0/sensor.yaml") << camera.str();
  std::ofstream(root + "/mav0/imu0/sensor.yaml")
      << "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
         "rate_hz: 200\ngyroscope_noise_density: 5.0e-4\n"
         "gyroscope_random_walk: 2.0e-5\naccelerometer_noise_density: 5.0e-3\n"
         "accelerometer_random_walk: 2.0e-4\n";
  ExpectSuccess(
      "adasfm_automatic_reconstructor --data_format euroc "
      "--image_path " +
      root + " --workspace_path " + workspace_ + " --max_num_features 400");
  ExpectModel();
  const StatusOr<LoadedPriorTables> tables =
      ReadPriorTables(workspace_ + "/database.db");
  EXPECT_EQ(tables->tables.priors.size(), kNumImages - 1);
  EXPECT_EQ(tables->tables.gravity.size(), kNumImages);
}

// Starts the command, and sends a signal when its output contains `word`.
int InterruptAt(const std::string& arguments, const std::string& word,
                int signal_number, const std::string& out,
                const std::string& err) {
  const pid_t child = fork();
  if (child == 0) {
    if (!freopen(out.c_str(), "w", stdout)) _exit(2);
    if (!freopen(err.c_str(), "w", stderr)) _exit(2);
    std::istringstream words(arguments);
    std::vector<std::string> text = {LauncherPath()};
    for (std::string argument; words >> argument;) text.push_back(argument);
    std::vector<char*> argv;
    for (std::string& argument : text) argv.push_back(argument.data());
    argv.push_back(nullptr);
    execv(argv[0], argv.data());
    _exit(2);
  }
  int status = 0;
  bool is_sent = false;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (!is_sent && ReadBytes(out).find(word) != std::string::npos) {
      ::kill(child, signal_number);
      is_sent = true;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST_F(AutomaticTest, InterruptionKeepsWhatIsDone) {
  const std::string out = folder_.File("stdout");
  const std::string err = folder_.File("stderr");
  // In the middle of the features, and when the matches have begun.
  EXPECT_EQ(InterruptAt(Photos(), "features of image", SIGINT, out, err), 130);
  EXPECT_TRUE(Contains(ReadBytes(err), "the same command continues"));
  EXPECT_FALSE(DoneSteps().at("features"));
  EXPECT_EQ(InterruptAt(Photos(), "matching:", SIGTERM, out, err), 143);
  EXPECT_TRUE(DoneSteps().at("features"));
  EXPECT_FALSE(DoneSteps().at("matching"));
  const Run run = ExpectSuccess(Photos());
  EXPECT_TRUE(Contains(run.out, "features: done before"));
  ExpectModel();
}

// Matching uses the processor while an extractor, as on a GPU, does not.
TEST_F(AutomaticTest, MatchingBeginsWhileTheExtractorIsIdle) {
  const std::string wrapper =
      WriteScript(HostPath() +
                  " \"$@\" || exit\n"
                  "[ \"$1\" = feature_extractor ] && [ \"$2\" != -h ] && sleep "
                  "5\nexit 0\n");
  ASSERT_EQ(setenv("ADASFM_HOST_COLMAP", wrapper.c_str(), 1), 0);
  const std::string out = folder_.File("stdout");
  const std::string word = "of them are matched, while features";
  const int code =
      InterruptAt(Photos(), word, SIGINT, out, folder_.File("stderr"));
  unsetenv("ADASFM_HOST_COLMAP");
  EXPECT_EQ(code, 130);
  const std::string text = ReadBytes(out);
  EXPECT_TRUE(Contains(text, word)) << text;
  EXPECT_FALSE(fs::exists(workspace_ + "/early.db"));
  for (const auto& entry : fs::directory_iterator(workspace_ + "/logs")) {
    EXPECT_EQ(entry.path().extension(), ".log") << entry.path();
  }
}

TEST_F(AutomaticTest, WrongInputIsOneLine) {
  const std::string command =
      "adasfm_automatic_reconstructor --workspace_path " + workspace_ +
      " --image_path ";
  ExpectError(command + folder_.File("missing"), "missing does not exist");
  const std::string texts = folder_.File("texts");
  fs::create_directories(texts);
  ExpectError(command + texts, "has no files");
  std::ofstream(texts + "/notes.txt") << "no photo";
  ExpectError(command + texts, "none of the 1 files");
  ExpectError(command + drive_->File("images") + " --imu_path " +
                  drive_->File("imu.csv"),
              "--sensors_path");
  ExpectError(command + drive_->File("images") + " --camera_model CUBE",
              "camera_model = CUBE");
  ExpectError(command + drive_->File("images") +
                  " --camera_model PINHOLE --camera_params 1,2",
              "camera_params = 1,2");
  ExpectError(command + drive_->File("images") + " --data_format euroc",
              "cam0/data is missing");
  const std::string used = folder_.File("used");
  fs::create_directories(used);
  std::ofstream(used + "/database.db") << "somebody's";
  ExpectError("adasfm_automatic_reconstructor --workspace_path " + used +
                  " --image_path " + drive_->File("images"),
              "did not make");
  ExpectError("adasfm_automatic_reconstructor --restart 1 --workspace_path " +
                  used + " --image_path " + drive_->File("images"),
              "did not make");
  EXPECT_EQ(ReadBytes(used + "/database.db"), "somebody's");
}

}  // namespace
}  // namespace adasfm
