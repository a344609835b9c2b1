// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/registry.h"

namespace adasfm {

const std::vector<Command>& Commands() {
  static const std::vector<Command> commands = {
      {"adasfm_automatic_reconstructor",
       "reconstructs a model from photos and sensor logs, with a report",
       RunAdasfmAutomaticReconstructor},
      {"adasfm_database_merger",
       "joins databases: shards of one, or several sessions",
       RunAdasfmDatabaseMerger},
      {"adasfm_evaluator", "compares a model with the ground truth",
       RunAdasfmEvaluator},
      {"adasfm_georeferencer",
       "converts a georeferenced model to ECEF, UTM or another ENU",
       RunAdasfmGeoreferencer},
      {"adasfm_global",
       "coarse global SfM with sensor priors; cleans the matches",
       RunAdasfmGlobal},
      {"adasfm_mapper",
       "maps parts in parallel, guided by the coarse model, and merges them",
       RunAdasfmMapper},
      {"adasfm_pair_generator", "selects the image pairs to match",
       RunAdasfmPairGenerator},
      {"adasfm_prior_importer",
       "writes priors from IMU, wheel and GNSS logs to the database",
       RunAdasfmPriorImporter},
      {"adasfm_reporter", "writes a report of a model as one HTML file",
       RunAdasfmReporter},
      {"adasfm_restorer", "restores what adasfm_global rewrote in the database",
       RunAdasfmRestorer},
      {"adasfm_synthesizer", "simulates a drive with ground truth",
       RunAdasfmSynthesizer},
      {"adasfm_version", "prints the versions of this program and of COLMAP",
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
