// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/evaluation/evaluation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>
#include <sstream>

#include "core/random.h"
#include "core/sim3d.h"
#include "core/so3.h"
#include "tests/testing/colmap_ext/temporary_folder.h"
#include "tests/testing/paths.h"

namespace adasfm {
namespace {

NamedPoses MakePoses(uint64_t seed, int num_images) {
  Random random(seed);
  NamedPoses poses;
  for (int i = 0; i < num_images; ++i) {
    char name[32];
    std::snprintf(name, sizeof(name), "%019lld.png",
                  1000000000ll + i * 50000000ll);
    poses[name] = CamFromWorldWithCenter(
        ExpSo3(random.GaussianVector(1.0)),
        Eigen::Vector3d(i, 0.02 * i * i, 0.0) + random.GaussianVector(0.3));
  }
  return poses;
}

NamedPoses Transform(const Sim3d& new_from_old, const NamedPoses& poses) {
  NamedPoses transformed;
  for (const auto& [name, pose] : poses) {
    transformed[name] = TransformCamFromWorld(new_from_old, pose);
  }
  return transformed;
}

NamedPoses Perturb(const NamedPoses& poses, double rotation_sigma_rad,
                   double center_sigma_m, Random* random) {
  NamedPoses perturbed;
  for (const auto& [name, pose] : poses) {
    perturbed[name] = CamFromWorldWithCenter(
        ExpSo3(random->GaussianVector(rotation_sigma_rad)) * pose.rotation,
        pose.TargetOriginInSource() + random->GaussianVector(center_sigma_m));
  }
  return perturbed;
}

std::string PoseLines(const NamedPoses& poses) {
  std::ostringstream text;
  text.precision(17);
  for (const auto& [name, pose] : poses) {
    text << name << " " << pose.rotation.w() << " " << pose.rotation.x() << " "
         << pose.rotation.y() << " " << pose.rotation.z() << " "
         << pose.translation.transpose() << "\n";
  }
  return text.str();
}

// A model of poses and a few points, written as COLMAP does.
void WriteModel(const NamedPoses& poses, const std::string& path) {
  colmap::Reconstruction model;
  colmap::Camera camera;
  camera.SetCameraId(1);
  camera.InitializeWithName("PINHOLE", 500.0, 800, 500);
  model.AddCamera(camera);
  image_t image_id = 0;
  for (const auto& [name, pose] : poses) {
    colmap::Image image;
    image.SetImageId(++image_id);
    image.SetCameraId(1);
    image.SetName(name);
    image.SetQvec(Eigen::Vector4d(pose.rotation.w(), pose.rotation.x(),
                                  pose.rotation.y(), pose.rotation.z()));
    image.SetTvec(pose.translation);
    image.SetPoints2D(std::vector<Eigen::Vector2d>(20, {400.0, 250.0}));
    model.AddImage(image);
    model.RegisterImage(image_id);
  }
  for (int k = 0; k < 20; ++k) {
    colmap::Track track;
    for (int i = 0; i < 2 + k % 3; ++i) track.AddElement(1 + i, k);
    const colmap::point3D_t id = model.AddPoint3D(
        Eigen::Vector3d(k, 1.0, 2.0), track, Eigen::Vector3ub::Zero());
    model.Point3D(id).SetError(0.1 * k);
  }
  std::filesystem::create_directories(path);
  model.WriteBinary(path);
}

TEST(EvaluatePoses, ASimilarityIsNoError) {
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    const NamedPoses truth = MakePoses(seed, 40);
    const Sim3d model_from_true(random.Uniform(0.1, 10.0),
                                ExpSo3(random.GaussianVector(1.0)),
                                random.GaussianVector(20.0));
    const StatusOr<Evaluation> evaluation =
        EvaluatePoses(Transform(model_from_true, truth), truth);
    ASSERT_TRUE(evaluation.ok());
    for (const AlignmentErrors& errors :
         {evaluation->sim3, evaluation->sim3_least_squares}) {
      EXPECT_NEAR(errors.scale * model_from_true.scale, 1.0, 1e-9);
      EXPECT_LT(errors.translation_max_m, 1e-6);
      EXPECT_LT(errors.rotation_mean_deg, 1e-5);
    }
    EXPECT_EQ(evaluation->se3.scale, 1.0);
    for (const RelativePoseAuc& auc : evaluation->relative_pose_auc) {
      EXPECT_NEAR(auc.rotation_percent, 100.0, 0.01);
      EXPECT_NEAR(auc.translation_percent, 100.0, 0.01);
    }
  }
}

TEST(EvaluatePoses, MetricAlignmentSeesAWrongScale) {
  const NamedPoses truth = MakePoses(1, 40);
  const Sim3d larger(1.1, Eigen::Quaterniond::Identity(),
                     Eigen::Vector3d::Zero());
  const StatusOr<Evaluation> evaluation =
      EvaluatePoses(Transform(larger, truth), truth);
  ASSERT_TRUE(evaluation.ok());
  EXPECT_NEAR(evaluation->sim3.scale, 1.0 / 1.1, 1e-9);
  // The error is a tenth of the spread of the centres about their mean.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [name, pose] : truth) {
    mean += pose.TargetOriginInSource() / truth.size();
  }
  double sum = 0.0;
  for (const auto& [name, pose] : truth) {
    sum += (pose.TargetOriginInSource() - mean).squaredNorm();
  }
  EXPECT_NEAR(evaluation->se3_least_squares.translation_rmse_m,
              0.1 * std::sqrt(sum / truth.size()), 1e-6);
}

TEST(EvaluatePoses, ErrorsAreThoseOfTheNoise) {
  const double center_sigma_m = 0.05;
  const double rotation_sigma_rad = 0.01;
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    const NamedPoses truth = MakePoses(seed, 400);
    const StatusOr<Evaluation> evaluation = EvaluatePoses(
        Perturb(truth, rotation_sigma_rad, center_sigma_m, &random), truth);
    ASSERT_TRUE(evaluation.ok());
    // The norm of three normal errors; 1,200 of them determine it to 4 % (2
    // sigma).
    EXPECT_NEAR(evaluation->sim3_least_squares.translation_rmse_m,
                std::sqrt(3.0) * center_sigma_m, 0.05 * center_sigma_m * 2.0);
    // The mean of a Maxwell distribution is 1.596 sigma.
    EXPECT_NEAR(evaluation->sim3.rotation_mean_deg,
                RadToDeg(1.596 * rotation_sigma_rad), 0.1);
  }
}

TEST(EvaluatePoses, OrientationsAreComparedOnAStraightRoadToo) {
  const double rotation_sigma_rad = 0.01;
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    NamedPoses truth = MakePoses(seed, 400);
    double x = 0.0;
    for (auto& [name, pose] : truth) {
      const Eigen::Vector3d center = Eigen::Vector3d::UnitX() * x++;
      pose = CamFromWorldWithCenter(pose.rotation, center);
    }
    // One image in ten has a grossly wrong orientation.
    NamedPoses model = Perturb(truth, rotation_sigma_rad, 0.01, &random);
    int count = 0;
    for (auto& [name, pose] : model) {
      if (++count % 10 == 0) {
        pose.rotation = ExpSo3(Eigen::Vector3d::UnitY()) * pose.rotation;
      }
    }
    const StatusOr<Evaluation> evaluation = EvaluatePoses(model, truth);
    ASSERT_TRUE(evaluation.ok());
    // With one outlier in ten the median is the 0.556-quantile of a Maxwell
    // distribution, 1.64 sigma; 400 samples determine it to 0.04 sigma.
    EXPECT_NEAR(evaluation->orientation_median_deg,
                RadToDeg(1.64 * rotation_sigma_rad), 0.1);
  }
}

TEST(EvaluatePoses, WildCamerasDoNotMoveTheRobustAlignment) {
  const NamedPoses truth = MakePoses(1, 50);
  NamedPoses model = truth;
  int count = 0;
  for (auto& [name, pose] : model) {
    if (++count % 10 == 0) pose.translation.x() += 500.0;
  }
  const StatusOr<Evaluation> evaluation = EvaluatePoses(model, truth);
  ASSERT_TRUE(evaluation.ok());
  EXPECT_LT(evaluation->se3.translation_median_m, 1e-6);
  EXPECT_GT(evaluation->se3_least_squares.translation_median_m, 1.0);
  EXPECT_NEAR(evaluation->se3.translation_max_m, 500.0, 1e-3);
}

TEST(EvaluatePoses, AucIsTheAreaUnderTheRecallCurve) {
  // One image of four is turned by 2 degrees: half of the six pairs are off.
  NamedPoses truth = MakePoses(1, 4);
  NamedPoses model = truth;
  Rigid3d& turned = model.begin()->second;
  turned = CamFromWorldWithCenter(
      ExpSo3(DegToRad(2.0) * Eigen::Vector3d::UnitX()) * turned.rotation,
      turned.TargetOriginInSource());
  const StatusOr<Evaluation> evaluation = EvaluatePoses(model, truth);
  ASSERT_TRUE(evaluation.ok());
  const std::map<double, double> expected = {
      {1.0, 50.0}, {5.0, 50.0 + 50.0 * 0.6}, {20.0, 50.0 + 50.0 * 0.9}};
  for (const RelativePoseAuc& auc : evaluation->relative_pose_auc) {
    const auto value = expected.find(auc.threshold_deg);
    if (value == expected.end()) continue;
    EXPECT_NEAR(auc.rotation_percent, value->second, 1e-3);
  }
}

TEST(EvaluatePoses, TooFewOrCoincidentImagesAreAnError) {
  NamedPoses two = MakePoses(1, 2);
  EXPECT_FALSE(EvaluatePoses(two, two).ok());
  NamedPoses coincident = MakePoses(1, 5);
  for (auto& [name, pose] : coincident) pose.translation.setZero();
  EXPECT_FALSE(EvaluatePoses(coincident, MakePoses(1, 5)).ok());
}

TEST(ReadGroundTruth, LinesModelAndTrajectoryAgree) {
  const TemporaryFolder folder;
  const NamedPoses poses = MakePoses(1, 20);
  std::vector<std::string> names;
  std::ostringstream trajectory;
  trajectory.precision(17);
  for (const auto& [name, pose] : poses) {
    names.push_back(name);
    const Rigid3d world_from_cam = pose.Inverse();
    const Eigen::Quaterniond& q = world_from_cam.rotation;
    trajectory << std::stod(name.substr(0, 19)) * 1e-9 << " "
               << world_from_cam.translation.transpose() << " " << q.x() << " "
               << q.y() << " " << q.z() << " " << q.w() << "\n";
  }
  WriteModel(poses, folder.File("model"));
  for (const std::string& path :
       {folder.Write("gt.txt", PoseLines(poses)), folder.File("model"),
        folder.Write("tum.txt", trajectory.str()),
        folder.Write("windows.txt", "\xEF\xBB\xBF" + PoseLines(poses)),
        folder.Write("windows_tum.txt", "\xEF\xBB\xBF" + trajectory.str())}) {
    const StatusOr<NamedPoses> read =
        ReadGroundTruth(path, names, GroundTruthOptions());
    ASSERT_TRUE(read.ok()) << read.status().message();
    ASSERT_EQ(read->size(), poses.size()) << path;
    for (const auto& [name, pose] : poses) {
      EXPECT_LT(AngleBetweenRad(read->at(name).rotation, pose.rotation), 1e-6);
      EXPECT_LT(
          (read->at(name).TargetOriginInSource() - pose.TargetOriginInSource())
              .norm(),
          1e-5);
    }
  }
  // Between poses further apart than allowed nothing is interpolated.
  GroundTruthOptions strict;
  strict.max_time_gap_s = 1e-6;
  const StatusOr<NamedPoses> sparse = ReadGroundTruth(
      folder.File("tum.txt"), {"0000000001025000000.png"}, strict);
  EXPECT_FALSE(sparse.ok());
}

TEST(ReadGroundTruth, MalformedFilesAreErrors) {
  const TemporaryFolder folder;
  for (const std::string& path :
       {folder.File("missing.txt"), folder.Write("empty.txt", ""),
        folder.Write("short.txt", "a.png 1 0 0 0 1 2\n"),
        folder.Write("turn.txt", "a.png 2 0 0 0 1 2 3\n"),
        folder.Write("twice.txt", "a.png 1 0 0 0 1 2 3\na.png 1 0 0 0 1 2 3\n"),
        folder.Path()}) {
    const StatusOr<NamedPoses> read =
        ReadGroundTruth(path, {}, GroundTruthOptions());
    EXPECT_FALSE(read.ok()) << path;
    EXPECT_EQ(read.status().message().find('\n'), std::string::npos);
  }
}

double FigureOf(const std::string& line, const std::string& key) {
  const size_t begin = line.find(" " + key + "=");
  if (begin == std::string::npos) return NAN;
  return std::stod(line.substr(begin + key.size() + 2));
}

TEST(EvaluateModel, AgreesWithTheReferenceScript) {
  const std::string script = SourceDir() + "/../shared/tools/evalmodel.py";
  if (!std::filesystem::exists(script)) {
    GTEST_SKIP() << "no " << script;
  }
  const TemporaryFolder folder;
  for (const uint64_t seed : {1, 2, 3}) {
    Random random(seed);
    const NamedPoses truth = MakePoses(seed, 60);
    NamedPoses model = Transform(Sim3d(0.5, ExpSo3(random.GaussianVector(1.0)),
                                       random.GaussianVector(5.0)),
                                 Perturb(truth, 0.02, 0.1, &random));
    model.begin()->second.translation.x() += 20.0;
    const std::string path = folder.File("model" + std::to_string(seed));
    WriteModel(model, path);
    const std::string truth_path = folder.Write("gt.txt", PoseLines(truth));
    const std::string output = folder.File("figures.txt");
    if (std::system(("/usr/bin/python3 " + script + " " + truth_path + " " +
                     path + " > " + output + " 2>/dev/null")
                        .c_str()) != 0) {
      GTEST_SKIP() << "the script needs python3 with numpy";
    }
    const std::string line = ReadBytes(output);
    StatusOr<colmap::Reconstruction> reconstruction =
        StatusOr<colmap::Reconstruction>(colmap::Reconstruction());
    reconstruction->ReadBinary(path);
    const StatusOr<Evaluation> evaluation =
        EvaluateModel(*reconstruction, truth);
    ASSERT_TRUE(evaluation.ok());
    // The script prints three or four digits.
    EXPECT_NEAR(evaluation->sim3_least_squares.translation_rmse_m,
                FigureOf(line, "ate_rmse_m"), 6e-4);
    EXPECT_NEAR(evaluation->sim3.translation_median_m,
                FigureOf(line, "ate_median_m"), 6e-4);
    EXPECT_NEAR(evaluation->sim3.translation_max_m, FigureOf(line, "ate_max_m"),
                6e-4);
    EXPECT_NEAR(evaluation->sim3.rotation_mean_deg,
                FigureOf(line, "rot_mean_deg"), 6e-4);
    EXPECT_NEAR(evaluation->sim3.rotation_median_deg,
                FigureOf(line, "rot_med_deg"), 6e-4);
    EXPECT_NEAR(evaluation->sim3.scale, FigureOf(line, "scale"), 6e-5);
    EXPECT_EQ(evaluation->num_points, FigureOf(line, "pts"));
    EXPECT_NEAR(evaluation->mean_track_length, FigureOf(line, "len"), 6e-3);
    EXPECT_NEAR(evaluation->rmse_px, FigureOf(line, "rmse_px"), 6e-4);
  }
}

}  // namespace
}  // namespace adasfm
