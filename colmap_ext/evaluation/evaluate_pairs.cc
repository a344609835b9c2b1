// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/evaluation/evaluate_pairs.h"

#include <algorithm>
#include <fstream>
#include <optional>
#include <sstream>
#include <utility>

#include "colmap_ext/host/camera.h"
#include "colmap_ext/scene/two_view_poses.h"
#include "core/strict_stream.h"

namespace adasfm {
namespace {

using PairPoses = std::map<ImagePair, Rigid3d>;

// Relative poses from which the global stage starts.
PairPoses FindPairPoses(const SceneData& scene) {
  std::map<image_t, std::vector<Bearing>> bearings;
  for (const auto& [image_id, image] : scene.images) {
    bearings[image_id] =
        ComputeBearings(scene.cameras.at(image.camera_id), image.keypoints);
  }
  PairPoses poses;
  for (const ViewGraphEdge& edge :
       BuildInitialViewGraph(scene, bearings).graph.edges) {
    poses[edge.Pair()] = edge.cam2_from_cam1;
  }
  return poses;
}

// Looks up the truth of a pair.
class PairTruth {
 public:
  PairTruth(const SceneData& scene, const NamedPoses& poses,
            const KeypointLandmarks& landmarks) {
    for (const auto& [image_id, image] : scene.images) {
      const auto pose = poses.find(image.name);
      if (pose != poses.end()) poses_[image_id] = pose->second;
      const auto ids = landmarks.find(image.name);
      if (ids != landmarks.end()) landmarks_[image_id] = &ids->second;
    }
  }

  std::optional<Rigid3d> Cam2FromCam1(const ImagePair& pair) const {
    const auto pose1 = poses_.find(pair.image_id1);
    const auto pose2 = poses_.find(pair.image_id2);
    if (pose1 == poses_.end() || pose2 == poses_.end()) return std::nullopt;
    return ComputeCam2FromCam1(pose1->second, pose2->second);
  }

  int64_t CountTrue(const ImagePair& pair,
                    const std::vector<FeatureMatch>& matches) const {
    const auto ids1 = landmarks_.find(pair.image_id1);
    const auto ids2 = landmarks_.find(pair.image_id2);
    if (ids1 == landmarks_.end() || ids2 == landmarks_.end()) return 0;
    return std::count_if(
        matches.begin(), matches.end(), [&](const FeatureMatch& match) {
          if (match.point2D_idx1 >= ids1->second->size() ||
              match.point2D_idx2 >= ids2->second->size()) {
            return false;
          }
          const int id = (*ids1->second)[match.point2D_idx1];
          return id >= 0 && id == (*ids2->second)[match.point2D_idx2];
        });
  }

 private:
  std::map<image_t, Rigid3d> poses_;
  std::map<image_t, const std::vector<int>*> landmarks_;
};

// Accumulates the figures of one set of two-view geometries.
class PairSetCounter {
 public:
  explicit PairSetCounter(const PairTruth& truth) : truth_(truth) {}

  void Add(const ImagePair& pair, const Rigid3d& cam2_from_cam1,
           const Rigid3d& true_cam2_from_cam1,
           const std::vector<FeatureMatch>& matches, size_t num_raw_matches) {
    ++figures_.num_pairs;
    auc_.Add(cam2_from_cam1, true_cam2_from_cam1);
    const int64_t num_true = truth_.CountTrue(pair, matches);
    figures_.num_matches += matches.size();
    figures_.num_true_matches += num_true;
    figures_.num_false_pairs +=
        2 * num_true < static_cast<int64_t>(matches.size());
    if (num_raw_matches == 0) return;
    constexpr int kNumBins = PairSetFigures::kNumBins;
    const double ratio = static_cast<double>(matches.size()) / num_raw_matches;
    const int bin = std::min(static_cast<int>(kNumBins * ratio), kNumBins - 1);
    ++figures_.inlier_ratio_histogram[bin];
    sum_ratios_ += ratio;
    ++num_ratios_;
  }

  PairSetFigures Result() const {
    PairSetFigures figures = figures_;
    figures.auc = auc_.Result();
    if (num_ratios_ > 0) figures.mean_inlier_ratio = sum_ratios_ / num_ratios_;
    return figures;
  }

 private:
  const PairTruth& truth_;
  PairSetFigures figures_;
  RelativePoseAucCounter auc_;
  double sum_ratios_ = 0.0;
  int num_ratios_ = 0;
};

}  // namespace

StatusOr<KeypointLandmarks> ReadKeypointLandmarks(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    return Status::Error("cannot read " + path + "; check --landmarks_path");
  }
  ThrowOnFailure(&file);
  KeypointLandmarks landmarks;
  int line_number = 0;
  for (std::string line; std::getline(file, line);) {
    ++line_number;
    std::istringstream words(line);
    ThrowOnFailure(&words);
    std::string name;
    if (!(words >> name) || name[0] == '#') continue;
    std::vector<int>& ids = landmarks[name];
    for (int id; words >> id;) ids.push_back(id);
    if (words.eof()) continue;
    return Status::Error(path + ":" + std::to_string(line_number) +
                         ": not `image_name id id ...`");
  }
  return landmarks;
}

StatusOr<PairEvaluation> EvaluatePairs(const SceneData& original,
                                       const SceneData& present,
                                       const NamedPoses& true_cams_from_world,
                                       const KeypointLandmarks& landmarks) {
  const PairTruth truth(original, true_cams_from_world, landmarks);
  const PairPoses poses_before = FindPairPoses(original);
  const PairPoses poses_after = FindPairPoses(present);
  std::map<ImagePair, const ScenePair*> present_pairs;
  for (const ScenePair& pair : present.pairs) {
    present_pairs[ImagePair(pair.image_id1, pair.image_id2)] = &pair;
  }
  PairEvaluation evaluation;
  evaluation.has_landmarks = !landmarks.empty();
  PairSetCounter verified(truth);
  PairSetCounter kept_before(truth);
  PairSetCounter kept_after(truth);
  for (const ScenePair& pair : original.pairs) {
    const ImagePair ids(pair.image_id1, pair.image_id2);
    const std::optional<Rigid3d> true_pose = truth.Cam2FromCam1(ids);
    const auto before = poses_before.find(ids);
    if (!true_pose.has_value() || before == poses_before.end()) continue;
    evaluation.num_true_raw_matches += truth.CountTrue(
        ids, pair.raw_matches.empty() ? pair.inlier_matches : pair.raw_matches);
    const size_t num_raw = pair.raw_matches.size();
    verified.Add(ids, before->second, *true_pose, pair.inlier_matches, num_raw);
    const auto now = present_pairs.find(ids);
    const auto after = poses_after.find(ids);
    if (now == present_pairs.end() || after == poses_after.end()) continue;
    kept_before.Add(ids, before->second, *true_pose, pair.inlier_matches,
                    num_raw);
    kept_after.Add(ids, after->second, *true_pose, now->second->inlier_matches,
                   num_raw);
  }
  evaluation.verified = verified.Result();
  evaluation.kept_before = kept_before.Result();
  evaluation.kept_after = kept_after.Result();
  if (evaluation.verified.num_pairs == 0) {
    return Status::Error(
        "no verified pair of the database has true poses of both images; "
        "compare the image names");
  }
  return evaluation;
}

StatusOr<PairEvaluation> EvaluateDatabasePairs(
    const std::string& database_path, const NamedPoses& true_cams_from_world,
    const std::string& landmarks_path) {
  KeypointLandmarks landmarks;
  if (!landmarks_path.empty()) {
    StatusOr<KeypointLandmarks> read = ReadKeypointLandmarks(landmarks_path);
    if (!read.ok()) return read.status();
    landmarks = std::move(read).value();
  }
  SceneDataOptions options;
  const StatusOr<SceneData> present = ReadSceneData(database_path, options);
  if (!present.ok()) return present.status();
  options.read_raw_matches = true;
  options.use_original_two_view_geometries = true;
  const StatusOr<SceneData> original = ReadSceneData(database_path, options);
  if (!original.ok()) return original.status();
  return EvaluatePairs(*original, *present, true_cams_from_world, landmarks);
}

}  // namespace adasfm
