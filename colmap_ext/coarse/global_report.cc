// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/global_report.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "colmap_ext/coarse/weak_places.h"
#include "core/so3.h"

namespace adasfm {
namespace {

using Json = nlohmann::ordered_json;

// Fewer pairs between two parts are not reported.
constexpr int kMinNumReportedPairs = 3;

Json ClosuresJson(const SceneData& scene,
                  const std::vector<UnconfirmedClosure>& closures) {
  Json json = Json::array();
  for (const UnconfirmedClosure& closure : closures) {
    json.push_back({{"name1", scene.images.at(closure.image_id1).name},
                    {"name2", scene.images.at(closure.image_id2).name},
                    {"pairs", closure.num_pairs},
                    {"images", closure.num_images}});
  }
  return json;
}

Json LoopClosuresJson(const LoopClosureReport& report) {
  return {{"pairs_tested", report.num_tested},
          {"pairs_contradicting", report.num_contradicting},
          {"loops", report.num_clusters},
          {"false_loops", report.num_false_clusters},
          {"pairs_of_false_loops", report.num_pairs_of_false_clusters}};
}

Json SegmentClosuresJson(const SceneData& scene,
                         const LoopClosureReport& report) {
  return {{"parts", report.num_segments},
          {"confirmed", report.num_confirmed_closures},
          {"pairs_removed", report.num_pairs_of_unconfirmed_closures},
          {"not_made", report.segments_were_split
                           ? ClosuresJson(scene, report.unconfirmed_closures)
                           : Json::array()}};
}

Json WeakPlacesJson(const SceneData& scene, const CoarsePoses& poses) {
  Json json = Json::array();
  for (const WeakPlace& place : FindWeakPlaces(poses)) {
    json.push_back({{"model1", place.model1},
                    {"model2", place.model2},
                    {"name1", scene.images.at(place.pair.image_id1).name},
                    {"name2", scene.images.at(place.pair.image_id2).name},
                    {"inliers", place.num_inliers},
                    {"pairs", place.num_pairs},
                    {"reason", EdgeRemovalName(place.removal)}});
  }
  return json;
}

std::string DescribeUnconfirmedClosure(const SceneData& scene,
                                       const UnconfirmedClosure& closure) {
  std::ostringstream text;
  text << "a trajectory segment of " << closure.num_images
       << " images is connected to another only by " << closure.num_pairs
       << " pairs like " << scene.images.at(closure.image_id1).name << " and "
       << scene.images.at(closure.image_id2).name
       << "; neither sensors nor a second place confirm them, so they may be "
          "places that look alike: the segments become two models "
          "(--AdaSfmGlobal.split_unconfirmed_closures 0 joins them)";
  return text.str();
}

Json MapperStartJson(const std::optional<MapperStart>& start) {
  if (!start) return nullptr;
  return {{"image_id1", start->pair.image_id1},
          {"image_id2", start->pair.image_id2},
          {"matches", start->num_matches},
          {"parallax_deg", RadToDeg(start->parallax_rad)},
          {"must_be_told", start->must_be_told}};
}

Json ModelJson(const SceneData& scene, const CoarseComponent& component,
               const CoarseModel& model) {
  const FocalLengthError focal =
      model.focal_length_error.value_or(FocalLengthError());
  Json rounds = Json::array();
  for (const PriorBundleAdjustmentSummary& round : model.rounds) {
    rounds.push_back({{"success", round.success},
                      {"images", round.num_images},
                      {"points", round.num_points},
                      {"residuals", round.num_residuals},
                      {"iterations", round.num_iterations},
                      {"min_num_shared_points", round.min_num_shared_points},
                      {"initial_cost", round.initial_cost},
                      {"final_cost", round.final_cost},
                      {"seconds", round.seconds},
                      {"message", round.message}});
  }
  return {{"images", model.reconstruction.NumRegImages()},
          {"images_without_points", model.num_images_without_points},
          {"images_with_few_points", model.num_images_with_few_points},
          {"tracks", model.num_tracks},
          {"keyframes", model.num_keyframes},
          {"max_track_bytes", model.max_track_bytes},
          {"points", model.num_points},
          {"observations", model.num_observations},
          {"mean_reproj_error_px", model.mean_reproj_error_px},
          {"min_triangulation_angle_deg", model.min_angle_deg},
          {"keypoint_sigma_px", model.keypoint_sigma_px},
          {"prior_chi2_per_dof", model.prior_chi2_per_dof},
          {"priors_agree", model.priors_agree},
          {"focal_length_ratio", focal.ratio},
          {"focal_length_camera",
           model.focal_length_error ? Json(focal.camera_id) : Json()},
          {"focal_length_ratio_sigma", focal.sigma},
          {"cameras_refined", model.cameras_refined},
          {"metric", model.metric},
          {"inertial_scale_sigma", model.inertial_scale_sigma},
          {"gravity_aligned", model.gravity_aligned},
          {"rotations_converged", component.rotations_converged},
          {"positions_converged", component.positions_converged},
          {"pairs_agree", model.pair_agreement.IsSound()},
          {"pair_agreement", model.pair_agreement.share},
          {"least_pair_agreement", model.pair_agreement.least_image_share},
          {"rotation_optimality", component.sdp_optimality},
          {"unconfirmed_closures",
           ClosuresJson(scene, component.unconfirmed_closures)},
          {"mapper_start", MapperStartJson(model.mapper_start)},
          {"adjustments", rounds}};
}

// The first image of a drive.
std::string DriveName(const SceneData& scene, int drive) {
  const auto prior = std::find_if(
      scene.priors.begin(), scene.priors.end(),
      [drive](const RelativePosePrior& prior) { return prior.drive == drive; });
  return scene.images.at(prior->image_id1).name;
}

bool HasSeveralDrives(const SceneData& scene) {
  return std::any_of(
      scene.priors.begin(), scene.priors.end(),
      [](const RelativePosePrior& prior) { return prior.drive > 0; });
}

Json CameraImuRotationJson(const std::string& drive_name,
                           const CameraImuRotationReport& camera_imu) {
  const Eigen::Matrix3d rotation =
      ExpSo3(camera_imu.rotation_rad).toRotationMatrix();
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) {
    rows.push_back({rotation(row, 0), rotation(row, 1), rotation(row, 2)});
  }
  return {{"first_image", drive_name},
          {"corrected", camera_imu.corrected},
          {"pairs", camera_imu.num_pairs},
          {"angle_deg", RadToDeg(camera_imu.rotation_rad.norm())},
          {"sigma_deg", RadToDeg(camera_imu.sigma_rad)},
          {"chi2", camera_imu.chi2},
          {"residual_variance", camera_imu.residual_variance},
          {"turn_deg",
           {RadToDeg(camera_imu.rotation_rad.x()),
            RadToDeg(camera_imu.rotation_rad.y()),
            RadToDeg(camera_imu.rotation_rad.z())}},
          {"true_from_stated", rows}};
}

void AppendLostImages(const SceneData& scene, const GlobalStageResult& result,
                      std::vector<std::string>* warnings) {
  size_t num_images = 0;
  for (const CoarseModel& model : result.models) {
    num_images += model.reconstruction.NumRegImages();
  }
  if (num_images < scene.images.size()) {
    warnings->push_back(
        std::to_string(scene.images.size() - num_images) + " of " +
        std::to_string(scene.images.size()) +
        " images are in no model: neither verified matches nor sensors "
        "connect them to others");
  }
  if (result.models.size() > 1) {
    warnings->push_back(
        "the images fall apart into " + std::to_string(result.models.size()) +
        " unconnected models, the largest of " +
        std::to_string(result.models[0].reconstruction.NumRegImages()) +
        " images: match more pairs, or add sensors that cover the gaps");
  }
}

// drive_name: empty for the only drive.
void AppendCameraImuWarning(const std::string& drive_name,
                            const CameraImuRotationReport& camera_imu,
                            std::vector<std::string>* warnings) {
  // Below this an error of the direction of driving is as likely, by the sigma
  // that the import states for it.
  constexpr double kMinNumSigmas = 3.0;
  if (!camera_imu.corrected ||
      camera_imu.rotation_rad.norm() < kMinNumSigmas * camera_imu.sigma_rad) {
    return;
  }
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << "the camera-IMU rotation ";
  if (!drive_name.empty()) text << "of the drive from " << drive_name << ' ';
  text << "is " << RadToDeg(camera_imu.rotation_rad.norm()) << " +- "
       << RadToDeg(camera_imu.sigma_rad)
       << " deg off what T_cam_imu says (turned by "
       << RadToDeg(camera_imu.rotation_rad.x()) << ", "
       << RadToDeg(camera_imu.rotation_rad.y()) << ", "
       << RadToDeg(camera_imu.rotation_rad.z())
       << " deg about the camera's x, y, z); priors were corrected. Put "
          "true_from_stated of summary.json, times T_cam_imu, into "
          "--sensors_path";
  warnings->push_back(text.str());
}

// drive_name: empty for the only drive.
void AppendTimeShiftWarning(const std::string& drive_name, double shift_s,
                            std::vector<std::string>* warnings) {
  // A smaller correction leaves no doubt in the model.
  constexpr double kMinShiftS = 0.01;
  if (std::abs(shift_s) < kMinShiftS) return;
  std::ostringstream text;
  text << std::fixed << std::setprecision(4) << "the camera's clock ";
  if (!drive_name.empty()) text << "of the drive from " << drive_name << ' ';
  text << "is off: add " << std::showpos << shift_s
       << " s to timeshift_cam_imu in --sensors_path";
  warnings->push_back(text.str());
}

void AppendGyroscopeWarning(const std::string& drive_name,
                            const Eigen::Matrix3d& scales,
                            std::vector<std::string>* warnings) {
  // Small gyroscopes have less.
  constexpr double kMinScale = 0.02;
  const double largest = scales.cwiseAbs().maxCoeff();
  if (largest < kMinScale) return;
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the gyroscope ";
  if (!drive_name.empty()) text << "of the drive from " << drive_name << ' ';
  text << "errs by up to " << 100.0 * largest
       << " % of the rates, or the focal length by as much: calibrate them";
  warnings->push_back(text.str());
}

void AppendPriorWarnings(const CoarseModel& model,
                         std::vector<std::string>* warnings) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1);
  if (model.focal_length_error) {
    const FocalLengthError& error = *model.focal_length_error;
    const bool is_known =
        HasPriorFocalLength(model.reconstruction.Camera(error.camera_id));
    text << std::setprecision(2)
         << "vision and sensors agree on a focal length that is "
         << 100.0 * std::abs(error.ratio - 1.0) << " +- " << 100.0 * error.sigma
         << " % " << (error.ratio > 1.0 ? "longer" : "shorter")
         << " than the database says";
    if (model.reconstruction.NumCameras() > 1) {
      text << " of camera " << error.camera_id;
    }
    if (model.cameras_refined && !is_known) {
      text << "; it was refined, as it is not marked as known";
    } else {
      text << ": check the intrinsics, or have them refined "
              "(--AdaSfmGlobal.ba_refine_focal_length 1 and "
              "--AdaSfmMapper.refine_focal_length 1)";
    }
  } else if (!model.priors_agree) {
    text << "vision and sensors contradict each other (mean squared whitened "
            "residual of the priors: "
         << model.prior_chi2_per_dof << ", even with a keypoint sigma of "
         << model.keypoint_sigma_px
         << " px): check the intrinsics, T_cam_imu, timeshift_cam_imu and the "
            "noise figures of the sensors";
  } else {
    return;
  }
  warnings->push_back(text.str());
}

}  // namespace

std::string FormatGlobalReportJson(const SceneData& scene,
                                   const GlobalStageResult& result,
                                   double total_seconds) {
  Json report;
  report["seconds"] = total_seconds;
  report["images"] = scene.images.size();
  report["pairs"] = scene.pairs.size();
  report["priors"] = scene.priors.size();
  Json removals = Json::object();
  for (const auto& [removal, count] : CountRemovals(result.poses.graph)) {
    removals[EdgeRemovalName(removal)] = count;
  }
  report["edges"] = removals;
  report["camera_imu_rotations"] = Json::array();
  for (const auto& [drive, camera_imu] : result.poses.camera_imu_rotations) {
    report["camera_imu_rotations"].push_back(
        CameraImuRotationJson(DriveName(scene, drive), camera_imu));
  }
  report["time_shifts"] = Json::array();
  for (const auto& [drive, shift_s] : result.time_shifts) {
    report["time_shifts"].push_back(
        {{"first_image", DriveName(scene, drive)}, {"shift_s", shift_s}});
  }
  report["gyroscope_scales"] = Json::array();
  for (const auto& [drive, scales] : result.gyroscope_scales) {
    Json rows = Json::array();
    for (const auto& row : scales.rowwise()) {
      rows.push_back({row.x(), row.y(), row.z()});
    }
    report["gyroscope_scales"].push_back(
        {{"first_image", DriveName(scene, drive)}, {"scales", rows}});
  }
  report["loop_closures"] = LoopClosuresJson(result.poses.loop_closures);
  report["segment_closures"] =
      SegmentClosuresJson(scene, result.poses.loop_closures);
  report["weak_places"] = WeakPlacesJson(scene, result.poses);
  for (size_t i = 0; i < result.models.size(); ++i) {
    report["models"].push_back(
        ModelJson(scene, result.poses.components[i], result.models[i]));
  }
  report["matches"] = {{"candidates", result.refinement.num_candidates},
                       {"kept", result.refinement.num_kept},
                       {"pairs_written", result.geometries.size()},
                       {"pairs_removed", result.removed_pairs.size()},
                       {"pairs_skipped", result.refinement.num_skipped_pairs}};
  report["warnings"] = ListGlobalWarnings(scene, result);
  for (const CoarseStep& step : result.steps) {
    report["steps"].push_back({{"name", step.name},
                               {"seconds", step.seconds},
                               {"summary", step.summary}});
  }
  return report.dump(2) + "\n";
}

std::string FormatGlobalReportText(const GlobalStageResult& result,
                                   double total_seconds) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(2);
  for (const CoarseStep& step : result.steps) {
    text << std::setw(8) << step.seconds << " s  " << step.name << ": "
         << step.summary << "\n";
  }
  for (size_t i = 0; i < result.models.size(); ++i) {
    const CoarseModel& model = result.models[i];
    text << "Model " << i << ": " << model.reconstruction.NumRegImages()
         << " images, " << model.num_points << " points, "
         << (model.inertial_scale_sigma > 0.0 ? "in metres by the accelerometer"
             : model.metric                   ? "in metres"
                                              : "scale unknown")
         << ", " << (model.gravity_aligned ? "z up" : "gravity unknown");
    if (model.positions.success) {
      text << ", georeferenced by " << model.positions.num_inliers << " of "
           << model.positions.num_positions << " positions";
    }
    const CoarseComponent& component = result.poses.components[i];
    if (!component.rotations_converged) text << ", rotations not converged";
    if (!model.pair_agreement.IsSound()) text << ", contradicts vision";
    if (model.num_points == 0) {
      text << "; no points, poses by the sensors alone\n";
      continue;
    }
    text << "; " << 100.0 * model.pair_agreement.share
         << " % of the pairs agree with the poses, "
         << 100.0 * model.pair_agreement.least_image_share
         << " % at the worst image\n";
  }
  text << "Total: " << total_seconds << " s\n";
  return text.str();
}

std::vector<std::string> ListGlobalWarnings(const SceneData& scene,
                                            const GlobalStageResult& result) {
  std::vector<std::string> warnings;
  AppendLostImages(scene, result, &warnings);
  const CameraImuRotationReports& rotations = result.poses.camera_imu_rotations;
  for (const auto& [drive, camera_imu] : rotations) {
    AppendCameraImuWarning(
        rotations.size() > 1 ? DriveName(scene, drive) : std::string(),
        camera_imu, &warnings);
  }
  for (const auto& [drive, shift_s] : result.time_shifts) {
    AppendTimeShiftWarning(
        HasSeveralDrives(scene) ? DriveName(scene, drive) : std::string(),
        shift_s, &warnings);
  }
  for (const auto& [drive, scales] : result.gyroscope_scales) {
    AppendGyroscopeWarning(
        HasSeveralDrives(scene) ? DriveName(scene, drive) : std::string(),
        scales, &warnings);
  }
  for (const CoarseModel& model : result.models) {
    AppendPriorWarnings(model, &warnings);
    if (model.positions.failure.empty()) continue;
    warnings.push_back(
        "a model of " + std::to_string(model.reconstruction.NumRegImages()) +
        " images is not georeferenced: " + model.positions.failure);
  }
  for (const CoarseModel& model : result.models) {
    if (model.pair_agreement.IsSound()) continue;
    std::ostringstream text;
    text << std::fixed << std::setprecision(0)
         << "the coarse model contradicts vision: "
         << 100.0 * model.pair_agreement.share
         << " % of the verified pairs agree with its poses, "
         << 100.0 * model.pair_agreement.least_image_share
         << " % at the worst image; false pairs outweigh true ones, or the "
            "overlap is small: see the report (adasfm_reporter), add sensors "
            "or match more pairs";
    warnings.push_back(text.str());
  }
  const LoopClosureReport& loops = result.poses.loop_closures;
  for (const UnconfirmedClosure& closure : loops.unconfirmed_closures) {
    if (loops.segments_were_split &&
        closure.num_pairs >= kMinNumReportedPairs) {
      warnings.push_back(DescribeUnconfirmedClosure(scene, closure));
    }
  }
  for (const CoarseComponent& component : result.poses.components) {
    for (const UnconfirmedClosure& closure : component.unconfirmed_closures) {
      std::ostringstream text;
      text << closure.num_images
           << " images are connected to the rest at one place only ("
           << closure.num_pairs << " pairs like "
           << scene.images.at(closure.image_id1).name << " and "
           << scene.images.at(closure.image_id2).name
           << "); if these are two places that look alike the model is "
              "folded: add sensors (adasfm_prior_importer) or match more pairs";
      warnings.push_back(text.str());
    }
  }
  return warnings;
}

std::string FormatRemovedPairs(const SceneData& scene,
                               const GlobalStageResult& result) {
  std::ostringstream text;
  const ViewGraph& graph = result.poses.graph;
  for (const ImagePair& pair : result.removed_pairs) {
    const int e = FindEdge(graph, pair);
    const bool was_kept = e >= 0 && graph.edges[e].IsKept();
    text << scene.images.at(pair.image_id1).name << " "
         << scene.images.at(pair.image_id2).name << "\t"
         << (e < 0 || was_kept ? "too few matches fit the poses"
                               : EdgeRemovalName(graph.edges[e].removal))
         << "\n";
  }
  return text.str();
}

}  // namespace adasfm
