// SPDX-License-Identifier: BSD-3-Clause
#include "colmap_ext/commands/registry.h"

namespace adasfm {

const std::vector<Command>& Commands() {
  static const std::vector<Command> commands = {};
  return commands;
}

const Command* FindCommand(const std::string& name) {
  for (const Command& command : Commands()) {
    if (name == command.name) return &command;
  }
  return nullptr;
}

}  // namespace adasfm
