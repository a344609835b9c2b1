// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/join_models.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "colmap_ext/coarse/measure_size.h"
#include "colmap_ext/coarse/model_input.h"
#include "colmap_ext/coarse/model_sights.h"
#include "colmap_ext/coarse/refine_stage_matches.h"
#include "colmap_ext/host/pose_conversion.h"
#include "core/so3.h"
#include "global/odometry/inertial_breaks.h"
#include "global/structure/join_parts.h"

namespace adasfm {
namespace {

// 1 sigma of log(size), as in FindPartsOfOneUnit.
constexpr double kMaxLogSizeSigma = 0.05;
using Matches = std::map<ImagePair, std::vector<FeatureMatch>>;

struct Join {
  int a = 0;
  int b = 0;
  PartJoin join;
};

bool MayJoin(const ViewGraphEdge& edge) {
  return edge.source != EdgeSource::kSensor &&
         (edge.removal == EdgeRemoval::kUnknownSize ||
          edge.removal == EdgeRemoval::kDisconnected);
}

// Models by image; those in metres do not take part.
std::map<image_t, int> FindModels(const GlobalStageResult& result) {
  std::map<image_t, int> model_of;
  for (size_t k = 0; k < result.models.size(); ++k) {
    if (result.models[k].metric) continue;
    for (const auto& [id, pose] : result.poses.components[k].cams_from_world) {
      model_of[id] = static_cast<int>(k);
    }
  }
  return model_of;
}

int ModelOf(const std::map<image_t, int>& model_of, image_t image_id) {
  const auto found = model_of.find(image_id);
  return found == model_of.end() ? -1 : found->second;
}

class ModelJoiner {
 public:
  ModelJoiner(const GlobalStageOptions& options, const SceneData& scene,
              const std::map<image_t, std::vector<Bearing>>& bearings,
              const Matches& matches, GlobalStageResult* result)
      : options_(options),
        scene_(scene),
        bearings_(bearings),
        matches_(matches),
        result_(*result),
        model_of_(FindModels(*result)) {}

  int Run() {
    std::map<std::pair<int, int>, std::vector<ImagePair>> across;
    for (const ViewGraphEdge& edge : result_.poses.graph.edges) {
      if (!MayJoin(edge) || matches_.count(edge.Pair()) == 0) continue;
      const int model1 = ModelOf(model_of_, edge.image_id1);
      const int model2 = ModelOf(model_of_, edge.image_id2);
      if (model1 < 0 || model2 < 0 || model1 == model2) continue;
      across[std::minmax(model1, model2)].push_back(edge.Pair());
    }
    std::vector<Join> joins;
    for (const auto& [models, pairs] : across) {
      std::optional<PartJoin> join =
          Estimate(models.first, models.second, pairs);
      if (join) joins.push_back({models.first, models.second, *join});
    }
    return MakeJoins(std::move(joins));
  }

 private:
  Matches MatchesWithin(const std::set<int>& models, bool across) const {
    Matches within;
    for (const ViewGraphEdge& edge : result_.poses.graph.edges) {
      if (!edge.IsKept() && !(across && MayJoin(edge))) continue;
      const auto found = matches_.find(edge.Pair());
      if (found == matches_.end() ||
          models.count(ModelOf(model_of_, edge.image_id1)) == 0 ||
          models.count(ModelOf(model_of_, edge.image_id2)) == 0) {
        continue;
      }
      within.insert(*found);
    }
    return within;
  }

  const ModelPoints& PointsOf(int model) {
    const auto known = points_.find(model);
    if (known != points_.end()) return known->second;
    return points_[model] =
               TriangulateModel(options_.structure, result_.models[model],
                                MatchesWithin({model}, false));
  }

  // Rotation from the components' common world to that of a model, by these
  // images.
  Eigen::Quaterniond ModelFromRotations(int model,
                                        const std::set<image_t>& images) const {
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (const auto& [id, pose] :
         result_.poses.components[model].cams_from_world) {
      if (images.count(id) == 0) continue;
      const Eigen::Quaterniond turn =
          points_.at(model).cams_from_world.at(id).rotation.conjugate() *
          pose.rotation;
      sum += turn.coeffs() * (turn.coeffs().dot(sum) < 0.0 ? -1.0 : 1.0);
    }
    return Eigen::Quaterniond(sum.normalized());
  }

  std::optional<PartJoin> Estimate(int a, int b,
                                   const std::vector<ImagePair>& pairs) {
    std::set<image_t> images;
    for (const ImagePair& pair : pairs) {
      images.insert({pair.image_id1, pair.image_id2});
    }
    const std::vector<SightAcross> sights =
        FindSightsAcross(PointsOf(a), PointsOf(b), pairs, matches_);
    return EstimatePartJoin(sights,
                            ModelFromRotations(a, images) *
                                ModelFromRotations(b, images).conjugate());
  }

  int MakeJoins(std::vector<Join> joins);
  bool Adjust(const std::set<int>& models,
              std::map<image_t, Rigid3d> cams_from_world);

  const GlobalStageOptions& options_;
  const SceneData& scene_;
  const std::map<image_t, std::vector<Bearing>>& bearings_;
  const Matches& matches_;
  GlobalStageResult& result_;
  std::map<image_t, int> model_of_;
  std::map<int, ModelPoints> points_;
};

// Applies the joins known well enough, the best first. Sets, for each model,
// the representative of its group and the similarity into the world of that.
void GroupModels(std::vector<Join> joins, std::vector<int>* group_of_model,
                 std::vector<Sim3d>* group_from_models) {
  std::sort(joins.begin(), joins.end(), [](const Join& x, const Join& y) {
    return x.join.log_scale_sigma < y.join.log_scale_sigma;
  });
  std::vector<int>& group_of = *group_of_model;
  std::vector<Sim3d>& group_from_model = *group_from_models;
  std::iota(group_of.begin(), group_of.end(), 0);
  for (const Join& join : joins) {
    if (join.join.log_scale_sigma > kMaxLogSizeSigma) break;
    const int a = group_of[join.a];
    const int b = group_of[join.b];
    if (a == b) continue;
    const Sim3d a_from_b = group_from_model[join.a] * join.join.a_from_b *
                           group_from_model[join.b].Inverse();
    for (size_t k = 0; k < group_of.size(); ++k) {
      if (group_of[k] != b) continue;
      group_of[k] = a;
      group_from_model[k] = a_from_b * group_from_model[k];
    }
  }
}

int ModelJoiner::MakeJoins(std::vector<Join> joins) {
  const size_t num_models = result_.models.size();
  std::vector<int> group_of(num_models);
  std::vector<Sim3d> group_from_model(num_models);
  GroupModels(std::move(joins), &group_of, &group_from_model);
  int num_joins = 0;
  for (size_t root = 0; root < num_models; ++root) {
    std::set<int> models;
    std::map<image_t, Rigid3d> cams_from_world;
    for (size_t k = 0; k < num_models; ++k) {
      if (group_of[k] != group_of[root]) continue;
      models.insert(static_cast<int>(k));
      for (const auto& [id, pose] :
           CamsFromWorld(result_.models[k].reconstruction)) {
        cams_from_world[id] = TransformCamFromWorld(group_from_model[k], pose);
      }
    }
    if (models.size() < 2 || *models.begin() != static_cast<int>(root)) {
      continue;
    }
    if (Adjust(models, std::move(cams_from_world))) {
      num_joins += static_cast<int>(models.size()) - 1;
    }
  }
  return num_joins;
}

// Adjusts the joined model, which replaces the first of the models; the others
// are emptied. False where it fails or is contradicted.
bool ModelJoiner::Adjust(const std::set<int>& models,
                         std::map<image_t, Rigid3d> cams_from_world) {
  const CoarsePoses& poses = result_.poses;
  CoarseModelInput input =
      CreateModelInput(options_, result_, std::move(cams_from_world));
  input.matches = MatchesWithin(models, true);
  CoarseComponent joined = poses.components[*models.begin()];
  joined.cams_from_world = input.cams_from_world;
  CoarseModel model =
      BuildCoarseModel(options_.structure, scene_, bearings_, std::move(input));
  if (!model.rounds.back().success ||
      !MeasureModelAgreement(options_, scene_, poses.graph, bearings_, model)
           .IsSound() ||
      !FindPartsByInertia(scene_.inertial_motions, poses.priors,
                          CamsFromWorld(model.reconstruction))
           .empty()) {
    return false;
  }
  for (const int k : models) {
    const CoarseComponent& part = poses.components[k];
    joined.rotations_converged &= part.rotations_converged;
    joined.positions_converged &= part.positions_converged;
    joined.sdp_optimality =
        std::min(joined.sdp_optimality, part.sdp_optimality);
    result_.models[k] = CoarseModel();
    result_.poses.components[k] = CoarseComponent();
  }
  for (ViewGraphEdge& edge : result_.poses.graph.edges) {
    if (MayJoin(edge) && models.count(ModelOf(model_of_, edge.image_id1)) &&
        models.count(ModelOf(model_of_, edge.image_id2))) {
      edge.removal = EdgeRemoval::kKept;
    }
  }
  result_.models[*models.begin()] = std::move(model);
  result_.poses.components[*models.begin()] = std::move(joined);
  return true;
}

}  // namespace

void SortModels(GlobalStageResult* result) {
  std::vector<size_t> order;
  for (size_t k = 0; k < result->models.size(); ++k) {
    if (!result->poses.components[k].cams_from_world.empty()) {
      order.push_back(k);
    }
  }
  std::stable_sort(order.begin(), order.end(), [result](size_t a, size_t b) {
    return result->poses.components[a].cams_from_world.size() >
           result->poses.components[b].cams_from_world.size();
  });
  std::vector<CoarseModel> models;
  std::vector<CoarseComponent> components;
  for (const size_t k : order) {
    models.push_back(std::move(result->models[k]));
    components.push_back(std::move(result->poses.components[k]));
  }
  result->models = std::move(models);
  result->poses.components = std::move(components);
}

int JoinModels(const GlobalStageOptions& options, const SceneData& scene,
               const std::map<image_t, std::vector<Bearing>>& bearings,
               const std::map<ImagePair, std::vector<FeatureMatch>>& matches,
               GlobalStageResult* result) {
  return ModelJoiner(options, scene, bearings, matches, result).Run();
}

}  // namespace adasfm
