// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/coarse/split_models.h"

#include <set>
#include <utility>

#include "colmap_ext/coarse/measure_size.h"
#include "colmap_ext/coarse/model_input.h"
#include "colmap_ext/host/pose_conversion.h"
#include "colmap_ext/scene/untied_parts.h"
#include "global/odometry/inertial_breaks.h"

namespace adasfm {
namespace {

using Matches = std::map<ImagePair, std::vector<FeatureMatch>>;

class ModelSplitter {
 public:
  ModelSplitter(const GlobalStageOptions& options, const SceneData& scene,
                const std::map<image_t, std::vector<Bearing>>& bearings,
                const Matches& matches, GlobalStageResult* result)
      : options_(options),
        scene_(scene),
        bearings_(bearings),
        matches_(matches),
        result_(*result) {}

  // These return the number of parts taken out of a model.
  int SplitUntied(size_t model) {
    std::vector<RelativePosePrior> priors = result_.poses.priors;
    priors.insert(priors.end(), scene_.frame_priors.begin(),
                  scene_.frame_priors.end());
    return TakeOut(
        FindUntiedParts(priors, result_.models[model].reconstruction), model);
  }

  int SplitByInertia(size_t model) {
    return TakeOut(
        FindPartsByInertia(scene_.inertial_motions, result_.poses.priors,
                           CamsFromWorld(result_.models[model].reconstruction)),
        model);
  }

 private:
  int TakeOut(const std::vector<std::set<image_t>>& groups, size_t model) {
    if (groups.empty()) return 0;
    const std::map<image_t, Rigid3d> poses =
        CamsFromWorld(result_.models[model].reconstruction);
    std::set<image_t> rest;
    for (const auto& [image_id, pose] : poses) rest.insert(image_id);
    for (const std::set<image_t>& group : groups) {
      for (const image_t image_id : group) rest.erase(image_id);
    }
    RemovePairsAcross(groups, rest);
    const CoarseComponent component = result_.poses.components[model];
    for (const std::set<image_t>& group : groups) {
      result_.poses.components.push_back(Restrict(component, poses, group));
      result_.models.push_back(Build(result_.poses.components.back()));
    }
    result_.poses.components[model] = Restrict(component, poses, rest);
    result_.models[model] = Build(result_.poses.components[model]);
    return static_cast<int>(groups.size());
  }

  void RemovePairsAcross(const std::vector<std::set<image_t>>& groups,
                         const std::set<image_t>& rest) {
    std::map<image_t, int> group_of;
    for (const image_t image_id : rest) group_of[image_id] = -1;
    for (size_t k = 0; k < groups.size(); ++k) {
      for (const image_t image_id : groups[k]) {
        group_of[image_id] = static_cast<int>(k);
      }
    }
    for (ViewGraphEdge& edge : result_.poses.graph.edges) {
      const auto first = group_of.find(edge.image_id1);
      const auto second = group_of.find(edge.image_id2);
      if (edge.IsKept() && first != group_of.end() &&
          second != group_of.end() && first->second != second->second) {
        edge.removal = EdgeRemoval::kUnknownSize;
      }
    }
  }

  static CoarseComponent Restrict(CoarseComponent component,
                                  const std::map<image_t, Rigid3d>& poses,
                                  const std::set<image_t>& images) {
    component.cams_from_world.clear();
    for (const image_t image_id : images) {
      component.cams_from_world.emplace(image_id, poses.at(image_id));
    }
    return component;
  }

  CoarseModel Build(const CoarseComponent& component) const {
    CoarseModelInput input =
        CreateModelInput(options_, result_, component.cams_from_world);
    for (const ViewGraphEdge& edge : result_.poses.graph.edges) {
      const auto found = matches_.find(edge.Pair());
      if (edge.IsKept() && found != matches_.end() &&
          input.cams_from_world.count(edge.image_id1) > 0 &&
          input.cams_from_world.count(edge.image_id2) > 0) {
        input.matches.insert(*found);
      }
    }
    return BuildCoarseModel(options_.structure, scene_, bearings_,
                            std::move(input));
  }

  const GlobalStageOptions& options_;
  const SceneData& scene_;
  const std::map<image_t, std::vector<Bearing>>& bearings_;
  const Matches& matches_;
  GlobalStageResult& result_;
};

}  // namespace

int SplitModels(const GlobalStageOptions& options, const SceneData& scene,
                const std::map<image_t, std::vector<Bearing>>& bearings,
                const Matches& matches, GlobalStageResult* result) {
  ModelSplitter splitter(options, scene, bearings, matches, result);
  // Positions constrain each image by itself.
  const auto may_split = [result](size_t k) {
    return !result->models[k].metric && !result->models[k].positions.success;
  };
  int num_parts = 0;
  for (const auto split :
       {&ModelSplitter::SplitUntied, &ModelSplitter::SplitByInertia}) {
    const size_t num_models = result->models.size();
    for (size_t k = 0; k < num_models; ++k) {
      if (may_split(k)) num_parts += (splitter.*split)(k);
    }
  }
  return num_parts;
}

}  // namespace adasfm
