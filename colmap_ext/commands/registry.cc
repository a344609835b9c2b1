// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/registry.h"

namespace adasfm {

const std::vector<Command>& Commands() {
  static const std::vector<Command> commands = {
      {"adasfm_automatic_reconstructor",
       "from photos and sensor logs to a model and its report",
       RunAdasfmAutomaticReconstructor},
      {"adasfm_database_merger",
       "joins databases: shards of one, or several sessions",
       RunAdasfmDatabaseMerger},
      {"adasfm_evaluator", "compares a model with the ground truth",
       RunAdasfmEvaluator},
      {"adasfm_georeferencer", "writes a model in another frame of the Earth",
       RunAdasfmGeoreferencer},
      {"adasfm_global",
       "coarse global SfM with sensor priors; cleans the matches",
       RunAdasfmGlobal},
      {"adasfm_mapper",
       "parallel incremental SfM steered by the coarse model, merged into one",
       RunAdasfmMapper},
      {"adasfm_pair_generator", "chooses the pairs of images to match",
       RunAdasfmPairGenerator},
      {"adasfm_prior_importer",
       "turns IMU and wheel logs into priors in the database",
       RunAdasfmPriorImporter},
      {"adasfm_reporter", "shows a model in one HTML file to look at",
       RunAdasfmReporter},
      {"adasfm_restorer", "undoes what adasfm_global rewrote in the database",
       RunAdasfmRestorer},
      {"adasfm_synthesizer", "makes a drive with ground truth",
       RunAdasfmSynthesizer},
      {"adasfm_version", "versions of this program and of its COLMAP",
       RunAdasfmVersion},
  };
  return commands;
}

const Command* FindCommand(const std::string& name) {
  for (const Command& command : Commands()) {
    if (name == command.name) return &command;
  }
  return nullptr;
}

}  // namespace adasfm
