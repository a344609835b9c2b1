// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/report/report_scene.h"

#include <algorithm>
#include <limits>

#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/report/report_html.h"
#include "core/sim3d.h"
#include "core/so3.h"

namespace adasfm {
namespace {

using PoseOfImage = std::optional<Rigid3d> ReportImage::*;
using ErrorOfImage = std::optional<double> ReportImage::*;

// The up direction in the world: opposite to measured gravity, else the mean
// direction of the cameras' upper edges, as photos are usually upright.
Eigen::Vector3d EstimateUp(const PriorTables& priors,
                           const ReportScene& scene) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const GravityRow& row : priors.gravity) {
    const auto index = scene.index_of_id.find(row.image_id);
    if (index == scene.index_of_id.end()) continue;
    const std::optional<Rigid3d>& pose =
        scene.images[index->second].cam_from_world;
    if (pose) up -= pose->rotation.conjugate() * row.gravity_in_cam;
  }
  if (up.norm() > 1e-6) return up.normalized();
  for (const ReportImage& image : scene.images) {
    if (!image.cam_from_world) continue;
    up -= image.cam_from_world->rotation.conjugate() * Eigen::Vector3d::UnitY();
  }
  return up.norm() > 1e-6 ? up.normalized() : Eigen::Vector3d::UnitZ();
}

Eigen::Quaterniond LevelFromWorld(const Eigen::Vector3d& up) {
  // An almost levelled model keeps its axes exactly.
  if (AngleBetweenRad(up, Eigen::Vector3d::UnitZ()) < DegToRad(3.0)) {
    return Eigen::Quaterniond::Identity();
  }
  return Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ());
}

// Sets the errors of one model's poses; returns the alignment, none on failure.
std::optional<Sim3d> MeasureErrors(
    const std::map<std::string, Rigid3d>& true_cams_from_world, bool is_metric,
    PoseOfImage pose, ErrorOfImage error, ReportScene* scene) {
  std::vector<Eigen::Vector3d> centers, true_centers;
  std::vector<ReportImage*> images;
  for (ReportImage& image : scene->images) {
    const auto truth = true_cams_from_world.find(image.name);
    if (!(image.*pose) || truth == true_cams_from_world.end()) continue;
    centers.push_back((image.*pose)->TargetOriginInSource());
    true_centers.push_back(truth->second.TargetOriginInSource());
    images.push_back(&image);
  }
  AlignmentOptions options;
  options.estimate_scale = !is_metric;
  Sim3d truth_from_model;
  if (!EstimateSim3d(centers, true_centers, options, &truth_from_model)) {
    return std::nullopt;
  }
  for (size_t i = 0; i < images.size(); ++i) {
    images[i]->*error =
        (truth_from_model * centers[i] - true_centers[i]).norm();
  }
  return truth_from_model;
}

void Append(const Eigen::Vector3d& vector, std::vector<float>* values) {
  for (int i = 0; i < 3; ++i) values->push_back(vector(i));
}

// Levelled camera centres, NaN where there is none.
nlohmann::json PackCenters(const ReportScene& scene, PoseOfImage pose) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> values;
  bool any = false;
  for (const ReportImage& image : scene.images) {
    if (image.*pose) {
      any = true;
      Append(scene.level_from_world * (image.*pose)->TargetOriginInSource(),
             &values);
    } else {
      values.insert(values.end(), 3, kNone);
    }
  }
  return any ? PackFloats(values) : nlohmann::json();
}

nlohmann::json PackErrors(const ReportScene& scene, ErrorOfImage error) {
  std::vector<float> values;
  bool any = false;
  for (const ReportImage& image : scene.images) {
    any = any || (image.*error).has_value();
    values.push_back(
        (image.*error).value_or(std::numeric_limits<double>::quiet_NaN()));
  }
  return any ? PackFloats(values) : nlohmann::json();
}

}  // namespace

ReportScene BuildReportScene(
    const std::map<image_t, std::string>& database_images,
    const colmap::Reconstruction& reconstruction,
    const colmap::Reconstruction* coarse, const PriorTables& priors) {
  std::map<std::string, ReportImage> by_name;
  for (const auto& [image_id, name] : database_images) {
    by_name[name].image_id = image_id;
  }
  const auto add = [&by_name](const colmap::Reconstruction& model,
                              PoseOfImage pose) {
    for (const image_t image_id : model.RegImageIds()) {
      const colmap::Image& image = model.Image(image_id);
      ReportImage& entry = by_name[image.Name()];
      if (entry.image_id == kInvalidImageId) entry.image_id = image_id;
      entry.*pose = CamFromWorld(image);
    }
  };
  add(reconstruction, &ReportImage::cam_from_world);
  if (coarse != nullptr) add(*coarse, &ReportImage::coarse_cam_from_world);

  std::map<image_t, timestamp_t> times;
  for (const ImageTimeRow& row : priors.image_times) {
    times[row.image_id] = row.timestamp_ns;
  }
  ReportScene scene;
  bool all_have_times = true;
  for (auto& [name, image] : by_name) {
    image.name = name;
    const auto time = times.find(image.image_id);
    if (time != times.end()) image.timestamp_ns = time->second;
    all_have_times = all_have_times && image.timestamp_ns.has_value();
    scene.images.push_back(image);
  }
  if (all_have_times) {
    std::stable_sort(scene.images.begin(), scene.images.end(),
                     [](const ReportImage& a, const ReportImage& b) {
                       return *a.timestamp_ns < *b.timestamp_ns;
                     });
  }
  for (size_t i = 0; i < scene.images.size(); ++i) {
    scene.index_of_name[scene.images[i].name] = i;
    scene.index_of_id[scene.images[i].image_id] = i;
  }
  scene.level_from_world = LevelFromWorld(EstimateUp(priors, scene));
  return scene;
}

void ChainPriors(const std::vector<RelativePosePrior>& priors,
                 ReportScene* scene) {
  int run = -1;
  for (const RelativePosePrior& prior : priors) {
    const auto index1 = scene->index_of_id.find(prior.image_id1);
    const auto index2 = scene->index_of_id.find(prior.image_id2);
    if (index1 == scene->index_of_id.end() ||
        index2 == scene->index_of_id.end() || !prior.HasRotation() ||
        !prior.HasDirection() || !prior.HasLength()) {
      continue;
    }
    ReportImage& image1 = scene->images[index1->second];
    ReportImage& image2 = scene->images[index2->second];
    if (!image1.prior_cam_from_world) {
      if (!image1.cam_from_world) continue;
      image1.prior_cam_from_world = image1.cam_from_world;
      image1.prior_run = ++run;
    }
    image2.prior_cam_from_world =
        prior.cam2_from_cam1 * *image1.prior_cam_from_world;
    image2.prior_run = image1.prior_run;
  }
}

void MarkParts(const std::vector<std::vector<image_t>>& parts,
               ReportScene* scene) {
  for (size_t k = 0; k < parts.size(); ++k) {
    for (const image_t image_id : parts[k]) {
      const auto index = scene->index_of_id.find(image_id);
      if (index == scene->index_of_id.end()) continue;
      ReportImage& image = scene->images[index->second];
      if (image.num_parts++ == 0) image.part = k;
    }
  }
}

void AlignTruth(const std::map<std::string, Rigid3d>& true_cams_from_world,
                bool is_metric, ReportScene* scene) {
  const std::optional<Sim3d> truth_from_model =
      MeasureErrors(true_cams_from_world, is_metric,
                    &ReportImage::cam_from_world, &ReportImage::error_m, scene);
  MeasureErrors(true_cams_from_world, is_metric,
                &ReportImage::coarse_cam_from_world,
                &ReportImage::coarse_error_m, scene);
  if (!truth_from_model) return;
  const Sim3d model_from_truth = truth_from_model->Inverse();
  for (ReportImage& image : scene->images) {
    const auto truth = true_cams_from_world.find(image.name);
    if (truth == true_cams_from_world.end()) continue;
    image.true_center = model_from_truth * truth->second.TargetOriginInSource();
  }
}

nlohmann::json SceneToJson(const ReportScene& scene) {
  nlohmann::json json;
  json["names"] = nlohmann::json::array();
  std::vector<float> axes, truth;
  std::vector<uint16_t> parts, num_parts, runs;
  bool any_truth = false;
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  for (const ReportImage& image : scene.images) {
    json["names"].push_back(image.name);
    // Rows of the rotation: the camera's right, down and forward axes.
    const Eigen::Matrix3d rotation =
        image.cam_from_world.value_or(Rigid3d()).rotation.toRotationMatrix() *
        scene.level_from_world.conjugate().toRotationMatrix();
    for (int row = 0; row < 3; ++row) Append(rotation.row(row), &axes);
    any_truth = any_truth || image.true_center.has_value();
    if (image.true_center) {
      Append(scene.level_from_world * *image.true_center, &truth);
    } else {
      truth.insert(truth.end(), 3, kNone);
    }
    parts.push_back(image.part + 1);
    num_parts.push_back(image.num_parts);
    runs.push_back(image.prior_run + 1);
  }
  json["axes"] = PackFloats(axes);
  json["final"] = PackCenters(scene, &ReportImage::cam_from_world);
  json["coarse"] = PackCenters(scene, &ReportImage::coarse_cam_from_world);
  json["prior"] = PackCenters(scene, &ReportImage::prior_cam_from_world);
  json["prior_run"] = PackUint16(runs);
  json["truth"] = any_truth ? PackFloats(truth) : nlohmann::json();
  json["error"] = PackErrors(scene, &ReportImage::error_m);
  json["coarse_error"] = PackErrors(scene, &ReportImage::coarse_error_m);
  json["part"] = PackUint16(parts);
  json["num_parts"] = PackUint16(num_parts);
  return json;
}

nlohmann::json PointsToJson(const colmap::Reconstruction& reconstruction,
                            const ReportScene& scene, int max_num_points) {
  std::vector<colmap::point3D_t> ids;
  for (const auto& entry : reconstruction.Points3D())
    ids.push_back(entry.first);
  std::sort(ids.begin(), ids.end());
  const size_t count = std::min<size_t>(ids.size(), max_num_points);
  std::vector<float> positions;
  std::vector<unsigned char> colors;
  bool any_color = false;
  for (size_t i = 0; i < count; ++i) {
    const colmap::Point3D& point =
        reconstruction.Point3D(ids[i * ids.size() / count]);
    Append(scene.level_from_world * XyzOf(point), &positions);
    for (int k = 0; k < 3; ++k) {
      colors.push_back(ColorOf(point)(k));
      any_color = any_color || ColorOf(point)(k) != 0;
    }
  }
  nlohmann::json json = {{"count", count}, {"xyz", PackFloats(positions)}};
  if (any_color) json["rgb"] = PackBytes(colors);
  return json;
}

}  // namespace adasfm
