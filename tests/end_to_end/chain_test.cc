// SPDX-License-Identifier: BSD-3-Clause
// The whole chain through its commands, on synthetic drives.

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "colmap_ext/host/database.h"
#include "colmap_ext/host/model.h"
#include "colmap_ext/host/model_folder.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/io/double_blob.h"
#include "core/sqlite.h"
#include "tests/testing/colmap_ext/command_line_fixture.h"

namespace adasfm {
namespace {

class ChainTest : public CommandLineTest {
 protected:
  void Make(const std::string& options) {
    ExpectSuccess("adasfm_synthesizer --output_path " + folder_.Path() + " " +
                  options);
  }

  Run ExpectSuccess(const std::string& arguments) {
    const Run run = Call(arguments);
    EXPECT_EQ(run.ExitCode(), 0) << arguments << "\n" << run.err;
    return run;
  }

  // A calibration whose timeshift_cam_imu is wrong by shift_s.
  void ShiftTheClock(double shift_s) {
    const std::string key = "timeshift_cam_imu:";
    std::string text = ReadBytes(folder_.File("sensors.yaml"));
    const size_t begin = text.find(key);
    ASSERT_NE(begin, std::string::npos);
    const size_t value = begin + key.size();
    const size_t length = text.find('\n', value) - value;
    text.replace(
        value, length,
        " " + std::to_string(std::stod(text.substr(value, length)) + shift_s));
    folder_.Write("sensors.yaml", text);
  }

  void Import() {
    ExpectSuccess("adasfm_prior_importer --database_path " + database_ +
                  " --image_times_path " + folder_.File("times.csv") +
                  " --imu_path " + folder_.File("imu.csv") + " --wheel_path " +
                  folder_.File("wheel.csv") + " --sensors_path " +
                  folder_.File("sensors.yaml"));
  }

  std::string GlobalArguments(const std::string& output = "global") {
    return "adasfm_global --database_path " + database_ + " --output_path " +
           folder_.File(output);
  }

  std::string MapperArguments(const std::string& output = "sparse") {
    return "adasfm_mapper --database_path " + database_ + " --input_path " +
           folder_.File("global/0") + " --output_path " + folder_.File(output);
  }

  nlohmann::json Evaluate(const std::string& model) {
    const std::string json = folder_.File("evaluation.json");
    ExpectSuccess("adasfm_evaluator --input_path " + folder_.File(model) +
                  " --ground_truth_path " + folder_.File("gt.txt") +
                  " --json_path " + json);
    return nlohmann::json::parse(ReadBytes(json));
  }

  // The three commands; the error of the centres in m, and what the summary of
  // adasfm_global has found.
  std::pair<double, nlohmann::json> RunAndFind(const std::string& found) {
    Import();
    ExpectSuccess(GlobalArguments());
    ExpectSuccess(MapperArguments());
    return {Evaluate("sparse/0")["sim3_least_squares"]["translation_rmse_m"],
            nlohmann::json::parse(
                ReadBytes(folder_.File("global/summary.json")))[found]};
  }

  std::string ModelBytes(const std::string& output) {
    return ReadBytes(folder_.File(output + "/0/images.bin"));
  }

  void Sql(const std::string& statement) {
    SqliteConnection(database_, SqliteConnection::Mode::kWrite)
        .Execute(statement);
  }

  // Scales the focal lengths in the database.
  void ScaleFocalLengths(double factor) {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    for (auto& [camera_id, camera] : ReadCameras(&database)) {
      std::vector<double> params = camera.Params();
      for (const size_t i : camera.FocalLengthIdxs()) params[i] *= factor;
      SqliteStatement statement(
          &database, "UPDATE cameras SET params = ? WHERE camera_id = ?");
      BindDoubles(&statement, 1, params.data(), params.size());
      statement.BindInt(2, camera_id);
      statement.Step();
    }
  }

  // Sets the cameras to COLMAP's guess for images without EXIF.
  void ForgetTheCamera() {
    SqliteConnection database(database_, SqliteConnection::Mode::kWrite);
    for (auto& [camera_id, camera] : ReadCameras(&database)) {
      const std::vector<double> params = {1.2 * camera.Width(),
                                          0.5 * camera.Width(),
                                          0.5 * camera.Height(), 0.0};
      SqliteStatement statement(
          &database,
          "UPDATE cameras SET model = 2, params = ?, prior_focal_length = 0 "
          "WHERE camera_id = ?");
      BindDoubles(&statement, 1, params.data(), params.size());
      statement.BindInt(2, camera_id);
      statement.Step();
    }
  }

  double ReadFocalLength() {
    SqliteConnection database(database_, SqliteConnection::Mode::kRead);
    return ReadCameras(&database).begin()->second.MeanFocalLength();
  }

  colmap::Camera CameraOf(const std::string& model) {
    const auto reconstruction = ReadModel(folder_.File(model));
    EXPECT_TRUE(reconstruction.ok());
    return reconstruction->Cameras().begin()->second;
  }
  double FocalLength(const std::string& model) {
    return CameraOf(model).MeanFocalLength();
  }

  std::string database_ = folder_.File("database.db");
};

int CountOf(const std::string& text, const std::string& word) {
  int count = 0;
  for (size_t at = text.find(word); at != std::string::npos;
       at = text.find(word, at + 1)) {
    ++count;
  }
  return count;
}

// The wheel scale is known to 1 % beforehand. Keypoint noise of 0.5 px over a
// drive of 100 m leaves a few centimetres (measured: 0.03 m on such worlds).
void ExpectGoodMetricModel(const nlohmann::json& evaluation, int num_images) {
  EXPECT_EQ(evaluation["num_images"], num_images);
  EXPECT_LT(evaluation["sim3_least_squares"]["translation_rmse_m"], 0.15);
  EXPECT_NEAR(evaluation["sim3"]["scale"], 1.0, 0.03);
}

TEST_F(ChainTest, AliasedDriveWithBlackoutEndsInOneMetricModel) {
  Make(
      "--num_images 160 --seed 2 --alias_ratio 0.04 --num_blackouts 1 "
      "--wheel_slips 1");
  Import();
  ExpectSuccess(GlobalArguments());
  ExpectSuccess(MapperArguments());
  ExpectGoodMetricModel(Evaluate("sparse/0"), 160);
  const auto summary =
      nlohmann::json::parse(ReadBytes(folder_.File("sparse/summary.json")));
  EXPECT_FALSE(summary.empty());
}

// Below 10 ms the import leaves the clock as stated. The coarse model finds the
// error to a millisecond, and the model is as good as one with the true clock.
TEST_F(ChainTest, AClockThatIsAFewMillisecondsOffIsFound) {
  double error_with_true_clock = 0.0;
  for (const double shift_s : {0.0, 0.008, -0.008}) {
    Make("--num_images 160 --seed 3");
    ShiftTheClock(shift_s);
    const auto [error, shifts] = RunAndFind("time_shifts");
    if (shift_s == 0.0) {
      EXPECT_TRUE(shifts.empty());
      error_with_true_clock = error;
    } else {
      EXPECT_LT(error, 1.1 * error_with_true_clock);
      ASSERT_EQ(shifts.size(), 1);
      EXPECT_NEAR(shifts[0]["shift_s"], -shift_s, 1e-3);
    }
  }
}

// The test of loop closures, the models and the mapper's priors allow for it.
TEST_F(ChainTest, AGyroscopeWithWrongScalesIsFound) {
  double error_with_right_scales = 0.0;
  for (const double scale : {0.0, 0.02, -0.02}) {
    Make("--num_images 200 --seed 4 --alias_ratio 0.03 --gyro_scale " +
         std::to_string(scale));
    const auto [error, found] = RunAndFind("gyroscope_scales");
    if (scale == 0.0) {
      EXPECT_TRUE(found.empty());
      error_with_right_scales = error;
    } else {
      EXPECT_LT(error, 1.2 * error_with_right_scales);
      ASSERT_EQ(found.size(), 1);
      // The camera turns about its y axis. 200 images tell the scale to about
      // 0.4 %, and the prior of 1 % draws it to zero by a sixth.
      EXPECT_NEAR(found[0]["scales"][1], 1.0 / (1.0 + scale) - 1.0, 8e-3);
    }
  }
}

// Each floor is aliased with the next, 3 m above after 200 m of ramp: a climb
// of 0.9 deg, while the direction of driving is known to 0.35 deg beforehand.
TEST_F(ChainTest, FloorsThatLookAlikeStayApart) {
  for (const std::string seed : {"1", "2", "3"}) {
    Make(
        "--num_images 160 --trajectory floors --spacing 3 --num_neighbors 6 "
        "--alias_ratio 0.3 --seed " +
        seed);
    Import();
    ExpectSuccess(GlobalArguments("global" + seed));
    const nlohmann::json evaluation = Evaluate("global" + seed + "/0");
    EXPECT_EQ(evaluation["num_images"], 160);
    EXPECT_LT(evaluation["sim3_least_squares"]["translation_rmse_m"], 0.3)
        << "seed " << seed;
  }
}

// Without wheels the sigma states how far the accelerometer's metres may be
// off. A second run measures them anew.
TEST_F(ChainTest, AnImuAloneTellsMetres) {
  Make("--num_images 160 --seed 5");
  ExpectSuccess("adasfm_prior_importer --database_path " + database_ +
                " --image_times_path " + folder_.File("times.csv") +
                " --imu_path " + folder_.File("imu.csv") + " --sensors_path " +
                folder_.File("sensors.yaml"));
  const auto run = [this](const std::string& output) {
    ExpectSuccess(GlobalArguments());
    ExpectSuccess(MapperArguments(output));
  };
  run("sparse");
  run("again");
  const auto verdict = nlohmann::json::parse(
      ReadBytes(folder_.File("sparse/summary.json")))["verdict"];
  EXPECT_EQ(verdict["result"], "good");
  EXPECT_EQ(verdict["metric_source"], "the accelerometer");
  const double sigma = verdict["metric_sigma"];
  EXPECT_LE(sigma, 0.1);
  const nlohmann::json evaluation = Evaluate("sparse/0");
  EXPECT_EQ(evaluation["num_images"], 160);
  EXPECT_NEAR(evaluation["sim3"]["scale"], 1.0, 3.0 * sigma);
  EXPECT_NEAR(Evaluate("again/0")["sim3"]["scale"], evaluation["sim3"]["scale"],
              1e-6);
}

// Aliased pairs on one street stay in the database: the parts fold there,
// priors are violated, and the coarse poses are used instead.
TEST_F(ChainTest, FalseLoopsAloneDoNotSpoilTheMapper) {
  Make(
      "--num_images 160 --seed 2 --alias_ratio 0.04 --num_blackouts 1 "
      "--wheel_slips 1");
  Import();
  ExpectSuccess(GlobalArguments() + " --AdaSfmGlobal.refine_matches 0");
  ExpectSuccess(MapperArguments());
  ExpectGoodMetricModel(Evaluate("sparse/0"), 160);
}

// With photos 7 m apart the parts bend in the dark. A part that the refinement
// could straighten only without its points violates no prior, but the coarse
// poses are better.
TEST_F(ChainTest, NoImageLosesItsPointsToPartsThatBend) {
  for (const std::string seed : {"1", "4"}) {
    Make(
        "--num_images 150 --spacing 7 --num_neighbors 4 --alias_ratio 0.05 "
        "--num_blackouts 2 --blackout_images 16 --wheel_slips 2 --seed " +
        seed);
    Import();
    ExpectSuccess(GlobalArguments());
    ExpectSuccess(MapperArguments("sparse" + seed));
    const auto model = ReadModel(folder_.File("sparse" + seed + "/0"));
    ASSERT_TRUE(model.ok());
    int num_images_with_points = 0;
    for (const image_t image_id : RegisteredImages(*model)) {
      num_images_with_points += model->Image(image_id).NumPoints3D() >= 20;
    }
    EXPECT_GE(num_images_with_points, 150 - 2 * 16 - 2) << "seed " << seed;
    const auto error = [this](const std::string& path) -> double {
      return Evaluate(path)["sim3_least_squares"]["translation_rmse_m"];
    };
    EXPECT_LE(error("sparse" + seed + "/0"), error("global/0"))
        << "seed " << seed;
  }
}

TEST_F(ChainTest, TwiceIsOnceAndTheRestorerUndoes) {
  Make("--num_images 40 --seed 3");
  Import();
  const auto rows = [&] {
    std::string text;
    const std::string dump = folder_.File("dump");
    EXPECT_EQ(std::system(("sqlite3 " + database_ +
                           " \"select pair_id, rows, config, hex(data), "
                           "hex(qvec), hex(tvec), hex(E) from "
                           "two_view_geometries order by pair_id\" > " +
                           dump)
                              .c_str()),
              0);
    return ReadBytes(dump);
  };
  const std::string original = rows();
  ASSERT_FALSE(original.empty());
  ExpectSuccess(GlobalArguments("global"));
  const std::string once = rows();
  EXPECT_NE(once, original);
  ExpectSuccess(GlobalArguments("again"));
  EXPECT_EQ(rows(), once);
  EXPECT_EQ(ModelBytes("again"), ModelBytes("global"));
  ExpectSuccess("adasfm_restorer --database_path " + database_);
  EXPECT_EQ(rows(), original);
}

// The coarse stage estimates a focal length that is not marked as known. The
// mapper uses the estimate, though the database has the wrong focal length.
TEST_F(ChainTest, TheMapperTakesTheCoarseModelsCameras) {
  Make("--num_images 80 --seed 4");
  Import();
  Sql("UPDATE cameras SET prior_focal_length = 0");
  ExpectSuccess(GlobalArguments());
  const std::string fixed =
      " --AdaSfmMapper.refine_focal_length 0 "
      "--AdaSfmMapper.refine_extra_params 0";
  Run run = ExpectSuccess(MapperArguments("right") + fixed);
  EXPECT_EQ(run.out.find("coarse model's camera"), std::string::npos);
  ScaleFocalLengths(1.05);
  ExpectSuccess(GlobalArguments());
  run = ExpectSuccess(MapperArguments("wrong") + fixed);
  EXPECT_NE(run.out.find("coarse model's camera"), std::string::npos);
  EXPECT_NEAR(FocalLength("wrong/0") / FocalLength("right/0"), 1.0, 0.003);
  EXPECT_EQ(FocalLength("wrong/0"), FocalLength("global/0"));
  ExpectGoodMetricModel(Evaluate("wrong/0"), 80);
}

// A guessed SIMPLE_RADIAL camera becomes a RADIAL camera, in the models only.
// If the database marks its camera as known, the mapper keeps that one.
TEST_F(ChainTest, TheMapperTakesALensWithMoreTerms) {
  Make("--num_images 80 --seed 4");
  const double focal_px = ReadFocalLength();
  ForgetTheCamera();
  Import();
  ExpectSuccess(GlobalArguments());
  Run run = ExpectSuccess(MapperArguments());
  EXPECT_NE(run.out.find("coarse model's camera"), std::string::npos);
  EXPECT_EQ(CameraOf("sparse/0").ModelName(), "RADIAL");
  EXPECT_NEAR(FocalLength("sparse/0"), focal_px, 0.01 * focal_px);
  ExpectGoodMetricModel(Evaluate("sparse/0"), 80);
  Sql("UPDATE cameras SET prior_focal_length = 1");
  run = ExpectSuccess(MapperArguments("known"));
  EXPECT_EQ(run.out.find("coarse model's camera"), std::string::npos);
  EXPECT_EQ(CameraOf("known/0").ModelName(), "SIMPLE_RADIAL");
}

// Without sensors nothing connects the two sides of a dark gap. A coarse model
// that joins them by an arbitrary relative pose ends as one model per side.
TEST_F(ChainTest, StretchesThatACoarseModelJoinsByAGuessAreAModelEach) {
  Make("--num_images 90 --seed 5 --num_blackouts 1 --blackout_images 14");
  ExpectSuccess(GlobalArguments("apart"));
  auto joined = ReadModel(folder_.File("apart/0"));
  const auto second = ReadModel(folder_.File("apart/1"));
  ASSERT_TRUE(joined.ok() && second.ok());
  const size_t num_images[] = {joined->NumRegImages(), second->NumRegImages()};
  ASSERT_GE(num_images[1], 20u);
  const Rigid3d guess(Eigen::Quaterniond(0.8, 0.0, 0.6, 0.0),
                      Eigen::Vector3d(3.0, -2.0, 1.0));
  for (const image_t image_id : RegisteredImages(*second)) {
    colmap::Image image;
    image.SetImageId(image_id);
    image.SetCameraId(second->Image(image_id).CameraId());
    image.SetName(second->Image(image_id).Name());
    joined->AddImage(image);
    joined->RegisterImage(image_id);
    SetCamFromWorld(CamFromWorld(second->Image(image_id)) * guess,
                    &joined->Image(image_id));
  }
  ASSERT_TRUE(WriteModelFolder(folder_.File("global"), {&*joined}).ok());
  ExpectSuccess(MapperArguments());
  for (int k = 0; k < 2; ++k) {
    const nlohmann::json evaluation = Evaluate("sparse/" + std::to_string(k));
    EXPECT_EQ(evaluation["num_images"], num_images[k]);
    EXPECT_LT(evaluation["sim3_least_squares"]["translation_rmse_m"], 0.5);
  }
}

TEST_F(ChainTest, WithoutSensorsThereIsOneWarningAndAModel) {
  Make("--num_images 60 --seed 4");
  const Run run = ExpectSuccess(GlobalArguments());
  EXPECT_EQ(CountOf(run.out + run.err, "WARNING"), 1) << run.out << run.err;
  ExpectSuccess(MapperArguments());
  const nlohmann::json evaluation = Evaluate("sparse/0");
  EXPECT_EQ(evaluation["num_images"], 60);
  // 90 m without metres or loops: COLMAP's mapper drifts by as much.
  EXPECT_LT(evaluation["sim3_least_squares"]["translation_rmse_m"], 0.5);
}

TEST_F(ChainTest, WrongInputIsOneLineAndChangesNothing) {
  Make("--num_images 12 --seed 1");
  const std::string before = ReadBytes(database_);
  const std::string output = " --output_path " + folder_.File("out_folder");
  const std::string text = folder_.Write("text.db", "not a database");
  const std::string empty = folder_.Write("empty.db", "");
  const std::string below_file = folder_.Write("file", "x") + "/out";
  for (const std::string& database :
       {folder_.File("missing.db"), text, empty}) {
    ExpectError("adasfm_global --database_path " + database + output, database);
  }
  EXPECT_FALSE(std::filesystem::exists(folder_.File("missing.db")));
  ExpectError("adasfm_global --database_path " + database_ + " --output_path " +
                  below_file,
              below_file);
  ExpectError("adasfm_global --database_path " + database_ + output +
                  " --AdaSfmGlobal.max_epipolar_error_px -1",
              "max_epipolar_error_px");
  ExpectError("adasfm_mapper --database_path " + database_ + output +
                  " --input_path " + folder_.File("none"),
              "run adasfm_global first");
  ExpectError("adasfm_synthesizer --output_path " + below_file, below_file);
  ExpectError("adasfm_synthesizer --num_images 0" + output, "num_images");
  EXPECT_EQ(ReadBytes(database_), before);
}

}  // namespace
}  // namespace adasfm
