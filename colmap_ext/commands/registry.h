// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "colmap_ext/commands/command.h"

namespace adasfm {

// The commands, each in commands/<its name>.cc.
Status RunAdasfmAutomaticReconstructor(int argc, char** argv);
Status RunAdasfmDatabaseMerger(int argc, char** argv);
Status RunAdasfmEvaluator(int argc, char** argv);
Status RunAdasfmGeoreferencer(int argc, char** argv);
Status RunAdasfmGlobal(int argc, char** argv);
Status RunAdasfmMapper(int argc, char** argv);
Status RunAdasfmPairGenerator(int argc, char** argv);
Status RunAdasfmPriorImporter(int argc, char** argv);
Status RunAdasfmReporter(int argc, char** argv);
Status RunAdasfmRestorer(int argc, char** argv);
Status RunAdasfmSynthesizer(int argc, char** argv);
Status RunAdasfmVersion(int argc, char** argv);

// All commands, by name. A new command is one line in registry.cc.
const std::vector<Command>& Commands();

// None when the name is unknown.
const Command* FindCommand(const std::string& name);

}  // namespace adasfm
