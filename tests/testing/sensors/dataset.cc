// SPDX-License-Identifier: BSD-3-Clause
#include "tests/testing/sensors/dataset.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "core/so3.h"
#include "sensors/io/read_image_times.h"
#include "sensors/io/read_imu.h"
#include "sensors/io/read_wheel.h"
#include "tests/testing/paths.h"

namespace adasfm {
namespace {

template <typename T>
T Require(StatusOr<T> value) {
  if (!value.ok()) throw std::runtime_error(value.status().message());
  return std::move(value.value());
}

double MeanSquare(double sum, int count) {
  return count > 0 ? sum / count : 0.0;
}

}  // namespace

bool ReadDataset(const std::string& name, Dataset* dataset) {
  const std::string folder = SourceDir() + "/../shared/data/" + name;
  if (!std::filesystem::exists(folder + "/gt.txt")) return false;
  dataset->calibration =
      Require(ReadSensorCalibration(folder + "/sensors.yaml"));
  dataset->logs.imu = Require(ReadImu(folder + "/imu.csv"));
  dataset->logs.wheel = Require(
      ReadWheel(folder + "/wheel.csv", dataset->calibration.wheel_type));
  std::map<std::string, image_t> ids;
  for (const ImageTime& time : Require(ReadImageTimes(folder + "/times.csv"))) {
    const image_t id = static_cast<image_t>(dataset->images.size() + 1);
    dataset->images.push_back({id, time.name, time.timestamp_ns});
    ids[time.name] = id;
  }
  std::ifstream truth(folder + "/gt.txt");
  for (std::string line; std::getline(truth, line);) {
    std::istringstream stream(line);
    std::string image;
    double q[4], t[3];
    stream >> image >> q[0] >> q[1] >> q[2] >> q[3] >> t[0] >> t[1] >> t[2];
    dataset->cams_from_world[ids.at(image)] =
        Rigid3d(Eigen::Quaterniond(q[0], q[1], q[2], q[3]),
                Eigen::Vector3d(t[0], t[1], t[2]));
  }
  return true;
}

PriorEstimate EstimateOrThrow(const Dataset& dataset) {
  const StatusOr<PriorEstimate> estimate =
      EstimatePriors(dataset.images, dataset.logs, dataset.calibration, {}, {});
  if (!estimate.ok()) throw std::runtime_error(estimate.status().message());
  return *estimate;
}

SegmentErrors ComputeSegmentErrors(const PriorEstimate& estimate,
                                   const Dataset& dataset, double length_m) {
  // Chain of poses and the true distance driven.
  std::vector<Rigid3d> chain = {Rigid3d()}, truth;
  std::vector<double> distance = {0.0};
  truth.push_back(
      dataset.cams_from_world.at(estimate.priors.front().image_id1));
  for (const RelativePosePrior& prior : estimate.priors) {
    chain.push_back(prior.cam2_from_cam1 * chain.back());
    truth.push_back(dataset.cams_from_world.at(prior.image_id2));
    distance.push_back(distance.back() +
                       (truth.back().TargetOriginInSource() -
                        truth[truth.size() - 2].TargetOriginInSource())
                           .norm());
  }
  SegmentErrors errors;
  double translation = 0.0, rotation = 0.0;
  for (size_t i = 0; i < chain.size(); ++i) {
    size_t j = i;
    while (j < chain.size() && distance[j] - distance[i] < length_m) ++j;
    if (j == chain.size()) break;
    const Rigid3d estimated = chain[i] * chain[j].Inverse();
    const Rigid3d expected = truth[i] * truth[j].Inverse();
    const double length = distance[j] - distance[i];
    const double error =
        (estimated.translation - expected.translation).norm() / length;
    const double angle =
        RadToDeg(AngleBetweenRad(estimated.rotation, expected.rotation)) /
        length;
    translation += error * error;
    errors.mean_translation += error;
    rotation += angle * angle;
    ++errors.num_segments;
  }
  errors.translation = std::sqrt(MeanSquare(translation, errors.num_segments));
  errors.mean_translation =
      MeanSquare(errors.mean_translation, errors.num_segments);
  errors.rotation_deg_per_m =
      std::sqrt(MeanSquare(rotation, errors.num_segments));
  return errors;
}

PairErrors ComputePairErrors(
    const PriorEstimate& estimate,
    const std::map<image_t, Rigid3d>& cams_from_world) {
  PairErrors errors;
  double length = 0.0, true_length = 0.0;
  int count = 0;
  for (const RelativePosePrior& prior : estimate.priors) {
    const Rigid3d truth =
        ComputeCam2FromCam1(cams_from_world.at(prior.image_id1),
                            cams_from_world.at(prior.image_id2));
    Eigen::Matrix<double, 6, 1> error;
    error.head<3>() =
        LogSo3(truth.rotation * prior.cam2_from_cam1.rotation.conjugate());
    error.tail<3>() = truth.translation - prior.cam2_from_cam1.translation;
    errors.rotation_rms_deg += error.head<3>().squaredNorm();
    errors.rotation_chi2 += error.head<3>().dot(
        prior.covariance.topLeftCorner<3, 3>().ldlt().solve(error.head<3>()));
    length += prior.cam2_from_cam1.translation.norm();
    true_length += truth.translation.norm();
    ++count;
    if (!prior.HasLength() || !prior.HasDirection()) continue;
    errors.translation_rms_m += error.tail<3>().squaredNorm();
    errors.translation_chi2 += error.tail<3>().dot(
        prior.covariance.bottomRightCorner<3, 3>().ldlt().solve(
            error.tail<3>()));
    errors.chi2 += error.dot(prior.covariance.ldlt().solve(error));
  }
  errors.rotation_rms_deg =
      RadToDeg(std::sqrt(MeanSquare(errors.rotation_rms_deg, count)));
  errors.translation_rms_m =
      std::sqrt(MeanSquare(errors.translation_rms_m, count));
  errors.length_ratio = length / true_length;
  errors.rotation_chi2 = MeanSquare(errors.rotation_chi2, 3 * count);
  errors.translation_chi2 = MeanSquare(errors.translation_chi2, 3 * count);
  errors.chi2 = MeanSquare(errors.chi2, 6 * count);
  return errors;
}

}  // namespace adasfm
