// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/global_report.h"

#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "colmap_ext/coarse/global_warnings.h"
#include "colmap_ext/coarse/weak_places.h"
#include "colmap_ext/scene/drives.h"
#include "core/so3.h"

namespace adasfm {
namespace {

using Json = nlohmann::ordered_json;

Json ClosuresJson(const SceneData& scene,
                  const std::vector<SegmentClosure>& closures) {
  Json json = Json::array();
  for (const SegmentClosure& closure : closures) {
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
          {"by_vision", ClosuresJson(scene, report.closures_by_vision)},
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
    report["gyroscope_scales"].push_back(
        {{"first_image", DriveName(scene, drive)},
         {"scales", {scales.x(), scales.y(), scales.z()}}});
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
